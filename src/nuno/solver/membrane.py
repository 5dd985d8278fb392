"""In-plane elasticity: stretch along warp and weft, and shear (XPBD, Macklin et al. 2016).

Each function projects one constraint once. ``soft`` is the compliance alpha / dt^2 without the element's geometry;
lambda starts at zero in every substep and there is one pass, so that the update is
d lambda = -(C + gamma grad C . (x - p)) / ((1 + gamma) grad C . W grad C + alpha / dt^2), gamma = damping / dt.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import fill, over, root, times


@wp.func
def stretch(t: Any, i: int, j: int, rest: float, alpha: Any, relax: float, damped: int, gamma: Any):
    """An edge along warp or weft: C = |x_i - x_j| - rest."""
    dx = t.x[i] - t.x[j]
    dy = t.y[i] - t.y[j]
    dz = t.z[i] - t.z[j]
    length = root(times(dx, dx) + times(dy, dy) + times(dz, dz) + fill(dx, 1.0e-20))
    wi = t.w[i]
    wj = t.w[j]
    weight = wi + wj
    violation = length - fill(dx, rest)
    if damped != 0:
        ux = dx - t.px[i] + t.px[j]
        uy = dy - t.py[i] + t.py[j]
        uz = dz - t.pz[i] + t.pz[j]
        rate = over(times(dx, ux) + times(dy, uy) + times(dz, uz), length)
        violation = violation + times(gamma, rate)
        weight = weight + times(gamma, weight)
    s = over(violation, times(weight * relax + alpha + fill(dx, 1.0e-12), length))
    si = times(s, wi)
    sj = times(s, wj)
    t.x[i] = t.x[i] - times(dx, si)
    t.y[i] = t.y[i] - times(dy, si)
    t.z[i] = t.z[i] - times(dz, si)
    t.x[j] = t.x[j] + times(dx, sj)
    t.y[j] = t.y[j] + times(dy, sj)
    t.z[j] = t.z[j] + times(dz, sj)


@wp.func
def shear_cell(t: Any, cell: wp.vec4i, scale: float, alpha: Any):
    """A rectangular cell: C = F_u . F_v = (|d1|^2 - |d2|^2) / (4 area), d1 and d2 its diagonals.

    ``scale`` is 1 / (4 area).
    """
    a = cell[0]
    b = cell[1]
    c = cell[2]
    d = cell[3]
    d1x = t.x[d] - t.x[a]
    d1y = t.y[d] - t.y[a]
    d1z = t.z[d] - t.z[a]
    d2x = t.x[b] - t.x[c]
    d2y = t.y[b] - t.y[c]
    d2z = t.z[b] - t.z[c]
    q1 = times(d1x, d1x) + times(d1y, d1y) + times(d1z, d1z)
    q2 = times(d2x, d2x) + times(d2y, d2y) + times(d2z, d2z)
    wa = t.w[a]
    wb = t.w[b]
    wc = t.w[c]
    wd = t.w[d]
    gradient = times(wa + wd, q1) + times(wb + wc, q2)
    s = over((q1 - q2) * scale, (gradient * (4.0 * scale * scale)) + alpha + fill(q1, 1.0e-12)) * (2.0 * scale)
    sa = times(s, wa)
    sb = times(s, wb)
    sc = times(s, wc)
    sd = times(s, wd)
    t.x[a] = t.x[a] + times(d1x, sa)
    t.y[a] = t.y[a] + times(d1y, sa)
    t.z[a] = t.z[a] + times(d1z, sa)
    t.x[d] = t.x[d] - times(d1x, sd)
    t.y[d] = t.y[d] - times(d1y, sd)
    t.z[d] = t.z[d] - times(d1z, sd)
    t.x[b] = t.x[b] + times(d2x, sb)
    t.y[b] = t.y[b] + times(d2y, sb)
    t.z[b] = t.z[b] + times(d2z, sb)
    t.x[c] = t.x[c] - times(d2x, sc)
    t.y[c] = t.y[c] - times(d2y, sc)
    t.z[c] = t.z[c] - times(d2z, sc)


@wp.func
def shift(t: Any, i: int, dx: Any, dy: Any, dz: Any, s: Any):
    """Move particle i by s (dx, dy, dz)."""
    t.x[i] = t.x[i] + times(dx, s)
    t.y[i] = t.y[i] + times(dy, s)
    t.z[i] = t.z[i] + times(dz, s)


@wp.func
def stretch_triangle(t: Any, tri: wp.vec3i, k: wp.vec3, alpha: Any):
    """A triangle along one material direction: C = |F k| - 1, where F k is the sum of k_i x_i."""
    a = tri[0]
    b = tri[1]
    c = tri[2]
    fx = t.x[a] * k[0] + t.x[b] * k[1] + t.x[c] * k[2]
    fy = t.y[a] * k[0] + t.y[b] * k[1] + t.y[c] * k[2]
    fz = t.z[a] * k[0] + t.z[b] * k[1] + t.z[c] * k[2]
    length = root(times(fx, fx) + times(fy, fy) + times(fz, fz) + fill(fx, 1.0e-20))
    wa = t.w[a] * k[0]
    wb = t.w[b] * k[1]
    wc = t.w[c] * k[2]
    weight = wa * k[0] + wb * k[1] + wc * k[2]
    s = over(fill(fx, 1.0) - length, times(weight + alpha + fill(fx, 1.0e-12), length))
    shift(t, a, fx, fy, fz, times(s, wa))
    shift(t, b, fx, fy, fz, times(s, wb))
    shift(t, c, fx, fy, fz, times(s, wc))


@wp.func
def shear_triangle(t: Any, tri: wp.vec3i, u: wp.vec3, v: wp.vec3, alpha: Any):
    """A triangle's shear: C = F_u . F_v."""
    a = tri[0]
    b = tri[1]
    c = tri[2]
    ux = t.x[a] * u[0] + t.x[b] * u[1] + t.x[c] * u[2]
    uy = t.y[a] * u[0] + t.y[b] * u[1] + t.y[c] * u[2]
    uz = t.z[a] * u[0] + t.z[b] * u[1] + t.z[c] * u[2]
    vx = t.x[a] * v[0] + t.x[b] * v[1] + t.x[c] * v[2]
    vy = t.y[a] * v[0] + t.y[b] * v[1] + t.y[c] * v[2]
    vz = t.z[a] * v[0] + t.z[b] * v[1] + t.z[c] * v[2]
    uu = times(ux, ux) + times(uy, uy) + times(uz, uz)
    vv = times(vx, vx) + times(vy, vy) + times(vz, vz)
    uv = times(ux, vx) + times(uy, vy) + times(uz, vz)
    weight = fill(ux, 1.0e-12) + alpha
    for k in range(3):
        q = vv * (u[k] * u[k]) + uv * (2.0 * u[k] * v[k]) + uu * (v[k] * v[k])
        weight = weight + times(t.w[tri[k]], q)
    s = over(-uv, weight)
    for k in range(3):
        i = tri[k]
        shift(t, i, vx * u[k] + ux * v[k], vy * u[k] + uy * v[k], vz * u[k] + uz * v[k], times(s, t.w[i]))
