"""Convex hulls as what particles touch: the planes of their faces, which all lanes look at together.

A mesh is searched for the nearest of its triangles by each world on its own; a hull needs no search.
"""

from typing import Any

import warp as wp

from nuno.numbers.lanes import absolute, add, anywhere, choose, div, full_like, maximum, minimum, mul, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import dot, vec3
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


@wp.func
def box_clearance(p: Any, h: Any, half: Any):
    """Return how far a box about p (half sides h) is from the box of half sides ``half`` about the origin [m]."""
    x = absolute(p.x) - h.x - half.x
    y = absolute(p.y) - h.y - half.y
    z = absolute(p.z) - h.z - half.z
    return maximum(maximum(x, y), z)


@wp.func
def meets_ridges(shapes: Shapes, s: int, p: Any, h: Any, ball: Any):
    """Return by how far edges of a convex hull may be in a box about p of half sides h [m]; below zero: apart.

    What is in it is no farther from p than ``ball`` [m], either. A point on an edge is on the planes of two faces, and
    outside of none.
    """
    apart = -full_like(p.x, FAR)
    first = apart
    second = apart
    all_seen = int(1)
    ends = shapes.faces[s]
    for k in range(ends[0], ends[1]):
        f = shapes.planes[k]
        height = p.x * f[0] + p.y * f[1] + p.z * f[2] - f[3]
        reach = minimum(ball, h.x * wp.abs(f[0]) + h.y * wp.abs(f[1]) + h.z * wp.abs(f[2]))
        apart = maximum(apart, height - reach)
        if not anywhere(ball - apart):
            all_seen = 0
            break
        top = height + reach
        second = maximum(second, minimum(first, top))
        first = maximum(first, top)
    if all_seen == 0:
        return -apart
    return minimum(second, -apart)


@wp.func
def meets_corners(shapes: Shapes, s: int, p: Any, ball: Any, cell: float):
    """Return by how far corners of a convex hull, sharp to cells [m], are in a ball about p [m]; below zero: apart."""
    least = full_like(p.x, FAR)
    ends = shapes.corner_ends[s]
    for k in range(ends[0], ends[1]):
        c = shapes.corners[k]
        if cell < c[3]:
            break
        x = p.x - c[0]
        y = p.y - c[1]
        z = p.z - c[2]
        least = minimum(least, x * x + y * y + z * z)
    return ball - sqrt(least)


@wp.func
def outermost_corner(shapes: Shapes, s: int, a: Any, n: Any, cell: float):
    """Return a hull's corner, of those sharp to cells [m], farthest towards a plane through a of unit normal n.

    Returns:
        The corner, and the plane's normal away from the hull.
    """
    one = full_like(n.x, 1.0)
    ends = shapes.corner_ends[s]
    most = -one * FAR
    least = one * FAR
    top = a
    bottom = a
    for k in range(ends[0], ends[1]):
        c = shapes.corners[k]
        if cell < c[3]:
            break
        height = n.x * c[0] + n.y * c[1] + n.z * c[2]
        higher = height - most
        most = choose(higher, height, most)
        top = vec3(choose(higher, c[0], top.x), choose(higher, c[1], top.y), choose(higher, c[2], top.z))
        lower = least - height
        least = choose(lower, height, least)
        bottom = vec3(choose(lower, c[0], bottom.x), choose(lower, c[1], bottom.y), choose(lower, c[2], bottom.z))
    # a plane through the hull is nearer to the side that it is out of by less
    above = dot(n, a) * 2.0 - most - least
    return choose(above, top, bottom), n * choose(above, one, -one)
