"""A cloth's edges and triangles against what is sharp or small: edges and corners of boxes, rims, small balls.

A convex shape's distance along a straight edge is convex. Where it falls from both ends inwards, its lowest point is
between them, and found by the tangents at two points on either side: they cross under it; at balls and capsules there
is a formula. Inside of a triangle it is the shape's outermost point against the triangle's plane that touches. Point
and normal are those where the substep began, when nothing crossed, and the whole motion of the substep, relative to
the shape, counts against them, so that what was pressed through within the substep is put back
(`nuno.contact.particle.feature_push`).

All that is found here is of the substep's start, and so does not depend on which element is pushed first.
"""

from typing import Any

import warp as wp

from nuno.contact.particle.distances import BOX, CAPSULE, CYLINDER, FAR, HULL, SPHERE, distance_solid
from nuno.contact.particle.feature_lists import DUE, stands_between
from nuno.contact.particle.feature_push import PATIENCE, SLANT
from nuno.contact.particle.hull import box_clearance, meets_corners, outermost_corner
from nuno.contact.particle.hull_ridges import hull_edge_point
from nuno.numbers.lane_masks import in_lanes
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
    to_float,
)
from nuno.numbers.vec3 import cross, dot, start_position, transposed_mul, vec3
from nuno.state.cloth_state import Shapes

STEPS = wp.constant(6)
"""Tangents looked at between two ends: the distance of a 40 mm edge from what is round by 4 mm, or from the edge of a
box, is then found within 0.006 mm, of twenty thousand that were tried."""

EDGE_TOLERANCE = wp.constant(1.0e-5)
"""[m] What is nearer to an edge than this does not say by where it is which way is out: rounding moves it."""


@wp.func
def past_box_edge(a: Any, way: Any, part: Any, half: Any):
    """The part of a way from a point a on that is nearest to an edge of a box, the one next to its ``part``."""
    zero = full_like(a.x, 0.0)
    one = full_like(a.x, 1.0)
    p = a + part * way
    qx = absolute(p.x) - half.x
    qy = absolute(p.y) - half.y
    qz = absolute(p.z) - half.z
    # along the edge nothing counts
    kx = choose(minimum(qy, qz) - qx, zero, one)
    kz = choose(kx * (qy - qz), zero, one)
    ky = 2.0 - kx - kz
    across = vec3(kx * way.x, ky * way.y, kz * way.z)
    corner = vec3(choose(p.x, half.x, -half.x), choose(p.y, half.y, -half.y), choose(p.z, half.z, -half.z))
    return -(dot(a - corner, across) / (dot(across, across) + 1.0e-20))


@wp.func
def past_axis(a: Any, way: Any, half: Any):
    """The part of a way from a point a on that is nearest to a ball's middle, or to a capsule's axis along z."""
    tiny = -full_like(a.x, 1.0e-12)
    across = a.x * way.x + a.y * way.y
    flat = way.x * way.x + way.y * way.y
    part = across / (tiny - flat)
    z = a.z + part * way.z
    # beyond the axis it is nearest to its end
    end = a.z - choose(z, half, -half)
    return choose(absolute(z) - half, (across + end * way.z) / (tiny - (flat + way.z * way.z)), part)


@wp.func
def across_edge(
    kind: int, point: Any, way: Any, gap: Any, normal: Any, a: Any, b: Any, c: Any, deepest: float
):  # fmt: skip
    """Return how deep an edge is at a point in a box or a cylinder, by the way out across the shape's nearest edge.

    The nearest face's normal would be another one on either side of the shape's edge.

    Returns:
        The distance and its normal; those given where the point is outside or deeper than ``deepest`` [m], or the two
        do not cross.
    """
    x = point.x
    y = point.y
    z = point.z
    zero = full_like(x, 0.0)
    one = full_like(x, 1.0)
    # outward normals f and g of the two faces that meet in the shape's edge, and the distances p and q from them
    rho = sqrt(x * x + y * y + 1.0e-20)
    fx = x / rho
    fy = y / rho
    p = rho - a
    gy = zero
    gz = choose(z, one, -one)
    q = absolute(z) - b
    if kind == BOX:
        qx = absolute(x) - a
        qy = absolute(y) - b
        qz = absolute(z) - c
        # along the edge the point is the deepest
        kx = choose(minimum(qy, qz) - qx, zero, one)
        kz = choose(kx * (qy - qz), zero, one)
        gy = choose(y, one, -one)
        fx = choose(x, one, -one) * kx
        fy = gy * (one - kx)
        gy = gy * (one - kz)
        gz = gz * kz
        p = choose(kx, qx, qy)
        q = choose(kz, qz, qy)
    # across the edge, where the shape's edge is a point
    lf = fx * way.x + fy * way.y
    lg = gy * way.y + gz * way.z
    mf = absolute(lg)
    mg = absolute(lf)
    lean = choose(mf - mg, one, -one)
    alike = lf * lg
    mf = mf * choose(alike, lean, one)
    mg = mg * choose(alike, -lean, one)
    size = sqrt(lf * lf + lg * lg + 1.0e-20)
    mf = mf / size
    mg = mg / size
    deep = mf * p + mg * q
    on = minimum(minimum(EDGE_TOLERANCE - gap, deep + deepest), minimum(mf, mg) + SLANT)
    on = minimum(on, size - SLANT * sqrt(dot(way, way)))
    out = vec3(mf * fx, mf * fy + mg * gy, mg * gz)
    return choose(on, deep, gap), choose(on, out, normal)


