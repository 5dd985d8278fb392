"""Contact manifolds of two convex parts: up to four points with a normal that they share.

The faces of the two parts that look at each other most are laid over each other along the normal, and each corner of
what they have in common is a point, with how far apart the faces are there. Face on face, edge on edge and corner on
face all come out of this: faces are plane, so that their least distance is at a corner of the overlap, and crossing
edges make a corner of it.
"""

import warp as wp

from nuno.rigid.convex import (
    BOX_PART,
    CYLINDER_PART,
    HULL,
    TRIANGLE,
    Convex,
    Parts,
    core_direction,
    extreme_placed,
    face_corners,
    face_normal,
    gap_along,
)

POINTS = 4
"""Points of a manifold: what carries a plane contact."""
SNAP = wp.constant(0.9998)
"""Cosine of 1.1 degrees: a normal this near to a face's is the face's, so that what rests on a face does so exactly."""


@wp.func
def count_axes(parts: Parts, c: Convex):
    """Return how many face normals `axis_of` lists."""
    result = int(0)
    if c.kind == BOX_PART:
        result = 6
    elif c.kind == CYLINDER_PART:
        result = 10
    elif c.kind == TRIANGLE:
        result = 1
    elif c.kind == HULL:
        span = parts.faces[c.part]
        result = span[1] - span[0]
    return result


@wp.func
def axis_of(parts: Parts, c: Convex, k: int):
    """The k-th outward normal of a part's faces; of a cylinder's side, eight."""
    n = wp.vec3(0.0, 0.0, 1.0)
    if c.kind == BOX_PART:
        s = 1.0 - 2.0 * float(k / 3)
        n = wp.vec3(wp.where(k % 3 == 0, s, 0.0), wp.where(k % 3 == 1, s, 0.0), wp.where(k % 3 == 2, s, 0.0))
    elif c.kind == CYLINDER_PART:
        if k < 2:
            n = wp.vec3(0.0, 0.0, 1.0 - 2.0 * float(k))
        else:
            angle = 0.78539816 * float(k)
            n = wp.vec3(wp.cos(angle), wp.sin(angle), 0.0)
    elif c.kind == TRIANGLE:
        n = wp.normalize(wp.cross(c.b - c.a, c.c - c.a))
    elif c.kind == HULL:
        span = parts.faces[c.part]
        n = parts.normal[span[0] + k]
    return n


@wp.func
def way_out(parts: Parts, a: Convex, x: wp.vec3, q: wp.quat, b: Convex):
    """For parts whose cores meet: the face normal, or the line of centres, along which they overlap least."""
    n = wp.vec3(0.0, 0.0, 1.0)
    best = float(-1.0e30)
    if b.kind != TRIANGLE and wp.length(x) > 1.0e-6:
        n = wp.normalize(x)
        best = gap_along(parts, a, x, q, b, n)
    for k in range(count_axes(parts, b)):
        d = axis_of(parts, b, k)
        gap = gap_along(parts, a, x, q, b, d)
        if gap > best:
            best = gap
            n = d
    if b.kind != TRIANGLE:
        for k in range(count_axes(parts, a)):
            d = -wp.quat_rotate(q, axis_of(parts, a, k))
            gap = gap_along(parts, a, x, q, b, d)
            # b's own faces are preferred: they are often what is fixed
            if gap > best + 1.0e-5:
                best = gap
                n = d
    return n


@wp.func
def clip(
    subject: wp.array(dtype=wp.vec3), count: int, n: wp.vec3, cutter: wp.array(dtype=wp.vec3), sides: int, slack: float
):
    """Cut a polygon or a segment by a polygon's sides, seen along n (Sutherland, Hodgman 1974); the corners left."""
    cut = wp.zeros(shape=(24,), dtype=wp.vec3)
    middle = wp.vec3(0.0)
    for k in range(sides):
        middle = middle + cutter[k] / float(sides)
    left = count
    for k in range(sides):
        start = cutter[k]
        m = wp.cross(cutter[(k + 1) % sides] - start, n)
        size = wp.length(m)
        if size > 1.0e-9 and left > 0:
            m = m / size
            if wp.dot(m, middle - start) > 0.0:
                m = -m
            made = int(0)
            last = subject[left - 1]
            before = wp.dot(m, last - start) - slack
            for j in range(left):
                here = subject[j]
                now = wp.dot(m, here - start) - slack
                # a segment has one side, not one there and one back
                if (now <= 0.0) != (before <= 0.0) and (left > 2 or j > 0) and made < 24:
                    cut[made] = last + (here - last) * (before / (before - now))
                    made = made + 1
                if now <= 0.0 and made < 24:
                    cut[made] = here
                    made = made + 1
                last = here
                before = now
            left = made
            for j in range(left):
                subject[j] = cut[j]
    return left


