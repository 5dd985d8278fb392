"""The push of a point of an edge or a triangle out of a shape: its vertices move by its weights, with friction."""

from typing import Any

import warp as wp

from nuno.numbers.lanes import add, anywhere, choose, div, full_like, maximum, minimum, mul, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import dot, less_product, move, position, start_position

PATIENCE = wp.constant(0.8)
"""Of what an element is too near when a substep begins, so much may stay in it. Neighbours share their vertices and
undo some of each other's pushes; put right at once, what is left over would become speed."""
SLANT = wp.constant(0.3)
"""An element that the shape's normal leans on less than this, as a part of one, stands across the shape: it is pierced,
and to push it would not part them."""


@wp.func
def push_apart(
    t: Any, h: Any, i: int, j: int, k: int, bi: Any, bj: Any, bk: Any, p: Any, local: Any, gap: Any, on: Any
):  # fmt: skip
    """Push a point of an element out of a shape along the normal, with friction, as a particle is.

    Args:
        t: The state.
        h: The shape, a `nuno.contact.particle.feature_pose.FeatureFloat` or lanes of them.
        i: The element's first vertex; ``j`` and ``k`` the others, of an edge i once more.
        j: See ``i``.
        k: See ``i``.
        bi: The weight of the first vertex in the point; ``bj`` and ``bk`` those of the others.
        bj: See ``bi``.
        bk: See ``bi``.
        p: The point in the shape's frame when the substep began [m].
        local: The normal there, in the shape's frame.
        gap: How far it was from where it must stay [m].
        on: Positive where it counts.
    """
    # what the point moved in the substep, less what the surface did
    u = bi * (position(t, i) - start_position(t, i)) + bj * (position(t, j) - start_position(t, j))
    if k != i:
        u = u + bk * (position(t, k) - start_position(t, k))
    if h.slot >= 0:
        u = less_product(u - h.e, h.d, p)
    n = h.rotation * local
    depth = gap + u.x * n.x + u.y * n.y + u.z * n.z
    touching = minimum(on, -depth)
    if anywhere(touching):
        give_way(t, i, j, k, bi, bj, bk, depth, n, u, h.mu, h.leave, touching)


@wp.func
def give_way(
    t: Any, i: int, j: int, k: int, bi: Any, bj: Any, bk: Any, gap: Any, n: Any, u: Any, mu: Any, leave: Any, on: Any
):  # fmt: skip
    """Move the vertices of a point sum b_i x_i that is too near, by a gap below zero [m], and that moved by u [m].

    With p, the push along the normal n, and u_t, the part of u across it, each moves by
    w_i b_i / (sum w_i b_i^2) times p n - min(mu p / |u_t|, 1) u_t.
    """
    zero = full_like(gap, 0.0)
    un = dot(u, n)
    push = minimum(maximum(-gap, zero), maximum(leave - un, zero))
    slip = u - un * n
    hold = minimum(mu * push / sqrt(dot(slip, slip) + 1.0e-24), 1.0)
    way = push * n - hold * slip
    wi = bi * t.w[i]
    wj = bj * t.w[j]
    wk = bk * t.w[k]
    s = choose(on, 1.0 / (wi * bi + wj * bj + wk * bk + 1.0e-9), zero)
    move(t, i, way * (s * wi))
    move(t, j, way * (s * wj))
    if k != i:
        move(t, k, way * (s * wk))
