"""In-plane elasticity: stretch along warp and weft, and shear (XPBD, Macklin et al. 2016).

Each function projects constraints once: ``alpha`` is the compliance over dt^2. Lambda starts at zero in every substep,
and the update is d lambda = -(C + alpha lambda) / (grad C . W grad C + alpha), times an over-relaxation where a substep
makes several sweeps (`nuno.constraints.sweeps`); each particle then moves by w_i d lambda grad_i C. An index may be an
int, or a vector of sixteen where sixteen elements are projected at once (`nuno.numbers.element_access`).
"""

from typing import Any

import warp as wp

from nuno.constraints.taut_lines import excess, redirects_forces, turn_grid_line
from nuno.numbers.element_access import at, corner, put
from nuno.numbers.lanes import add, anywhere, div, full_like, maximum, minimum, mul, product, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import dot, move, offset, position, put_position, vec3

MAX_RELAXATION = wp.constant(1.45)
"""Bound of the over-relaxation: at 2 it would oscillate, and near it short waves take long to die down."""


@wp.func
def relaxation(weight: Any, alpha: Any, rise: float, onset: float):
    """The over-relaxation of a constraint by its denominator D + alpha: 1 + rise (sqrt(q) - onset), q = D / (2 alpha).

    None where ``rise`` is 0. For the two see `nuno.constraints.relaxation`.
    """
    if rise == 0.0:
        return full_like(weight, 1.0)
    q = (weight - alpha) / alpha * 0.5
    return minimum(maximum((sqrt(q) - onset) * rise + 1.0, 1.0), MAX_RELAXATION)


# The rows of a grid line. Its edges C_k = |x_k - x_k+1| - rest_k are linear in their lambdas, with a matrix of three
# diagonals: `edge_diagonal`, and beside it minus `edge_coupling`; on the right stands rest length less length. Whatever
# solves them (below one thread from end to end; several on CUDA, in `nuno.plans`) takes its rows from here.
@wp.func
def stretch_alpha(compliance: Any, scale: Any, rate: float):
    """The compliance of an edge over dt^2: the material's, times the factor of its size and ``rate``, 1 / dt^2."""
    return compliance * (scale * rate)


@wp.func
def edge_direction(a: Any, b: Any):
    """The unit vector from b to a, their distance, and one over that; two vertices in one place are 1e-10 m apart."""
    edge = a - b
    length = sqrt(dot(edge, edge) + 1.0e-20)
    inverse = 1.0 / length
    return edge * inverse, length, inverse


@wp.func
def edge_diagonal(wa: Any, wb: Any, alpha: Any):
    """The diagonal of an edge's row: w_k + w_k+1 + alpha_k."""
    return wa + wb + alpha + 1.0e-12


@wp.func
def edge_coupling(w: Any, before: Any, direction: Any):
    """Minus the entry beside the diagonal, shared by the edges that meet at a vertex of inverse mass ``w``."""
    return w * dot(before, direction)


@wp.func
def between_forces(w: Any, after: Any, before: Any):
    """The move of the vertex between two edges, by lambda times direction of either."""
    return w * (after - before)


@wp.func
def stretch_grid_line(
    t: Any, table: Any, rest: Any, gains: Any, forces: Any, inverses: Any, first: int, last: int, rate: float
):
    """All edges of a grid line at once: C_k = |x_k - x_k+1| - rest_k.

    Elimination forth and substitution back solve their rows exactly, so that a force runs the whole length of a grid
    line in one substep. (The direct solution of a chain of XPBD constraints: Deul et al. 2018, "Direct Position-Based
    Solver for Stiff Rods".)

    Args:
        t: The world's state.
        table: The edges, each grid line's one after the other.
        rest: Their lengths at rest [m]; in a later sweep those that the one before left them with (`note_lengths`).
        gains: Room for a number an edge; so are ``forces`` and ``inverses``.
        forces: See ``gains``.
        inverses: See ``gains``.
        first: The grid line's first edge.
        last: One past its last.
        rate: 1 / dt^2 [1/s2].
    """
    head = corner(table.edge, first, 0, 2)
    a = position(t, head)
    wa = at(t.w, head)
    zero = full_like(a.x, 0.0)
    before = vec3(zero, zero, zero)  # the direction of the edge before
    pivot = zero
    pull = zero
    for k in range(first, last):
        j = corner(table.edge, k, 1, 2)
        b = position(t, j)
        wb = at(t.w, j)
        direction, length, inverse = edge_direction(a, b)
        coupling = edge_coupling(wa, before, direction)
        gain = coupling * pivot
        if k > first:
            put(gains, k - 1, gain)
        alpha = stretch_alpha(at(t.stretch_compliance, table.edge_compliance[k]), table.edge_scale[k], rate)
        pivot = 1.0 / (edge_diagonal(wa, wb, alpha) - coupling * gain)
        pull = (rest[k] - length + coupling * pull) * pivot
        put(forces, k, pull)
        put(inverses, k, inverse)
        a = b
        wa = wb
        before = direction
    # pull is now the last edge's lambda, and a the last vertex
    force = vec3(zero, zero, zero)
    taut = zero
    for back in range(last - first):
        k = last - 1 - back
        i = corner(table.edge, k, 0, 2)
        j = corner(table.edge, k, 1, 2)
        if back > 0:
            pull = at(forces, k) + at(gains, k) * pull
        b = position(t, i)
        inverse = at(inverses, k)
        own = (b - a) * (pull * inverse)
        wb = at(t.w, j)
        put_position(t, j, a + between_forces(wb, force, own))
        if redirects_forces(t):
            taut = maximum(taut, excess(pull, at(t.w, i) + wb, rest[k]))
            put(gains, k, own.x)
            put(forces, k, own.y)
            put(inverses, k, own.z)
        a = b
        force = own
    move(t, head, force * at(t.w, head))
    if redirects_forces(t):
        if anywhere(taut):
            turn_grid_line(t, table, rest, gains, forces, inverses, first, last)