@wp.func
def due_after(t: Any, entry: int, travelled: float, near: float, without: int):
    """Let an element sleep until all have gone as far as ``near`` is below zero, but in the lanes ``without``."""
    t.feature_due[DUE + entry] = wp.min(t.feature_due[DUE + entry], travelled - near)


@wp.func
def due_after(t: Any, entry: int, travelled: lane, near: lane, without: int):
    t.feature_due[DUE + entry] = minimum(t.feature_due[DUE + entry], in_lanes(travelled - near, without, FAR))


@wp.func
def edge_point(
    t: Any, h: Any, shapes: Shapes, s: int, entry: int, travelled: Any, without: int, i: int, j: int, point_index: int,
    cell: float,
):  # fmt: skip
    """Return an edge's point nearest to a shape: 0 or 1 (``point_index``), for over two edges of a box it has two.

    In the lanes ``without``, bit by bit, nothing is asked.

    Returns:
        Whether the shape may touch it there (positive) and whether there is a second point; the point's part of the
        way from i to j, its place in the shape's frame and the normal there, and the gap [m], less
        what of it may stay. What is deeper in than half a ``cell`` [m] has gone past the shape's edge.
    """
    like = h.radius
    zero = full_like(like, 0.0)
    one = full_like(like, 1.0)
    a = transposed_mul(h.rotation, to_float(start_position(t, i) - h.centre))
    way = transposed_mul(h.rotation, start_position(t, j) - start_position(t, i))
    if h.kind == HULL:
        touch = hull_edge_point(h, shapes, s, a, way, point_index, cell)
        due_after(t, entry, travelled, touch.near, without)
        return in_lanes(touch.on, without, -1.0), touch.more, touch.at, touch.point, touch.normal, touch.gap
    half = vec3(absolute(way.x) * 0.5 + h.reach, absolute(way.y) * 0.5 + h.reach, absolute(way.z) * 0.5 + h.reach)
    on, _point = stands_between(
        shapes, s, h.kind, a + way * 0.5, half, h.reach, h.size.x, h.size.y, h.size.z, h.broad
    )  # fmt: skip
    tiny = -full_like(like, 1.0e-12)
    part = zero
    near = on
    fa = zero
    da = zero
    fb = zero
    db = zero
    if anywhere(on):
        fa, n = distance_solid(h.kind, a, h.size.x, h.size.y, h.size.z)
        da = dot(n, way)
        fb, n = distance_solid(h.kind, a + way, h.size.x, h.size.y, h.size.z)
        db = dot(n, way)
        part = (fb - db - fa) / minimum(da - db, tiny)
        # nowhere is it nearer than at the lower end or, if both slopes fall inwards, where the ends' tangents cross
        near = minimum(near, h.reach - minimum(minimum(fa, fb), choose(minimum(-da, db), fa + da * part, fa)))
        # over a face both ends see the same slope, which one may lose within the substep
        on = minimum(minimum(-da, db) + h.reach - h.radius, near)
    due_after(t, entry, travelled, near, without)
    at = zero
    gap = zero
    point = vec3(zero, zero, zero)
    normal = vec3(zero, zero, zero)
    more = int(0)
    if anywhere(on):
        steps = int(STEPS)  # a variable, or Warp would unroll the loop
        if h.kind == BOX:
            steps = 1
            part = past_box_edge(a, way, part, h.size)
            part = maximum(zero, minimum(one, part))
            # over two edges with a face between, it lies on both: on one at a time it would rock
            left = maximum(zero, minimum(one, past_box_edge(a, way, zero, h.size)))
            right = maximum(zero, minimum(one, past_box_edge(a, way, one, h.size)))
            other = choose(left + right - part - part, right, left)
            apart = absolute(other - part) - h.radius * 2.0 / (sqrt(dot(way, way)) - tiny)
            if anywhere(minimum(on, apart)):
                more = 1
            if point_index > 0:
                part = other
                on = minimum(on, apart)
        elif h.kind == SPHERE or h.kind == CAPSULE:
            steps = 1
            part = past_axis(a, way, h.size.y)
        low = zero
        high = one
        for _k in range(steps):
            at = maximum(low, minimum(high, part))
            gap, normal = distance_solid(h.kind, a + at * way, h.size.x, h.size.y, h.size.z)
            slope = dot(normal, way)
            low = choose(slope, low, at)
            fa = choose(slope, fa, gap)
            da = choose(slope, da, slope)
            high = choose(slope, at, high)
            fb = choose(slope, gap, fb)
            db = choose(slope, slope, db)
            part = (fb - db * high - fa + da * low) / minimum(da - db, tiny)
        point = a + at * way
        if (h.kind == BOX or h.kind == CYLINDER) and anywhere(EDGE_TOLERANCE - gap):
            gap, normal = across_edge(
                h.kind, point, way, gap, normal, h.size.x, h.size.y, h.size.z, 0.5 * cell
            )  # fmt: skip
        # across the edge: what of the normal is along it, all of it where the edge stands across the shape,
        # parts nothing
        slope = dot(normal, way) / (dot(way, way) - tiny)
        normal = normal - slope * way
        size = sqrt(dot(normal, normal) + 1.0e-20)
        normal = normal / size
        gap = (gap - h.radius) / maximum(size, SLANT)
        gap = gap - minimum(gap, zero) * PATIENCE
        on = minimum(minimum(on, size - SLANT), minimum(at, one - at))
        if point_index > 0 and more == 0:
            on = -one
    return in_lanes(on, without, -1.0), more, at, point, normal, gap


