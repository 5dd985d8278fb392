"""An edge of a cloth or soft body at its nearest to a convex hull: across the hull's own edges.

Along a straight edge the height above the hull, the largest of those above the planes of its faces, is convex and made
of straight pieces. Two pieces meet at the lowest point, one that falls and one that rises. The mean of their planes'
normals that is square to the edge is the normal across both edges, and the height over its length the distance between
them, outside of the hull as inside. The flatter piece is the face that the edge lies on, if it lies on one; where that
piece ends on its other side the edge meets the hull a second time.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.feature_push import PATIENCE, SLANT
from nuno.contact.particle.hull import box_clearance
from nuno.contact.particle.hull_grid import top_plane
from nuno.numbers.lanes import (  # noqa: F401
    absolute,
    add,
    anywhere,
    choose,
    div,
    full_like,
    lane,
    maximum,
    minimum,
    mul,
    sqrt,
    sub,
)
from nuno.numbers.vec3 import LaneVec3, Vec3, dot, vec3
from nuno.state.cloth_state import Shapes

CUTS = wp.constant(6)
"""Cuts by planes to the lowest point; two do at a box, each further one passes over faces between."""
FLUSH = wp.constant(1.0e-7)
"""[m] Of the lowest point, the error that is left."""
ALIKE = wp.constant(1.0e-4)
"""Difference of two planes' slopes along an edge below which they count as one face."""
NEXT = wp.constant(0.2)
"""Part of an edge by which its second point must be away from the first."""
FLAT = wp.constant(1.0 / 3.0)
"""An edge over faces that turn by less than this, 19 degrees, is left to its vertices: it cuts in by a twelfth of its
length at most, as a diagonal does into a ball of three cells."""


def _make(name: str, number: type, vector: type) -> Any:
    fields: dict[str, Any] = {"near": number, "on": number, "more": int, "at": number}
    fields |= {"point": vector, "normal": vector, "gap": number}
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


RidgeTouchFloat, RidgeTouchLanes = _make("RidgeTouchFloat", float, Vec3), _make("RidgeTouchLanes", lane, LaneVec3)


@wp.func
def ridge_touch(like: float):
    """An edge's point at a hull, which it does not touch."""
    return RidgeTouchFloat()


@wp.func
def ridge_touch(like: lane):
    return RidgeTouchLanes()


