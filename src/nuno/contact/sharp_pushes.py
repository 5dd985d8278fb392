"""How a point of an edge or a triangle is pushed out of a shape: its vertices move by its weights, with friction."""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, anywhere, choose, fill, least, most, mul, over, root, sub, times  # noqa: F401

PATIENCE = wp.constant(0.8)
"""Of what an element is too near when a substep begins, so much may stay in it. Neighbours share their vertices and
undo some of each other's pushes; put right at once, what is left over would become speed."""
SLANT = wp.constant(0.3)
"""An element that the shape's normal leans on less than this, as a part of one, stands across the shape: it is pierced,
and to push it would not part them."""


@wp.func
def push_apart(
    t: Any, h: Any, i: int, j: int, k: int, bi: Any, bj: Any, bk: Any, x: Any, y: Any, z: Any, nx: Any, ny: Any,
    nz: Any, gap: Any, on: Any,
):  # fmt: skip
    """Push a point of an element out of a shape along the normal, with friction, as a particle is.

    Args:
        t: The state.
        h: The shape, a `nuno.contact.sharp_pose.SharpFloat` or lanes of them.
        i: The element's first vertex; ``j`` and ``k`` the others, of an edge i once more.
        j: See ``i``.
        k: See ``i``.
        bi: The weight of the first vertex in the point; ``bj`` and ``bk`` those of the others.
        bj: See ``bi``.
        bk: See ``bi``.
        x: The point in the shape's frame when the substep began, with ``y`` and ``z`` [m].
        y: See ``x``.
        z: See ``x``.
        nx: The normal there, with ``ny`` and ``nz``.
        ny: See ``nx``.
        nz: See ``nx``.
        gap: How far it was from where it must stay [m].
        on: Positive where it counts.
    """
    # what the point moved in the substep, less what the surface did
    ux = times(bi, t.x[i] - t.px[i]) + times(bj, t.x[j] - t.px[j])
    uy = times(bi, t.y[i] - t.py[i]) + times(bj, t.y[j] - t.py[j])
    uz = times(bi, t.z[i] - t.pz[i]) + times(bj, t.z[j] - t.pz[j])
    if k != i:
        ux = ux + times(bk, t.x[k] - t.px[k])
        uy = uy + times(bk, t.y[k] - t.py[k])
        uz = uz + times(bk, t.z[k] - t.pz[k])
    if h.slot >= 0:
        ux = ux - h.ex - times(h.d00, x) - times(h.d01, y) - times(h.d02, z)
        uy = uy - h.ey - times(h.d10, x) - times(h.d11, y) - times(h.d12, z)
        uz = uz - h.ez - times(h.d20, x) - times(h.d21, y) - times(h.d22, z)
    wx = times(h.r00, nx) + times(h.r01, ny) + times(h.r02, nz)
    wy = times(h.r10, nx) + times(h.r11, ny) + times(h.r12, nz)
    wz = times(h.r20, nx) + times(h.r21, ny) + times(h.r22, nz)
    depth = gap + times(ux, wx) + times(uy, wy) + times(uz, wz)
    touching = least(on, -depth)
    if anywhere(touching):
        give_way(t, i, j, k, bi, bj, bk, depth, wx, wy, wz, ux, uy, uz, h.mu, h.leave, touching)


@wp.func
def give_way(
    t: Any,
    i: int,
    j: int,
    k: int,
    bi: Any,
    bj: Any,
    bk: Any,
    gap: Any,
    nx: Any,
    ny: Any,
    nz: Any,
    ux: Any,
    uy: Any,
    uz: Any,
    mu: Any,
    leave: Any,
    on: Any,
):
    """Move the vertices of a point that is too near, by a gap below zero [m], and that moved by u [m]."""
    zero = fill(gap, 0.0)
    un = times(ux, nx) + times(uy, ny) + times(uz, nz)
    push = least(most(-gap, zero), most(leave - un, zero))
    tx = ux - times(un, nx)
    ty = uy - times(un, ny)
    tz = uz - times(un, nz)
    slip = root(times(tx, tx) + times(ty, ty) + times(tz, tz) + fill(gap, 1.0e-24))
    hold = least(over(times(mu, push), slip), fill(gap, 1.0))
    dx = times(push, nx) - times(hold, tx)
    dy = times(push, ny) - times(hold, ty)
    dz = times(push, nz) - times(hold, tz)
    wi = times(bi, t.w[i])
    wj = times(bj, t.w[j])
    wk = times(bk, t.w[k])
    weight = times(wi, bi) + times(wj, bj) + times(wk, bk) + fill(gap, 1.0e-9)
    s = choose(on, over(fill(gap, 1.0), weight), zero)
    shift(t, i, dx, dy, dz, times(s, wi))
    shift(t, j, dx, dy, dz, times(s, wj))
    if k != i:
        shift(t, k, dx, dy, dz, times(s, wk))


@wp.func
def shift(t: Any, i: int, dx: Any, dy: Any, dz: Any, s: Any):
    """Move particle i by s (dx, dy, dz)."""
    t.x[i] = t.x[i] + times(dx, s)
    t.y[i] = t.y[i] + times(dy, s)
    t.z[i] = t.z[i] + times(dz, s)


@wp.func
def square_of(x: Any, y: Any, z: Any):
    """The square of a length."""
    return times(x, x) + times(y, y) + times(z, z)