@wp.func
def shear_alpha(compliance: Any, scale: Any, rate: float):
    """The compliance of a cell's shear over dt^2: the material's over the area, 1 / (4 scale), times ``rate``."""
    return product(compliance, scale * 4.0 * rate)


@wp.func
def project_cell(
    xa: Any, xb: Any, xc: Any, xd: Any, wa: Any, wb: Any, wc: Any, wd: Any, scale: Any, alpha: Any, past: Any,
    rise: float, onset: float,
):  # fmt: skip
    """A rectangular cell: C = F_u . F_v = s (|p|^2 - |q|^2), p = x_d - x_a and q = x_b - x_c its diagonals.

    Its gradients are 2 s p at d, -2 s p at a, 2 s q at c and -2 s q at b; ``scale`` is s = 1 / (4 area). Returned are
    minus the change of lambda and the positions after the update; ``past`` is the sum of those of this substep, and the
    last two are `relaxation`'s.
    """
    p = xd - xa
    q = xb - xc
    pp = dot(p, p)
    qq = dot(q, q)
    weight = ((wa + wd) * pp + (wb + wc) * qq) * (scale * 4.0 * scale) + alpha + 1.0e-12
    gain = ((pp - qq) * scale - alpha * past) / weight * relaxation(weight, alpha, rise, onset)
    s = gain * (scale * 2.0)
    return gain, xa + p * (s * wa), xb + q * (s * wb), xc - q * (s * wc), xd - p * (s * wd)


@wp.func
def shear_cell(t: Any, a: Any, b: Any, c: Any, d: Any, scale: Any, alpha: Any, past: Any, rise: float, onset: float):
    """`project_cell` of four particles; returned is minus the change of lambda."""
    gain, xa, xb, xc, xd = project_cell(
        position(t, a), position(t, b), position(t, c), position(t, d),
        at(t.w, a), at(t.w, b), at(t.w, c), at(t.w, d), scale, alpha, past, rise, onset,
    )  # fmt: skip
    put_position(t, a, xa)
    put_position(t, d, xd)
    put_position(t, b, xb)
    put_position(t, c, xc)
    return gain


@wp.func
def weighed(t: Any, a: Any, b: Any, c: Any, ka: Any, kb: Any, kc: Any):
    """The sum of k_i x_i, the k adding up to zero."""
    base = position(t, a)
    mean = offset(base, base) * ka + offset(position(t, b), base) * kb
    return mean + offset(position(t, c), base) * kc


@wp.func
def stretch_triangle(
    t: Any, a: Any, b: Any, c: Any, ka: Any, kb: Any, kc: Any, alpha: Any, past: Any, rise: float, onset: float
):
    """A triangle along one material direction: C = |f| - 1, f = F k = sum k_i x_i, with the gradients k_i f / |f|.

    Returned is the change of lambda; ``past`` is the sum of those of this substep, and the last two are `relaxation`'s.
    """
    f = weighed(t, a, b, c, ka, kb, kc)
    length = sqrt(dot(f, f) + 1.0e-20)
    wa = at(t.w, a) * ka
    wb = at(t.w, b) * kb
    wc = at(t.w, c) * kc
    weight = wa * ka + wb * kb + wc * kc + alpha + 1.0e-12
    s = (1.0 - length - alpha * past) / (weight * length) * relaxation(weight, alpha, rise, onset)
    move(t, a, f * (s * wa))
    move(t, b, f * (s * wb))
    move(t, c, f * (s * wc))
    return s * length


@wp.func
def shear_gradient(u: Any, v: Any, uu: Any, vv: Any, uv: Any):
    """The squared gradient |u F_v + v F_u|^2 at a corner with weights u and v."""
    return vv * (u * u) + uv * (u * 2.0 * v) + uu * (v * v)


@wp.func
def shear_triangle(
    t: Any, table: Any, k: int, a: Any, b: Any, c: Any, alpha: Any, past: Any, rise: float, onset: float
):
    """A triangle's shear: C = F_u . F_v, F_u = sum u_i x_i and F_v = sum v_i x_i, with the gradients u_i F_v + v_i F_u.

    The last three and what is returned as in `stretch_triangle`.
    """
    ua = corner(table.triangle_u, k, 0, 3)
    ub = corner(table.triangle_u, k, 1, 3)
    uc = corner(table.triangle_u, k, 2, 3)
    va = corner(table.triangle_v, k, 0, 3)
    vb = corner(table.triangle_v, k, 1, 3)
    vc = corner(table.triangle_v, k, 2, 3)
    fu = weighed(t, a, b, c, ua, ub, uc)
    fv = weighed(t, a, b, c, va, vb, vc)
    uu = dot(fu, fu)
    vv = dot(fv, fv)
    uv = dot(fu, fv)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    weight = 1.0e-12 + alpha
    weight = weight + wa * shear_gradient(ua, va, uu, vv, uv)
    weight = weight + wb * shear_gradient(ub, vb, uu, vv, uv)
    weight = weight + wc * shear_gradient(uc, vc, uu, vv, uv)
    s = (-uv - alpha * past) / weight * relaxation(weight, alpha, rise, onset)
    move(t, a, (fv * ua + fu * va) * (s * wa))
    move(t, b, (fv * ub + fu * vb) * (s * wb))
    move(t, c, (fv * uc + fu * vc) * (s * wc))
    return s
