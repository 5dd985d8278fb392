"""Bending from a rigidity in N m, as quadratic energies of second differences (isometric bending).

On a sheet's grid the energy density 1/2 B (k_xx^2 + k_yy^2 + 2 k_xy^2) is taken literally: second differences along
grid lines give k_xx and k_yy, the twist of a cell gives k_xy. It is isotropic, and exact for cylindrical bending,
which hinges of a triangulated grid are not. On a general triangle mesh each interior edge is a hinge with the weights of
Bergou et al. (2006) and the energy 1/2 B / (A0 + A1) |sum k_i x_i|^2, which reproduces cylindrical bending of
equilateral and of axis-aligned right-angled meshes (Seung and Nelson 1988).

All are vector constraints c = sum k_i x_i of zero target, whose XPBD update needs neither a root nor a branch:
dx_i = -w_i k_i c / (sum w_i k_i^2 + alpha / dt^2).
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import fill, over, root, times
from nuno.solver.membrane import shift


@wp.func
def bend_line(t: Any, line: wp.vec3i, alpha: Any, damped: int, gamma: Any):
    """Three vertices in a row: c = x_0 - 2 x_1 + x_2."""
    a = line[0]
    b = line[1]
    c = line[2]
    cx = t.x[a] - t.x[b] * 2.0 + t.x[c]
    cy = t.y[a] - t.y[b] * 2.0 + t.y[c]
    cz = t.z[a] - t.z[b] * 2.0 + t.z[c]
    wa = t.w[a]
    wb = t.w[b]
    wc = t.w[c]
    weight = wa + wb * 4.0 + wc
    if damped != 0:
        cx = cx + times(gamma, cx - t.px[a] + t.px[b] * 2.0 - t.px[c])
        cy = cy + times(gamma, cy - t.py[a] + t.py[b] * 2.0 - t.py[c])
        cz = cz + times(gamma, cz - t.pz[a] + t.pz[b] * 2.0 - t.pz[c])
        weight = weight + times(gamma, weight)
    s = over(fill(cx, -1.0), weight + alpha + fill(cx, 1.0e-12))
    shift(t, a, cx, cy, cz, times(s, wa))
    shift(t, b, cx, cy, cz, times(s, wb) * -2.0)
    shift(t, c, cx, cy, cz, times(s, wc))


@wp.func
def bend_hinge(t: Any, hinge: wp.vec4i, k: wp.vec4, rest: float, alpha: Any, damped: int, gamma: Any):
    """Four vertices: c = sum k_i x_i - rest n, n the unit normal of the hinge's two triangles.

    ``rest`` is zero for all that is flat at rest, and for the twist of a grid cell.
    """
    a = hinge[0]
    b = hinge[1]
    c = hinge[2]
    d = hinge[3]
    cx = t.x[a] * k[0] + t.x[b] * k[1] + t.x[c] * k[2] + t.x[d] * k[3]
    cy = t.y[a] * k[0] + t.y[b] * k[1] + t.y[c] * k[2] + t.y[d] * k[3]
    cz = t.z[a] * k[0] + t.z[b] * k[1] + t.z[c] * k[2] + t.z[d] * k[3]
    if damped != 0:
        ux = t.px[a] * k[0] + t.px[b] * k[1] + t.px[c] * k[2] + t.px[d] * k[3]
        uy = t.py[a] * k[0] + t.py[b] * k[1] + t.py[c] * k[2] + t.py[d] * k[3]
        uz = t.pz[a] * k[0] + t.pz[b] * k[1] + t.pz[c] * k[2] + t.pz[d] * k[3]
        cx = cx + times(gamma, cx - ux)
        cy = cy + times(gamma, cy - uy)
        cz = cz + times(gamma, cz - uz)
    if rest != 0.0:
        # the normal is that of the plane through the edge (a, b) and across to (c, d)
        ex = t.x[b] - t.x[a]
        ey = t.y[b] - t.y[a]
        ez = t.z[b] - t.z[a]
        gx = t.x[d] - t.x[c]
        gy = t.y[d] - t.y[c]
        gz = t.z[d] - t.z[c]
        nx = times(ey, gz) - times(ez, gy)
        ny = times(ez, gx) - times(ex, gz)
        nz = times(ex, gy) - times(ey, gx)
        s = over(fill(nx, rest), root(times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(nx, 1.0e-20)))
        cx = cx - times(nx, s)
        cy = cy - times(ny, s)
        cz = cz - times(nz, s)
    wa = t.w[a] * k[0]
    wb = t.w[b] * k[1]
    wc = t.w[c] * k[2]
    wd = t.w[d] * k[3]
    weight = wa * k[0] + wb * k[1] + wc * k[2] + wd * k[3]
    if damped != 0:
        weight = weight + times(gamma, weight)
    s = over(fill(cx, -1.0), weight + alpha + fill(cx, 1.0e-12))
    shift(t, a, cx, cy, cz, times(s, wa))
    shift(t, b, cx, cy, cz, times(s, wb))
    shift(t, c, cx, cy, cz, times(s, wc))
    shift(t, d, cx, cy, cz, times(s, wd))