@wp.func
def fewer(place: wp.array(dtype=wp.vec3), gap: wp.array(dtype=float), count: int, n: wp.vec3):
    """Keep four of the points: the deepest, the one farthest from it, and the farthest on both sides of these."""
    if count <= 4:
        return count
    first = int(0)
    for k in range(count):
        if gap[k] < gap[first]:
            first = k
    p = place[first]
    second = int(first)
    most = float(-1.0)
    for k in range(count):
        far = wp.length_sq(place[k] - p)
        if far > most:
            most = far
            second = k
    side = wp.cross(n, place[second] - p)
    third = int(-1)
    fourth = int(-1)
    up = float(0.0)
    down = float(0.0)
    for k in range(count):
        if k != first and k != second:
            off = wp.dot(side, place[k] - p)
            if off > up:
                up = off
                third = k
            if off < down:
                down = off
                fourth = k
    p0 = place[first]
    g0 = gap[first]
    p1 = place[second]
    g1 = gap[second]
    p2 = p0
    g2 = g0
    p3 = p0
    g3 = g0
    if third >= 0:
        p2 = place[third]
        g2 = gap[third]
    if fourth >= 0:
        p3 = place[fourth]
        g3 = gap[fourth]
    place[0] = p0
    gap[0] = g0
    place[1] = p1
    gap[1] = g1
    kept = int(2)
    if third >= 0:
        place[kept] = p2
        gap[kept] = g2
        kept = kept + 1
    if fourth >= 0:
        place[kept] = p3
        gap[kept] = g3
        kept = kept + 1
    return kept


@wp.func
def nearest_of_segments(a: wp.vec3, u: wp.vec3, b: wp.vec3, v: wp.vec3, n: wp.vec3):
    """The share along u from a at which two segments cross, seen along n, within both."""
    across = wp.cross(v, n)
    s = wp.dot(across, b - a) / wp.dot(across, u)
    return wp.clamp(s, 0.0, 1.0)


@wp.func
def side_by_side(
    place: wp.array(dtype=wp.vec3), gap: wp.array(dtype=float), other: wp.array(dtype=wp.vec3), n: wp.vec3
):
    """Cut a segment to where it overlaps another that is parallel to it; how many points that are."""
    start = place[0]
    u = place[1] - start
    v = other[1] - other[0]
    size = wp.dot(u, u)
    s0 = wp.dot(other[0] - start, u) / size
    s1 = wp.dot(other[1] - start, u) / size
    low = wp.clamp(wp.min(s0, s1), 0.0, 1.0)
    high = wp.clamp(wp.max(s0, s1), 0.0, 1.0)
    for k in range(2):
        t = wp.where(k == 0, low, high)
        p = start + t * u
        along = wp.clamp((t - s0) / (s1 - s0), 0.0, 1.0)
        place[k] = p
        gap[k] = wp.dot(n, p - (other[0] + along * v))
    return 2


