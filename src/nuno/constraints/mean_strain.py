"""The mean deformation of a voxel's five tetrahedra: elastic without the locking of each one by itself.

With a, b, c, d the corners of a voxel's inner tetrahedron and e, f, g, h those across from them, the mean of the five
deformation gradients, weighted by volume, is the deformation gradient of a tetrahedron of the inner one's rest shape
with the corners 2/3 a - 1/3 e, 2/3 b - 1/3 f, and so on. No two of them share a vertex, so that it is solved like any
other element, with the inverse masses 4/9 w_a + 1/9 w_e and so on.
"""

from typing import Any

import warp as wp

from nuno.constraints.tetrahedron import element_reply
from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import add, choose, fused, fused_subtract, mul, sub  # noqa: F401
from nuno.topology.soft_topology import OWN_SHARE

OWN = wp.constant(OWN_SHARE)
MEAN = wp.constant(3.0 * (1.0 - OWN_SHARE))
"""Of the inner tetrahedron's stiffness, that of the mean: the voxel has three times its volume."""
NEAR, FAR = wp.constant(2.0 / 3.0), wp.constant(1.0 / 3.0)
"""The weights of a corner of the inner tetrahedron, and of that across from it."""


@wp.func
def mean_edge(ax: Any, bx: Any, ex: Any, fx: Any):
    """One coordinate of the edge from the first corner of the mean tetrahedron to the second."""
    return (bx - ax) * NEAR - (fx - ex) * FAR


@wp.func
def solve_mean(
    t: Any, e: Any, f: Any, g: Any, h: Any, ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any,
    cx: Any, cy: Any, cz: Any, dx: Any, dy: Any, dz: Any, wa: Any, wb: Any, wc: Any, wd: Any,
    m11: Any, m22: Any, m33: Any, m12: Any, m13: Any, m23: Any, inverse: Any, mu: Any, bulk: Any,
):  # fmt: skip
    """Solve the mean of a voxel's tetrahedra as `nuno.constraints.tetrahedron.solve_tetrahedron` does one of them.

    A mean that is inside out, or stretched beyond what an element keeps to, moves nothing: its tetrahedra right
    themselves.

    Args:
        t: The state; the corners e to h are moved there.
        e: The vertex across from a.
        f: From b.
        g: From c.
        h: From d.
        ax: Where the inner element's first corner is [m], and so on.
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
        wa: Its inverse mass [1/kg], and so on.
        wb: Of the second.
        wc: Of the third.
        wd: Of the fourth.
        m11: The inner element's numbers, and so on.
        m22: Column 1.
        m33: Column 2.
        m12: Column 3.
        m13: Column 4.
        m23: Column 5.
        inverse: 1 / (6 v).
        mu: The mean's shear modulus times dt^2 and the filled fraction; 0 where there is no mean.
        bulk: Its second modulus times the same.

    Returns:
        Where a, b, c and d are then [m].
    """
    ex = at(t.x, e)
    ey = at(t.y, e)
    ez = at(t.z, e)
    fx = at(t.x, f)
    fy = at(t.y, f)
    fz = at(t.z, f)
    gx = at(t.x, g)
    gy = at(t.y, g)
    gz = at(t.z, g)
    hx = at(t.x, h)
    hy = at(t.y, h)
    hz = at(t.z, h)
    we = at(t.w, e)
    wf = at(t.w, f)
    wg = at(t.w, g)
    wh = at(t.w, h)
    rax, ray, raz, rbx, rby, rbz, rcx, rcy, rcz, rdx, rdy, rdz, sigma, _j, bad = element_reply(
        mean_edge(ax, bx, ex, fx), mean_edge(ay, by, ey, fy), mean_edge(az, bz, ez, fz),
        mean_edge(ax, cx, ex, gx), mean_edge(ay, cy, ey, gy), mean_edge(az, cz, ez, gz),
        mean_edge(ax, dx, ex, hx), mean_edge(ay, dy, ey, hy), mean_edge(az, dz, ez, hz),
        (wa * NEAR) * NEAR + (we * FAR) * FAR, (wb * NEAR) * NEAR + (wf * FAR) * FAR,
        (wc * NEAR) * NEAR + (wg * FAR) * FAR, (wd * NEAR) * NEAR + (wh * FAR) * FAR,
        m11, m22, m33, m12, m13, m23, inverse, mu, bulk,
    )  # fmt: skip
    sigma = choose(bad, 0.0, sigma)
    near = sigma * NEAR
    far = sigma * FAR
    ka = far * we
    kb = far * wf
    kc = far * wg
    kd = far * wh
    put(t.x, e, fused_subtract(ka, rax, ex))
    put(t.y, e, fused_subtract(ka, ray, ey))
    put(t.z, e, fused_subtract(ka, raz, ez))
    put(t.x, f, fused(kb, rbx, fx))
    put(t.y, f, fused(kb, rby, fy))
    put(t.z, f, fused(kb, rbz, fz))
    put(t.x, g, fused(kc, rcx, gx))
    put(t.y, g, fused(kc, rcy, gy))
    put(t.z, g, fused(kc, rcz, gz))
    put(t.x, h, fused(kd, rdx, hx))
    put(t.y, h, fused(kd, rdy, hy))
    put(t.z, h, fused(kd, rdz, hz))
    ka = near * wa
    kb = near * wb
    kc = near * wc
    kd = near * wd
    ax = fused(ka, rax, ax)
    ay = fused(ka, ray, ay)
    az = fused(ka, raz, az)
    bx = fused_subtract(kb, rbx, bx)
    by = fused_subtract(kb, rby, by)
    bz = fused_subtract(kb, rbz, bz)
    cx = fused_subtract(kc, rcx, cx)
    cy = fused_subtract(kc, rcy, cy)
    cz = fused_subtract(kc, rcz, cz)
    dx = fused_subtract(kd, rdx, dx)
    dy = fused_subtract(kd, rdy, dy)
    dz = fused_subtract(kd, rdz, dz)
    return ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz
