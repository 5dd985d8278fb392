"""In-plane elasticity: stretch along warp and weft, and shear (XPBD, Macklin et al. 2016).

Each function projects constraints once: ``alpha`` is the compliance over dt^2. Lambda starts at zero in every substep,
and the update is d lambda = -(C + alpha lambda) / (grad C . W grad C + alpha), times an over-relaxation where a substep
makes several sweeps (`nuno.solver.sweeps`). An index may be an int, or a vector of sixteen where sixteen elements are
projected at once (`nuno.solver.vector`).
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, beside, fill, least, most, mul, over, root, sub, times  # noqa: F401
from nuno.solver.vector import at, corner, put, scaled, spread

MOST_RELAXED = wp.constant(1.45)
"""Bound of the over-relaxation: at 2 it would oscillate, and near it short waves take long to die down."""


@wp.func
def relaxation(weight: Any, alpha: Any, rise: float, onset: float):
    """The over-relaxation of a constraint by its denominator D + alpha: 1 + rise (sqrt(q) - onset), q = D / (2 alpha).

    None where ``rise`` is 0. For the two see `nuno.solver.relaxation`.
    """
    if rise == 0.0:
        return fill(weight, 1.0)
    q = over(weight - alpha, alpha) * 0.5
    relax = (root(q) - fill(weight, onset)) * rise + fill(weight, 1.0)
    return least(most(relax, fill(weight, 1.0)), fill(weight, MOST_RELAXED))


@wp.func
def shift(t: Any, i: Any, dx: Any, dy: Any, dz: Any, s: Any):
    """Move particle i by s (dx, dy, dz)."""
    put(t.x, i, at(t.x, i) + times(dx, s))
    put(t.y, i, at(t.y, i) + times(dy, s))
    put(t.z, i, at(t.z, i) + times(dz, s))


@wp.func
def stretch_yarn(
    t: Any, table: Any, rest: Any, gains: Any, pulls: Any, inverses: Any, first: int, last: int, rate: float
):
    """All edges of a yarn at once: C_k = |x_k - x_k+1| - rest_k.

    Linear in its lambdas, a yarn has a matrix of three diagonals: w_k + w_k+1 + alpha_k, and beside it -w_k times the
    cosine between the edges that meet at vertex k. Elimination forth and substitution back solve it exactly, so that
    a force runs the whole length of a yarn in one substep. (The direct solution of a chain of XPBD constraints: Deul
    et al. 2018, "Direct Position-Based Solver for Stiff Rods".)

    Args:
        t: The world's state.
        table: The edges, each yarn's one after the other.
        rest: Their lengths at rest [m]; in a later sweep those that the one before left them with (`note_lengths`).
        gains: Room for a number an edge; so are ``pulls`` and ``inverses``.
        pulls: See ``gains``.
        inverses: See ``gains``.
        first: The yarn's first edge.
        last: One past its last.
        rate: 1 / dt^2 [1/s2].
    """
    head = corner(table.edge, first, 0, 2)
    ax = at(t.x, head)
    ay = at(t.y, head)
    az = at(t.z, head)
    wa = at(t.w, head)
    one = fill(ax, 1.0)
    zero = fill(ax, 0.0)
    tiny = fill(ax, 1.0e-20)
    ex = zero
    ey = zero
    ez = zero
    pivot = zero
    pull = zero
    for k in range(first, last):
        j = corner(table.edge, k, 1, 2)
        bx = at(t.x, j)
        by = at(t.y, j)
        bz = at(t.z, j)
        wb = at(t.w, j)
        dx = ax - bx
        dy = ay - by
        dz = az - bz
        length = root(times(dx, dx) + times(dy, dy) + times(dz, dz) + tiny)
        inverse = over(one, length)
        dx = times(dx, inverse)
        dy = times(dy, inverse)
        dz = times(dz, inverse)
        # minus the entry beside the diagonal, shared with the edge before
        beside = times(wa, times(ex, dx) + times(ey, dy) + times(ez, dz))
        gain = times(beside, pivot)
        if k > first:
            put(gains, k - 1, gain)
        alpha = scaled(at(t.stretch_soft, table.edge_soft[k]), table.edge_scale[k] * rate)
        pivot = over(one, wa + wb + alpha + fill(ax, 1.0e-12) - times(beside, gain))
        pull = times(spread(ax, rest[k]) - length + times(beside, pull), pivot)
        put(pulls, k, pull)
        put(inverses, k, inverse)
        ax = bx
        ay = by
        az = bz
        wa = wb
        ex = dx
        ey = dy
        ez = dz
    # pull is now the last edge's lambda, and a the last vertex
    fx = zero
    fy = zero
    fz = zero
    for back in range(last - first):
        k = last - 1 - back
        i = corner(table.edge, k, 0, 2)
        j = corner(table.edge, k, 1, 2)
        if back > 0:
            pull = at(pulls, k) + times(at(gains, k), pull)
        bx = at(t.x, i)
        by = at(t.y, i)
        bz = at(t.z, i)
        s = times(pull, at(inverses, k))
        dx = times(bx - ax, s)
        dy = times(by - ay, s)
        dz = times(bz - az, s)
        wj = at(t.w, j)
        put(t.x, j, ax + times(wj, fx - dx))
        put(t.y, j, ay + times(wj, fy - dy))
        put(t.z, j, az + times(wj, fz - dz))
        ax = bx
        ay = by
        az = bz
        fx = dx
        fy = dy
        fz = dz
    shift(t, head, fx, fy, fz, at(t.w, head))


@wp.func
def shear_cell(t: Any, a: Any, b: Any, c: Any, d: Any, scale: Any, alpha: Any, past: Any, rise: float, onset: float):
    """A rectangular cell: C = F_u . F_v = (|d1|^2 - |d2|^2) / (4 area), d1 and d2 its diagonals.

    ``scale`` is 1 / (4 area). Returned is minus the change of lambda; ``past`` is the sum of those of this substep, and
    the last two are `relaxation`'s.
    """
    ax = at(t.x, a)
    ay = at(t.y, a)
    az = at(t.z, a)
    bx = at(t.x, b)
    by = at(t.y, b)
    bz = at(t.z, b)
    cx = at(t.x, c)
    cy = at(t.y, c)
    cz = at(t.z, c)
    dx = at(t.x, d)
    dy = at(t.y, d)
    dz = at(t.z, d)
    d1x = dx - ax
    d1y = dy - ay
    d1z = dz - az
    d2x = bx - cx
    d2y = by - cy
    d2z = bz - cz
    q1 = times(d1x, d1x) + times(d1y, d1y) + times(d1z, d1z)
    q2 = times(d2x, d2x) + times(d2y, d2y) + times(d2z, d2z)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    wd = at(t.w, d)
    gradient = times(wa + wd, q1) + times(wb + wc, q2)
    weight = scaled(gradient, scaled(scale * 4.0, scale)) + alpha + fill(q1, 1.0e-12)
    gain = over(scaled(q1 - q2, scale) - times(alpha, past), weight)
    gain = times(gain, relaxation(weight, alpha, rise, onset))
    s = scaled(gain, scale * 2.0)
    sa = times(s, wa)
    sb = times(s, wb)
    sc = times(s, wc)
    sd = times(s, wd)
    put(t.x, a, ax + times(d1x, sa))
    put(t.y, a, ay + times(d1y, sa))
    put(t.z, a, az + times(d1z, sa))
    put(t.x, d, dx - times(d1x, sd))
    put(t.y, d, dy - times(d1y, sd))
    put(t.z, d, dz - times(d1z, sd))
    put(t.x, b, bx + times(d2x, sb))
    put(t.y, b, by + times(d2y, sb))
    put(t.z, b, bz + times(d2z, sb))
    put(t.x, c, cx - times(d2x, sc))
    put(t.y, c, cy - times(d2y, sc))
    put(t.z, c, cz - times(d2z, sc))
    return gain


@wp.func
def slope(x: Any, a: Any, b: Any, c: Any, ka: Any, kb: Any, kc: Any):
    """The sum of k_i x_i, the k adding up to zero."""
    base = at(x, a)
    near = scaled(beside(base, base), ka) + scaled(beside(at(x, b), base), kb)
    return near + scaled(beside(at(x, c), base), kc)


@wp.func
def stretch_triangle(
    t: Any, a: Any, b: Any, c: Any, ka: Any, kb: Any, kc: Any, alpha: Any, past: Any, rise: float, onset: float
):
    """A triangle along one material direction: C = |F k| - 1, where F k is the sum of k_i x_i.

    Returned is the change of lambda; ``past`` is the sum of those of this substep, and the last two are `relaxation`'s.
    """
    fx = slope(t.x, a, b, c, ka, kb, kc)
    fy = slope(t.y, a, b, c, ka, kb, kc)
    fz = slope(t.z, a, b, c, ka, kb, kc)
    length = root(times(fx, fx) + times(fy, fy) + times(fz, fz) + fill(fx, 1.0e-20))
    wa = scaled(at(t.w, a), ka)
    wb = scaled(at(t.w, b), kb)
    wc = scaled(at(t.w, c), kc)
    weight = scaled(wa, ka) + scaled(wb, kb) + scaled(wc, kc)
    missing = fill(fx, 1.0) - length - times(alpha, past)
    weight = weight + alpha + fill(fx, 1.0e-12)
    s = times(over(missing, times(weight, length)), relaxation(weight, alpha, rise, onset))
    shift(t, a, fx, fy, fz, times(s, wa))
    shift(t, b, fx, fy, fz, times(s, wb))
    shift(t, c, fx, fy, fz, times(s, wc))
    return times(s, length)


@wp.func
def shear_gradient(u: Any, v: Any, uu: Any, vv: Any, uv: Any):
    """The squared gradient |u F_v + v F_u|^2 at a corner with weights u and v."""
    return scaled(vv, scaled(u, u)) + scaled(uv, scaled(u * 2.0, v)) + scaled(uu, scaled(v, v))


@wp.func
def shear_triangle(
    t: Any, table: Any, k: int, a: Any, b: Any, c: Any, alpha: Any, past: Any, rise: float, onset: float
):
    """A triangle's shear: C = F_u . F_v; the last three and what is returned as in `stretch_triangle`."""
    ua = corner(table.triangle_u, k, 0, 3)
    ub = corner(table.triangle_u, k, 1, 3)
    uc = corner(table.triangle_u, k, 2, 3)
    va = corner(table.triangle_v, k, 0, 3)
    vb = corner(table.triangle_v, k, 1, 3)
    vc = corner(table.triangle_v, k, 2, 3)
    ux = slope(t.x, a, b, c, ua, ub, uc)
    uy = slope(t.y, a, b, c, ua, ub, uc)
    uz = slope(t.z, a, b, c, ua, ub, uc)
    vx = slope(t.x, a, b, c, va, vb, vc)
    vy = slope(t.y, a, b, c, va, vb, vc)
    vz = slope(t.z, a, b, c, va, vb, vc)
    uu = times(ux, ux) + times(uy, uy) + times(uz, uz)
    vv = times(vx, vx) + times(vy, vy) + times(vz, vz)
    uv = times(ux, vx) + times(uy, vy) + times(uz, vz)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    weight = fill(ux, 1.0e-12) + alpha
    weight = weight + times(wa, shear_gradient(ua, va, uu, vv, uv))
    weight = weight + times(wb, shear_gradient(ub, vb, uu, vv, uv))
    weight = weight + times(wc, shear_gradient(uc, vc, uu, vv, uv))
    s = times(over(-uv - times(alpha, past), weight), relaxation(weight, alpha, rise, onset))
    shift_sheared(t, a, ua, va, ux, uy, uz, vx, vy, vz, times(s, wa))
    shift_sheared(t, b, ub, vb, ux, uy, uz, vx, vy, vz, times(s, wb))
    shift_sheared(t, c, uc, vc, ux, uy, uz, vx, vy, vz, times(s, wc))
    return s


@wp.func
def shift_sheared(t: Any, i: Any, u: Any, v: Any, ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any, s: Any):
    """Move particle i by s (u F_v + v F_u)."""
    dx = scaled(vx, u) + scaled(ux, v)
    dy = scaled(vy, u) + scaled(uy, v)
    dz = scaled(vz, u) + scaled(uz, v)
    shift(t, i, dx, dy, dz, s)
