"""Where an edge of a cloth or soft body is nearest to a convex hull: across the hull's own edges.

Along a straight edge the height above the hull, the largest of those above the planes of its faces, is convex and made
of straight pieces. Two pieces meet at the lowest point, one that falls and one that rises. The mean of their planes'
normals that is square to the edge is the normal across both edges, and the height over its length the distance between
them, outside of the hull as inside. The flatter piece is the face that the edge lies on, if it lies on one; where that
piece ends on its other side the edge meets the hull a second time.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.feature_push import PATIENCE, SLANT
from nuno.contact.particle.hull import FAR, beside_box
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
    beside = beside_box(a + way * 0.5, half, h.size)
    touch.near = -beside
    touch.on = -beside
    if not anywhere(-beside):
        return touch
    # heights of both ends, and the slopes there; which of all planes it may reach
    ha = -one * FAR
    hb = -one * FAR
    da = zero
    db = zero
    apart = -one * FAR
    first = -one * FAR
    second = -one * FAR
    ends = shapes.faces[s]
    all_seen = int(1)
    for k in range(ends[0], ends[1]):
        f = shapes.planes[k]
        slope = way.x * f[0] + way.y * f[1] + way.z * f[2]
        begin = a.x * f[0] + a.y * f[1] + a.z * f[2] - f[3]
        end = begin + slope
        apart = maximum(apart, minimum(begin, end) - h.reach)
        if not anywhere(0.25 * cell - apart):
            all_seen = 0
            break
        top = maximum(begin, end)
        second = maximum(second, minimum(first, top))
        first = maximum(first, top)
        above = begin - ha
        ha = choose(above, begin, ha)
        da = choose(above, slope, da)
        above = end - hb
        hb = choose(above, end, hb)
        db = choose(above, slope, db)
    if all_seen == 0:
        touch.near = -apart
        touch.on = -apart
        return touch
    tiny = -one * 1.0e-12
    # both pieces as lines: at the edge's start they are at ca and cb
    ca = ha
    cb = hb - db
    part = (cb - ca) / minimum(da - db, tiny)
    lowest = choose(minimum(-da, db), ca + da * part, ha)
    near = minimum(minimum(second + h.reach, -maximum(apart, beside)), h.reach - minimum(minimum(ha, hb), lowest))
    length = sqrt(dot(way, way)) - tiny
    on = minimum(minimum(minimum(-da, db) + h.reach - h.radius, near), db - da - length * FLAT)
    touch.near = near
    touch.on = on
    if not anywhere(on):
        return touch
    low = zero
    high = one
    cuts = int(CUTS)  # a variable, or Warp would unroll the loop
    for _k in range(cuts):
        # where it rises or falls all along, it is lowest at an end
        part = choose(da, zero, choose(-db, one, part))
        at = maximum(low, minimum(high, part))
        p = a + at * way
        height = -one * FAR
        slope = zero
        for k in range(ends[0], ends[1]):
            f = shapes.planes[k]
            own = p.x * f[0] + p.y * f[1] + p.z * f[2] - f[3]
            above = own - height
            height = choose(above, own, height)
            slope = choose(above, way.x * f[0] + way.y * f[1] + way.z * f[2], slope)
        # each world stops where it would alone
        open = minimum(on, height - maximum(ca + da * at, cb + db * at) - FLUSH)
        if not anywhere(open):
            break
        rises = minimum(open, slope)
        falls = minimum(open, choose(slope, -one, one))
        c = height - slope * at
        high = choose(rises, at, high)
        cb = choose(rises, c, cb)
        db = choose(rises, slope, db)
        low = choose(falls, at, low)
        ca = choose(falls, c, ca)
        da = choose(falls, slope, da)
        part = choose(open, (cb - ca) / minimum(da - db, tiny), part)
    flatter = absolute(db) - absolute(da)
    c = choose(flatter, ca, cb)
    d = choose(flatter, da, db)
    # the lowest point is where that piece ends downwards; a second may be at its other end
    down = choose(d, -one, one)
    if point_index > 0:
        down = -down
    alike = length * ALIKE
    at = down * FAR
    other = -down * FAR
    do = d + down
    n = vec3(zero, zero, one)
    no = n
    least = one * FAR
    for k in range(ends[0], ends[1]):
        f = shapes.planes[k]
        steeper = way.x * f[0] + way.y * f[1] + way.z * f[2] - d
        lower = c - (a.x * f[0] + a.y * f[1] + a.z * f[2] - f[3])
        # the piece's own plane
        miss = absolute(steeper) + absolute(lower)
        closer = least - miss
        least = choose(closer, miss, least)
        n = vec3(choose(closer, f[0], n.x), choose(closer, f[1], n.y), choose(closer, f[2], n.z))
        side = steeper * down
        own = lower / choose(absolute(steeper) - alike, steeper, one)
        nearer = minimum(side - alike, (at - own) * down)
        at = choose(nearer, own, at)
        do = choose(nearer, d + steeper, do)
        no = vec3(choose(nearer, f[0], no.x), choose(nearer, f[1], no.y), choose(nearer, f[2], no.z))
        other = choose(minimum(-side - alike, (own - other) * down), own, other)
    at = maximum(zero, minimum(one, at))
    other = maximum(zero, minimum(one, other))
    from_other = absolute(at - other) - maximum(h.radius * 2.0 / length, one * NEXT)
    if point_index > 0:
        on = minimum(on, from_other)
    elif anywhere(minimum(on, from_other)):
        touch.more = 1
    gap = c + d * at
    # square to the edge, or as near to it as a mean of both normals comes
    share = maximum(zero, minimum(one, do / (do - d)))
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
