"""A tetrahedron's viscosity: it damps how fast its shape changes, never how it moves or turns."""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, fill, fused, lessened, most, mul, over, sub, times  # noqa: F401
from nuno.solver.tetrahedron import add_dot, combine, dot
from nuno.solver.vector import at, put, scaled

SHARE, MOST = wp.constant(0.2), wp.constant(0.9)
"""An element's reply T to its own viscosity counts as 1 + 0.2 T: what the rest of the pass does not undo is half of
what the three directions of T have on average. Below 0.9 T an element would turn around what it should damp."""


@wp.func
def damp_tetrahedron(
    t: Any,
    a: Any,
    b: Any,
    c: Any,
    d: Any,
    m11: Any,
    m22: Any,
    m33: Any,
    m12: Any,
    m13: Any,
    m23: Any,
    inverse: Any,
    eta: Any,
):
    """Viscous stress 2 mu tau E', E' the rate of Green's strain; forces v F (2 mu tau E') B^T on b, c and d.

    It works on velocities before a substep's forces come in, so that a body at rest under load stands where elasticity
    alone puts it. The stress is symmetric: momentum and angular momentum stay.

    Args:
        t: The state.
        a: The element's first vertex.
        b: Its second.
        c: Its third.
        d: Its fourth.
        m11: Column 0 of the element's numbers (see `nuno.solver.tetrahedron.COLUMNS`), and so on.
        m22: Column 1.
        m33: Column 2.
        m12: Column 3.
        m13: Column 4.
        m23: Column 5.
        inverse: 1 / (6 v).
        eta: 2 mu tau dt times the filled fraction, tau the damping.
    """
    ax = at(t.x, a)
    ay = at(t.y, a)
    az = at(t.z, a)
    ex = at(t.x, b) - ax
    ey = at(t.y, b) - ay
    ez = at(t.z, b) - az
    fx = at(t.x, c) - ax
    fy = at(t.y, c) - ay
    fz = at(t.z, c) - az
    gx = at(t.x, d) - ax
    gy = at(t.y, d) - ay
    gz = at(t.z, d) - az
    vax = at(t.vx, a)
    vay = at(t.vy, a)
    vaz = at(t.vz, a)
    vbx = at(t.vx, b)
    vby = at(t.vy, b)
    vbz = at(t.vz, b)
    vcx = at(t.vx, c)
    vcy = at(t.vy, c)
    vcz = at(t.vz, c)
    vdx = at(t.vx, d)
    vdy = at(t.vy, d)
    vdz = at(t.vz, d)
    hx = vbx - vax
    hy = vby - vay
    hz = vbz - vaz
    ix = vcx - vax
    iy = vcy - vay
    iz = vcz - vaz
    jx = vdx - vax
    jy = vdy - vay
    jz = vdz - vaz
    # half the rate of the edges' scalar products, which is what E' is in the rest shape's edges
    g11 = dot(ex, ey, ez, hx, hy, hz)
    g22 = dot(fx, fy, fz, ix, iy, iz)
    g33 = dot(gx, gy, gz, jx, jy, jz)
    g12 = add_dot(ex, ey, ez, ix, iy, iz, dot(fx, fy, fz, hx, hy, hz)) * 0.5
    g13 = add_dot(ex, ey, ez, jx, jy, jz, dot(gx, gy, gz, hx, hy, hz)) * 0.5
    g23 = add_dot(fx, fy, fz, jx, jy, jz, dot(gx, gy, gz, ix, iy, iz)) * 0.5
    q11 = fused(g13, m13, fused(g12, m12, scaled(g11, m11)))
    q12 = fused(g23, m13, fused(g22, m12, scaled(g12, m11)))
    q13 = fused(g33, m13, fused(g23, m12, scaled(g13, m11)))
    q21 = fused(g13, m23, fused(g12, m22, scaled(g11, m12)))
    q22 = fused(g23, m23, fused(g22, m22, scaled(g12, m12)))
    q23 = fused(g33, m23, fused(g23, m22, scaled(g13, m12)))
    q31 = fused(g13, m33, fused(g12, m23, scaled(g11, m13)))
    q32 = fused(g23, m33, fused(g22, m23, scaled(g12, m13)))
    q33 = fused(g33, m33, fused(g23, m23, scaled(g13, m13)))
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    wd = at(t.w, d)
    one = fill(ax, 1.0)
    # the trace of B^T S B, S the edges' scalar products, is |F|^2: a stretched element replies more
    stretched = (
        scaled(dot(ex, ey, ez, ex, ey, ez), m11)
        + scaled(dot(fx, fy, fz, fx, fy, fz), m22)
        + scaled(dot(gx, gy, gz, gx, gy, gz), m33)
        + (
            scaled(dot(ex, ey, ez, fx, fy, fz), m12)
            + scaled(dot(ex, ey, ez, gx, gy, gz), m13)
            + scaled(dot(fx, fy, fz, gx, gy, gz), m23)
        )
        * 2.0
    )
    per_volume = inverse * 6.0
    maa = m11 + m22 + m33 + (m12 + m13 + m23) * 2.0
    reply = fused(wc, m22, fused(wb, m11, scaled(wa, maa))) + scaled(wd, m33)
    reply = times(times(eta, reply), most(one, scaled(stretched, per_volume) - fill(one, 2.0)))
    s = scaled(over(eta, most(one + reply * SHARE, reply * MOST)), per_volume)
    n11 = times(s, fused(q13, m13, fused(q12, m12, scaled(q11, m11))))
    n22 = times(s, fused(q23, m23, fused(q22, m22, scaled(q21, m12))))
    n33 = times(s, fused(q33, m33, fused(q32, m23, scaled(q31, m13))))
    n12 = times(s, fused(q13, m23, fused(q12, m22, scaled(q11, m12))))
    n13 = times(s, fused(q13, m33, fused(q12, m23, scaled(q11, m13))))
    n23 = times(s, fused(q23, m33, fused(q22, m23, scaled(q21, m13))))
    rbx, rby, rbz = combine(n11, n12, n13, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    rcx, rcy, rcz = combine(n12, n22, n23, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    rdx, rdy, rdz = combine(n13, n23, n33, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    put(t.vx, a, fused(wa, rbx + rcx + rdx, vax))
    put(t.vy, a, fused(wa, rby + rcy + rdy, vay))
    put(t.vz, a, fused(wa, rbz + rcz + rdz, vaz))
    put(t.vx, b, lessened(wb, rbx, vbx))
    put(t.vy, b, lessened(wb, rby, vby))
    put(t.vz, b, lessened(wb, rbz, vbz))
    put(t.vx, c, lessened(wc, rcx, vcx))
    put(t.vy, c, lessened(wc, rcy, vcy))
    put(t.vz, c, lessened(wc, rcz, vcz))
    put(t.vx, d, lessened(wd, rdx, vdx))
    put(t.vy, d, lessened(wd, rdy, vdy))
    put(t.vz, d, lessened(wd, rdz, vdz))