@wp.func
def hull_edge_point(h: Any, shapes: Shapes, s: int, a: Any, way: Any, point_index: int, cell: float):
    """Return what `nuno.contact.particle.feature_points.edge_point` does, of the edge from a along ``way``.

    Returns:
        ``near``, by how much it is nearer than must be looked at, or above zero; and what ``edge_point`` returns.
    """
    like = h.radius
    zero = full_like(like, 0.0)
    one = full_like(like, 1.0)
    touch = ridge_touch(like)
    touch.more = int(0)
    reach = vec3(h.reach, h.reach, h.reach)
    half = vec3(absolute(way.x), absolute(way.y), absolute(way.z)) * 0.5 + reach
    clearance = box_clearance(a + way * 0.5, half, h.size)
    touch.near = -clearance
    touch.on = -clearance
    if not anywhere(-clearance):
        return touch
    # heights of both ends, and the slopes there
    high_at_a, na = top_plane(shapes, s, a, -clearance)
    high_at_b, nb = top_plane(shapes, s, a + way, -clearance)
    da = dot(na, way)
    db = dot(nb, way)
    tiny = -one * 1.0e-12
    # both pieces as lines: at the edge's start they are at ca and cb
    ca = high_at_a
    cb = high_at_b - db
    part = (cb - ca) / minimum(da - db, tiny)
    lowest = minimum(minimum(high_at_a, high_at_b), choose(minimum(-da, db), ca + da * part, high_at_a))
    near = choose(-clearance, minimum(h.reach - lowest, -clearance), -clearance)
    length = sqrt(dot(way, way)) - tiny
    on = minimum(minimum(minimum(-da, db) + h.reach - h.radius, near), db - da - length * FLAT)
    touch.near = near
    touch.on = on
    if not anywhere(on):
        return touch
    # the pieces at the ends, for the second point
    first_c = ca
    first_d = da
    first_n = na
    last_c = cb
    last_d = db
    last_n = nb
    # where it rises or falls all along, it is lowest at an end
    part = choose(da, zero, choose(-db, one, part))
    cuts = int(CUTS)  # a variable, or Warp would unroll the loop
    for _k in range(cuts):
        part = maximum(zero, minimum(one, part))
        height, n = top_plane(shapes, s, a + part * way, on)
        # each world stops where it would alone
        above = minimum(on, height - maximum(ca + da * part, cb + db * part) - FLUSH)
        if not anywhere(above):
            break
        slope = dot(n, way)
        rises = minimum(above, slope)
        falls = minimum(above, choose(slope, -one, one))
        c = height - slope * part
        cb = choose(rises, c, cb)
        db = choose(rises, slope, db)
        nb = choose(rises, n, nb)
        ca = choose(falls, c, ca)
        da = choose(falls, slope, da)
        na = choose(falls, n, na)
        part = choose(above, (cb - ca) / minimum(da - db, tiny), part)
    at = maximum(zero, minimum(one, part))
    # the flatter piece, the other one, and the way the flatter one goes on: to the edge's end, or its start
    flatter = absolute(db) - absolute(da)
    c = choose(flatter, ca, cb)
    d = choose(flatter, da, db)
    n = choose(flatter, na, nb)
    do = choose(flatter, db, da)
    no = choose(flatter, nb, na)
    onwards = choose(flatter, choose(da, one, -one), choose(-db, -one, one))
    # the piece at that end of the edge: there, or before, the flatter one ends
    ce = choose(onwards, last_c, first_c)
    de = choose(onwards, last_d, first_d)
    ne = choose(onwards, last_n, first_n)
    apart = maximum(h.radius * 2.0 / length, one * NEXT)
    turned = absolute(de - d) - length * ALIKE
    other = (ce - c) / choose(turned, d - de, one)
    two = minimum(minimum(on, turned), absolute(other - at) - apart)
    if anywhere(two):
        touch.more = 1
    if point_index > 0:
        on = two
        for _k in range(cuts):
            other = maximum(zero, minimum(one, other))
            height, n_there = top_plane(shapes, s, a + other * way, on)
            above = minimum(on, height - (c + d * other) - FLUSH)
            if not anywhere(above):
                break
            slope = dot(n_there, way)
            ce = choose(above, height - slope * other, ce)
            de = choose(above, slope, de)
            ne = choose(above, n_there, ne)
            turned = absolute(de - d) - length * ALIKE
            on = minimum(on, choose(above, turned, one))
            other = choose(above, (ce - c) / choose(turned, d - de, one), other)
        other = maximum(zero, minimum(one, other))
        on = minimum(on, absolute(other - at) - apart)
        at = other
        do = de
        no = ne
    gap = c + d * at
    # square to the edge, or as near to it as a mean of both normals comes
    share = maximum(zero, minimum(one, do / choose(absolute(do - d) + tiny, do - d, one)))
    across = n * share + no * (one - share)
    size = sqrt(dot(across, across) + 1.0e-20)
    # what is deeper in has gone past the hull's edge
    ridge = gap / size + 0.5 * cell
    normal = choose(ridge, across / size, n)
    gap = choose(ridge, gap / size, gap)
    normal = normal - way * (dot(normal, way) / (dot(way, way) - tiny))
    size = sqrt(dot(normal, normal) + 1.0e-20)
    touch.normal = normal / size
    gap = (gap - h.radius) / maximum(size, SLANT)
    touch.gap = gap - minimum(gap, zero) * PATIENCE
    touch.on = minimum(minimum(on, size - SLANT), minimum(at, one - at))
    touch.at = at
    touch.point = a + at * way
    return touch
