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
    """Push a point of an element, weights b of its vertices, out along the normal, with friction, as a particle is.

    ``gap`` is negative where it is too near, and u what the point moved in the substep, less what the surface did.
    """
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
