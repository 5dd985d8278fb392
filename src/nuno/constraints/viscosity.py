"""A tetrahedron's viscosity: it damps how fast its shape changes, never how it moves or turns."""

from typing import Any

import warp as wp

from nuno.constraints.tetrahedron import add_dot, combine, dot
from nuno.numbers.lanes import add, div, full_like, fused, fused_subtract, maximum, mul, sub  # noqa: F401

SHARE, MOST = wp.constant(0.2), wp.constant(0.9)
"""An element's reply T to its own viscosity counts as 1 + 0.2 T: what the rest of the pass does not undo is half of
what the three directions of T have on average. Below 0.9 T an element would turn around what it should damp."""


@wp.func
def damp_tetrahedron(
    ax: Any,
    ay: Any,
    az: Any,
    bx: Any,
    by: Any,
    bz: Any,
    cx: Any,
    cy: Any,
    cz: Any,
    dx: Any,
    dy: Any,
    dz: Any,
    vax: Any,
    vay: Any,
    vaz: Any,
    vbx: Any,
    vby: Any,
    vbz: Any,
    vcx: Any,
    vcy: Any,
    vcz: Any,
    vdx: Any,
    vdy: Any,
    vdz: Any,
    wa: Any,
    wb: Any,
    wc: Any,
    wd: Any,
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
    alone puts it. The stress is symmetric: momentum and angular momentum stay. An element whose numbers are all zero
    damps nothing.

    Args:
        ax: Where the first vertex is, along x [m]; likewise the others.
        ay: y.
        az: z.
        bx: x.
        by: y.
        bz: z.
        cx: x.
        cy: y.
        cz: z.
        dx: x.
        dy: y.
        dz: z.
        vax: How fast the first vertex is, along x [m/s]; likewise the others.
        vay: y.
        vaz: z.
        vbx: x.
        vby: y.
        vbz: z.
        vcx: x.
        vcy: y.
        vcz: z.
        vdx: x.
        vdy: y.
        vdz: z.
        wa: Inverse mass of the first [1/kg]; likewise the others.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        m11: Column 0 of the element's numbers (see `nuno.constraints.tetrahedron.COLUMNS`), and so on.
        m22: Column 1.
        m33: Column 2.
        m12: Column 3.
        m13: Column 4.
        m23: Column 5.
        inverse: 1 / (6 v).
        eta: 2 mu tau dt times the filled fraction, tau the damping.

    Returns:
        How fast the vertices are then: x, y and z of the first, and so on [m/s].
    """
    ex = bx - ax
    ey = by - ay
    ez = bz - az
    fx = cx - ax
    fy = cy - ay
    fz = cz - az
    gx = dx - ax
    gy = dy - ay
    gz = dz - az
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
    q11 = fused(g13, m13, fused(g12, m12, g11 * m11))
    q12 = fused(g23, m13, fused(g22, m12, g12 * m11))
    q13 = fused(g33, m13, fused(g23, m12, g13 * m11))
    q21 = fused(g13, m23, fused(g12, m22, g11 * m12))
    q22 = fused(g23, m23, fused(g22, m22, g12 * m12))
    q23 = fused(g33, m23, fused(g23, m22, g13 * m12))
    q31 = fused(g13, m33, fused(g12, m23, g11 * m13))
    q32 = fused(g23, m33, fused(g22, m23, g12 * m13))
    q33 = fused(g33, m33, fused(g23, m23, g13 * m13))
    one = full_like(ax, 1.0)
    # the trace of B^T S B, S the edges' scalar products, is |F|^2: a stretched element replies more
    stretched = (
        dot(ex, ey, ez, ex, ey, ez) * m11
        + dot(fx, fy, fz, fx, fy, fz) * m22
        + dot(gx, gy, gz, gx, gy, gz) * m33
        + (dot(ex, ey, ez, fx, fy, fz) * m12 + dot(ex, ey, ez, gx, gy, gz) * m13 + dot(fx, fy, fz, gx, gy, gz) * m23)
        * 2.0
    )
    per_volume = inverse * 6.0
    maa = m11 + m22 + m33 + (m12 + m13 + m23) * 2.0
    reply = fused(wc, m22, fused(wb, m11, wa * maa)) + wd * m33
    reply = eta * reply * maximum(one, stretched * per_volume - 2.0)
    s = eta / maximum(one + reply * SHARE, reply * MOST) * per_volume
    n11 = s * fused(q13, m13, fused(q12, m12, q11 * m11))
    n22 = s * fused(q23, m23, fused(q22, m22, q21 * m12))
    n33 = s * fused(q33, m33, fused(q32, m23, q31 * m13))
    n12 = s * fused(q13, m23, fused(q12, m22, q11 * m12))
    n13 = s * fused(q13, m33, fused(q12, m23, q11 * m13))
    n23 = s * fused(q23, m33, fused(q22, m23, q21 * m13))
    rbx, rby, rbz = combine(n11, n12, n13, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    rcx, rcy, rcz = combine(n12, n22, n23, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    rdx, rdy, rdz = combine(n13, n23, n33, ex, ey, ez, fx, fy, fz, gx, gy, gz)
    vax = fused(wa, rbx + rcx + rdx, vax)
    vay = fused(wa, rby + rcy + rdy, vay)
    vaz = fused(wa, rbz + rcz + rdz, vaz)
    vbx = fused_subtract(wb, rbx, vbx)
    vby = fused_subtract(wb, rby, vby)
    vbz = fused_subtract(wb, rbz, vbz)
    vcx = fused_subtract(wc, rcx, vcx)
    vcy = fused_subtract(wc, rcy, vcy)
    vcz = fused_subtract(wc, rcz, vcz)
    vdx = fused_subtract(wd, rdx, vdx)
    vdy = fused_subtract(wd, rdy, vdy)
    vdz = fused_subtract(wd, rdz, vdz)
    return vax, vay, vaz, vbx, vby, vbz, vcx, vcy, vcz, vdx, vdy, vdz