@wp.func
def lay_over(
    parts: Parts,
    a: Convex,
    x: wp.vec3,
    q: wp.quat,
    b: Convex,
    n: wp.vec3,
    gap_n: float,
    margin: float,
    place: wp.array(dtype=wp.vec3),
    gap: wp.array(dtype=float),
):
    """The points, on a's surface in b's frame, with their gaps along n, and how many."""
    pb = wp.zeros(shape=(12,), dtype=wp.vec3)
    da = wp.quat_rotate_inv(q, -n)
    la, ia = face_normal(parts, a, da)
    fb, ib = face_normal(parts, b, n)
    fa = wp.quat_rotate(q, la)
    na = face_corners(parts, a, da, la, ia, place)
    for k in range(na):
        place[k] = x + wp.quat_rotate(q, place[k])
    nb = face_corners(parts, b, n, fb, ib, pb)
    count = int(0)
    if na == 1:
        gap[0] = gap_n
        count = 1
    elif nb == 1:
        place[0] = pb[0] + gap_n * n
        gap[0] = gap_n
        count = 1
    elif na == 2 and nb == 2:
        u = place[1] - place[0]
        v = pb[1] - pb[0]
        if wp.length(wp.cross(u, v)) > 0.05 * wp.length(u) * wp.length(v):
            place[0] = place[0] + nearest_of_segments(place[0], u, pb[0], v, n) * u
            gap[0] = gap_n
            count = 1
        else:
            count = side_by_side(place, gap, pb, n)
    else:
        slack = 1.0e-6
        lean = float(1.0)
        if nb >= 3:
            lean = wp.dot(fb, n)
            if lean > 0.2:
                count = clip(place, na, n, pb, nb, slack)
                for k in range(count):
                    gap[k] = wp.dot(fb, place[k] - pb[0]) / lean
        else:
            # b's side is a segment: cut it by a's face
            lean = -wp.dot(fa, n)
            if lean > 0.2:
                pa = wp.zeros(shape=(12,), dtype=wp.vec3)
                for k in range(na):
                    pa[k] = place[k]
                place[0] = pb[0]
                place[1] = pb[1]
                count = clip(place, 2, n, pa, na, slack)
                for k in range(count):
                    gap[k] = wp.dot(fa, place[k] - pa[0]) / lean
                    place[k] = place[k] + gap[k] * n
        if count == 0 and b.kind != TRIANGLE:
            # corner against corner; a mesh has other triangles that this may be for
            place[0] = extreme_placed(parts, a, x, q, -n, 0.0) - a.rim * n
            gap[0] = gap_n
            count = 1
    kept = int(0)
    for k in range(count):
        if gap[k] <= margin:
            place[kept] = place[k]
            gap[kept] = gap[k]
            kept = kept + 1
    return fewer(place, gap, kept, n)


@wp.func
def snapped(parts: Parts, a: Convex, q: wp.quat, b: Convex, n: wp.vec3):
    """The normal, or that of a plane face of b or a that is as good as parallel to it."""
    result = n
    fb, ib = face_normal(parts, b, n)
    fa, ia = face_normal(parts, a, wp.quat_rotate_inv(q, -n))
    fa = -wp.quat_rotate(q, fa)
    flat_a = a.kind == BOX_PART or a.kind == HULL or (a.kind == CYLINDER_PART and ia == 0)
    flat_b = b.kind == BOX_PART or b.kind == HULL or b.kind == TRIANGLE or (b.kind == CYLINDER_PART and ib == 0)
    if flat_b and wp.dot(fb, n) > SNAP:
        result = fb
    elif flat_a and wp.dot(fa, n) > SNAP:
        result = fa
    return result


@wp.func
def collide(
    parts: Parts,
    a: Convex,
    x: wp.vec3,
    q: wp.quat,
    b: Convex,
    margin: float,
    place: wp.array(dtype=wp.vec3),
    gap: wp.array(dtype=float),
):
    """Normal (b's frame, from b to a), the least they are apart, and how many points are within ``margin``."""
    found = core_direction(parts, a, x, q, b)
    n = wp.vec3(found[0], found[1], found[2])
    if found[3] == 0.0:
        n = way_out(parts, a, x, q, b)
    n = snapped(parts, a, q, b, n)
    gap_n = gap_along(parts, a, x, q, b, n)
    count = int(0)
    if gap_n <= margin:
        count = lay_over(parts, a, x, q, b, n, gap_n, margin, place, gap)
    return n, gap_n, count


@wp.func
def collide_flat(
    parts: Parts,
    a: Convex,
    x: wp.vec3,
    q: wp.quat,
    margin: float,
    place: wp.array(dtype=wp.vec3),
    gap: wp.array(dtype=float),
):
    """As `collide`, of a part against the plane z = 0 of b's frame."""
    n = wp.vec3(0.0, 0.0, 1.0)
    low = extreme_placed(parts, a, x, q, -n, 0.0)
    gap_n = low[2] - a.rim
    kept = int(0)
    if gap_n <= margin:
        d = wp.quat_rotate_inv(q, -n)
        f, index = face_normal(parts, a, d)
        count = face_corners(parts, a, d, f, index, place)
        for k in range(count):
            p = x + wp.quat_rotate(q, place[k])
            if p[2] <= margin:
                place[kept] = p
                gap[kept] = p[2]
                kept = kept + 1
        kept = fewer(place, gap, kept, n)
    return n, gap_n, kept