@wp.func
def triangle_point(
    t: Any, h: Any, shapes: Shapes, s: int, entry: int, travelled: Any, without: int, i: int, j: int, k: int,
    cell: float,
):  # fmt: skip
    """Return where a shape's outermost point meets a triangle, as shares of the ways from i to j and to k.

    Returns:
        As `edge_point`, without the second of its numbers, and with two parts. What is deeper in than half a ``cell``
        [m] has gone through.
    """
    like = h.radius
    zero = full_like(like, 0.0)
    one = full_like(like, 1.0)
    third = float(1.0 / 3.0)
    a = transposed_mul(h.rotation, to_float(start_position(t, i) - h.centre))
    way = transposed_mul(h.rotation, start_position(t, j) - start_position(t, i))
    m = transposed_mul(h.rotation, start_position(t, k) - start_position(t, i))
    o = (way + m) * third
    far = maximum(dot(way - o, way - o), dot(m - o, m - o))
    size = sqrt(maximum(dot(o, o), far)) + h.reach
    around = vec3(size, size, size)
    bj = zero
    bk = zero
    n = cross(way, m)
    point = vec3(zero, zero, zero)
    normal = vec3(zero, zero, zero)
    gap = zero
    on = size
    if h.kind == HULL:
        on = -box_clearance(a + o, around, h.size)
        if anywhere(on):
            on = minimum(on, meets_corners(shapes, s, a + o, size, cell))
        if anywhere(on):
            point, normal = outermost_corner(shapes, s, a, n * (one / sqrt(dot(n, n) + 1.0e-20)), cell)
            on = minimum(on, h.reach + dot(point - a, normal))
    else:
        _along, on = stands_between(
            shapes, s, h.kind, a + o, around, size, h.size.x, h.size.y, h.size.z, h.broad
        )  # fmt: skip
    due_after(t, entry, travelled, on, without)
    if anywhere(on):
        nn = dot(n, n) + 1.0e-20
        if h.kind != HULL:
            # away from the shape's middle
            normal = n * (choose(dot(n, a), one, -one) / sqrt(nn))
            point = outermost(h.kind, normal, h.size.x, h.size.y, h.size.z)
        d = point - a
        gap = -dot(d, normal)
        # weights of the vertices where the shape's point is over the triangle
        bj = dot(cross(d, m), n) / nn
        bk = dot(cross(way, d), n) / nn
        on = minimum(minimum(one - bj - bk, minimum(bj, bk)), minimum(h.reach - gap, gap + 0.5 * cell))
        # the triangle's point
        point = point + gap * normal
        gap = gap - h.radius
        gap = gap - minimum(gap, zero) * PATIENCE
    return in_lanes(on, without, -1.0), bj, bk, point, normal, gap


@wp.func
def outermost(kind: int, n: Any, a: Any, b: Any, c: Any):
    """The point of a shape that is farthest along a direction."""
    one = full_like(n.x, 1.0)
    x = a * n.x
    y = a * n.y
    z = choose(n.z, one, -one) * b
    if kind == BOX:
        x = choose(n.x, one, -one) * a
        y = choose(n.y, one, -one) * b
        z = choose(n.z, one, -one) * c
    elif kind == CYLINDER:
        rho = sqrt(n.x * n.x + n.y * n.y + 1.0e-20)
        x = x / rho
        y = y / rho
    else:
        z = z + a * n.z
    return vec3(x, y, z)
