"""Bending from a rigidity in N m, as quadratic energies of second differences (isometric bending).

On a sheet's grid the energy density 1/2 B (k_xx^2 + k_yy^2 + 2 k_xy^2) is taken literally: second differences along
grid lines give k_xx and k_yy, the twist of a cell gives k_xy. It is isotropic, and exact for cylindrical bending,
which hinges of a triangulated grid are not. On a general triangle mesh each interior edge is a hinge with the
weights of Bergou et al. (2006) and the energy 1/2 B / (A0 + A1) |sum k_i x_i|^2, which reproduces cylindrical
bending of equilateral and of axis-aligned right-angled meshes (Seung and Nelson 1988).

All are vector constraints c = sum k_i x_i of zero target, whose XPBD update needs neither a root nor a branch:
dx_i = -w_i k_i c / (sum w_i k_i^2 + alpha / dt^2), its denominator as in `bend_stiffness`.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, fill, most, mul, over, root, sub, times  # noqa: F401
from nuno.solver.membrane import shift
from nuno.solver.vector import at, is_set, put, scaled, spread


@wp.func
def bend_stiffness(weight: Any, alpha: Any):
    """The denominator of a bend's update: weight / 2 + alpha, at least 0.8 weight.

    With lambda starting at zero, one pass adds to the static compliance what the same substep's other constraints do
    not undo, about half of the weight; taken off, a strip hangs as its rigidity says at far larger steps. The floor
    bounds the over-relaxation to 1.25, well inside of 2, where it would oscillate.
    """
    return most(scaled(weight, 0.5) + alpha, scaled(weight, 0.8)) + fill(weight, 1.0e-12)


@wp.func
def bend_line(t: Any, a: Any, b: Any, c: Any, alpha: Any, damped: int, gamma: Any):
    """Three vertices in a row: c = x_0 - 2 x_1 + x_2; ``gamma`` is the damping over dt."""
    ax = at(t.x, a)
    ay = at(t.y, a)
    az = at(t.z, a)
    bx = at(t.x, b)
    by = at(t.y, b)
    bz = at(t.z, b)
    dx = at(t.x, c)
    dy = at(t.y, c)
    dz = at(t.z, c)
    cx = ax - bx * 2.0 + dx
    cy = ay - by * 2.0 + dy
    cz = az - bz * 2.0 + dz
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    weight = wa + wb * 4.0 + wc
    if damped != 0:
        cx = cx + times(gamma, cx - at(t.px, a) + at(t.px, b) * 2.0 - at(t.px, c))
        cy = cy + times(gamma, cy - at(t.py, a) + at(t.py, b) * 2.0 - at(t.py, c))
        cz = cz + times(gamma, cz - at(t.pz, a) + at(t.pz, b) * 2.0 - at(t.pz, c))
        weight = weight + times(gamma, weight)
    s = over(fill(cx, -1.0), bend_stiffness(weight, alpha))
    sa = times(s, wa)
    sb = times(s, wb) * -2.0
    sc = times(s, wc)
    put(t.x, a, ax + times(cx, sa))
    put(t.y, a, ay + times(cy, sa))
    put(t.z, a, az + times(cz, sa))
    put(t.x, b, bx + times(cx, sb))
    put(t.y, b, by + times(cy, sb))
    put(t.z, b, bz + times(cz, sb))
    put(t.x, c, dx + times(cx, sc))
    put(t.y, c, dy + times(cy, sc))
    put(t.z, c, dz + times(cz, sc))


@wp.func
def weighed(x: Any, a: Any, b: Any, c: Any, d: Any, ka: Any, kb: Any, kc: Any, kd: Any):
    """The weighed sum of four particles' coordinates."""
    return scaled(at(x, a), ka) + scaled(at(x, b), kb) + scaled(at(x, c), kc) + scaled(at(x, d), kd)


@wp.func
def bend_hinge(
    t: Any,
    a: Any,
    b: Any,
    c: Any,
    d: Any,
    ka: Any,
    kb: Any,
    kc: Any,
    kd: Any,
    rest: Any,
    alpha: Any,
    damped: int,
    gamma: Any,
):
    """Four vertices: c = sum k_i x_i - rest n, n the unit normal of the hinge's two triangles.

    ``rest`` is zero for all that is flat at rest, and for the twist of a grid cell.
    """
    cx = weighed(t.x, a, b, c, d, ka, kb, kc, kd)
    cy = weighed(t.y, a, b, c, d, ka, kb, kc, kd)
    cz = weighed(t.z, a, b, c, d, ka, kb, kc, kd)
    if damped != 0:
        cx = cx + times(gamma, cx - weighed(t.px, a, b, c, d, ka, kb, kc, kd))
        cy = cy + times(gamma, cy - weighed(t.py, a, b, c, d, ka, kb, kc, kd))
        cz = cz + times(gamma, cz - weighed(t.pz, a, b, c, d, ka, kb, kc, kd))
    if is_set(rest):
        # the normal is that of the plane through the edge (a, b) and across to (c, d)
        ex = at(t.x, b) - at(t.x, a)
        ey = at(t.y, b) - at(t.y, a)
        ez = at(t.z, b) - at(t.z, a)
        gx = at(t.x, d) - at(t.x, c)
        gy = at(t.y, d) - at(t.y, c)
        gz = at(t.z, d) - at(t.z, c)
        nx = times(ey, gz) - times(ez, gy)
        ny = times(ez, gx) - times(ex, gz)
        nz = times(ex, gy) - times(ey, gx)
        s = over(spread(nx, rest), root(times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(nx, 1.0e-20)))
        cx = cx - times(nx, s)
        cy = cy - times(ny, s)
        cz = cz - times(nz, s)
    wa = scaled(at(t.w, a), ka)
    wb = scaled(at(t.w, b), kb)
    wc = scaled(at(t.w, c), kc)
    wd = scaled(at(t.w, d), kd)
    weight = scaled(wa, ka) + scaled(wb, kb) + scaled(wc, kc) + scaled(wd, kd)
    if damped != 0:
        weight = weight + times(gamma, weight)
    s = over(fill(cx, -1.0), bend_stiffness(weight, alpha))
    shift(t, a, cx, cy, cz, times(s, wa))
    shift(t, b, cx, cy, cz, times(s, wb))
    shift(t, c, cx, cy, cz, times(s, wc))
    shift(t, d, cx, cy, cz, times(s, wd))
