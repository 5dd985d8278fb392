"""Convex hulls as what particles touch: the planes of their faces, which all lanes look at together.

A mesh is searched for the nearest of its triangles by each world on its own; a hull needs no search.
"""

from typing import Any

import warp as wp

from nuno.numbers.lanes import absolute, add, anywhere, choose, div, full_like, maximum, minimum, mul, sub  # noqa: F401
from nuno.state.cloth_state import Shapes

FAR = wp.constant(1.0e6)
"""[m] Farther than anything."""


@wp.func
def distance_hull(shapes: Shapes, s: int, x: Any, y: Any, z: Any, margin: Any):
    """Signed distance and normal of a convex hull by the planes of its faces; what is not ``margin`` [m] may be nearer.

    Beyond an edge it is the distance from the farther plane, which is less than that from the edge.
    """
    gap = -full_like(x, FAR)
    nx = full_like(x, 0.0)
    ny = full_like(x, 0.0)
    nz = full_like(x, 1.0)
    ends = shapes.faces[s]
    for k in range(ends[0], ends[1]):
        f = shapes.planes[k]
        own = x * f[0] + y * f[1] + z * f[2] - f[3]
        above = own - gap
        gap = choose(above, own, gap)
        nx = choose(above, f[0], nx)
        ny = choose(above, f[1], ny)
        nz = choose(above, f[2], nz)
        if not anywhere(margin - gap):
            break
    return gap, nx, ny, nz


@wp.func
def way_into_hull(shapes: Shapes, s: int, x: Any, y: Any, z: Any, ux: Any, uy: Any, uz: Any):
    """Return where a way of the substep that ends at x, y, z and is u long enters a convex hull, as `way_in`.

    A way that starts inside does not enter.
    """
    zero = full_like(x, 0.0)
    one = full_like(x, 1.0)
    latest = zero  # part of the way at which it has come through all the planes that it starts before
    earliest = one  # part at which it first comes out of one
    relative_to = zero
    gap = zero
    nx = zero
    ny = zero
    nz = one
    ends = shapes.faces[s]
    for k in range(ends[0], ends[1]):
        f = shapes.planes[k]
        end = x * f[0] + y * f[1] + z * f[2] - f[3]
        start = end - (ux * f[0] + uy * f[1] + uz * f[2])
        part = absolute(start) / maximum(absolute(end - start), 1.0e-12)
        outside = choose(end, one, zero)
        relative_to = maximum(relative_to, choose(start, outside, zero))
        earliest = minimum(earliest, choose(start, one, choose(end, part, one)))
        later = choose(start, part - outside * part, zero) - latest
        latest = choose(later, part, latest)
        gap = choose(later, end, gap)
        nx = choose(later, f[0], nx)
        ny = choose(later, f[1], ny)
        nz = choose(later, f[2], nz)
    return gap, nx, ny, nz, choose(relative_to, zero, minimum(latest, earliest - latest))
