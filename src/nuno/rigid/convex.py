"""Convex parts of rigid bodies, and how far apart two of them are: GJK on rounded cores.

A part is a core and a radius: a sphere is a point and a radius, a capsule a segment and a radius. Boxes, cylinders
and convex meshes are seen twice: as they are, and as a core that is smaller all round by ``inset``, with the inset as
radius. The direction between two parts is taken between their cores, which stay apart while the parts press into each
other by a little; how far apart the parts are is then measured along that direction on the parts as they are.

Of two parts a stands at x, turned by q, in the frame of b; directions are in that frame, and normals look from b to a.

After Gilbert, Johnson, Keerthi 1988; closest points of simplices after Ericson, Real-Time Collision Detection, 2005.
"""

import warp as wp

SPHERE_PART, CAPSULE_PART, BOX_PART, CYLINDER_PART, HULL, TRIANGLE, FLAT, SURFACE, SHELL = range(9)
"""Sphere, capsule, box, cylinder, convex mesh, triangle, plane, closed mesh, open mesh."""

CORNERS = 24
"""Most corners of a polygon: two faces of `FACE` corners cut each other in so many."""
FACE = 12
"""Most corners of a face that are looked at; of a face with more, every so many."""

ITERATIONS = 32
"""Of GJK: boxes take 3 to 6, cylinders up to 20 for a direction to 1e-4."""


@wp.struct
class Parts:
    """The convex parts of all bodies, the same in every world; a part's frame lies anywhere in its body's."""

    count: int
    capacity: int
    mesh_stride: int
    slot: wp.array(dtype=int)  # the body, or -1
    rank: wp.array(dtype=int)  # by which ties are broken: rows depend on what came and went before, this does not
    kind: wp.array(dtype=int)
    half: wp.array(dtype=wp.vec3)  # box: half sides; others: radius, half height
    inset: wp.array(dtype=float)
    rim: wp.array(dtype=float)  # radius around the part as it is: ball, rod, half a shell's thickness
    place: wp.array(dtype=wp.vec3)
    turn: wp.array(dtype=wp.quat)
    low: wp.array(dtype=wp.vec3)  # bounds in the part's frame
    high: wp.array(dtype=wp.vec3)
    radius: wp.array(dtype=float)  # of a sphere around the middle of the bounds
    smallest: wp.array(dtype=float)  # smallest half side
    corners: wp.array(dtype=wp.vec2i)  # first and last of a hull's corners
    cores: wp.array(dtype=wp.vec2i)
    faces: wp.array(dtype=wp.vec2i)
    corner: wp.array(dtype=wp.vec3)
    core: wp.array(dtype=wp.vec3)
    normal: wp.array(dtype=wp.vec3)  # of faces
    loop_start: wp.array(dtype=int)
    loop: wp.array(dtype=int)
    mesh: wp.array(dtype=wp.uint64)
    edges: wp.array(dtype=wp.uint64)


@wp.struct
class Convex:
    """A part, or a triangle of a mesh, as the narrow phase holds it."""

    kind: int
    part: int
    half: wp.vec3
    inset: float
    rim: float
    a: wp.vec3
    b: wp.vec3
    c: wp.vec3


@wp.func
def convex_of(parts: Parts, p: int):
    """Part p."""
    c = Convex()
    c.kind = parts.kind[p]
    c.part = p
    c.half = parts.half[p]
    c.inset = parts.inset[p]
    c.rim = parts.rim[p]
    return c


@wp.func
def extreme(parts: Parts, c: Convex, d: wp.vec3, inset: float):
    """The corner farthest along d, of the part without its rim, smaller by ``inset`` (0 or the part's own)."""
    result = wp.vec3(0.0)
    if c.kind == BOX_PART:
        h = c.half - wp.vec3(inset)
        result = wp.vec3(
            wp.where(d[0] < 0.0, -h[0], h[0]), wp.where(d[1] < 0.0, -h[1], h[1]), wp.where(d[2] < 0.0, -h[2], h[2])
        )
    elif c.kind == CAPSULE_PART:
        result = wp.vec3(0.0, 0.0, wp.where(d[2] < 0.0, -c.half[1], c.half[1]))
    elif c.kind == CYLINDER_PART:
        across = wp.sqrt(d[0] * d[0] + d[1] * d[1])
        scale = float(0.0)
        if across > 1.0e-9:
            scale = (c.half[0] - inset) / across
        up = c.half[1] - inset
        result = wp.vec3(scale * d[0], scale * d[1], wp.where(d[2] < 0.0, -up, up))
    elif c.kind == TRIANGLE:
        da = wp.dot(d, c.a)
        db = wp.dot(d, c.b)
        dc = wp.dot(d, c.c)
        result = c.a
        if db > da and db >= dc:
            result = c.b
        elif dc > da and dc > db:
            result = c.c
    elif c.kind == HULL:
        most = float(-1.0e30)
        if inset > 0.0:
            span = parts.cores[c.part]
            for k in range(span[0], span[1]):
                along = wp.dot(d, parts.core[k])
                if along > most:
                    most = along
                    result = parts.core[k]
        else:
            span = parts.corners[c.part]
            for k in range(span[0], span[1]):
                along = wp.dot(d, parts.corner[k])
                if along > most:
                    most = along
                    result = parts.corner[k]
    return result


@wp.func
def extreme_placed(parts: Parts, c: Convex, x: wp.vec3, q: wp.quat, d: wp.vec3, inset: float):
    """`extreme` of a part that is placed at x, q."""
    return x + wp.quat_rotate(q, extreme(parts, c, wp.quat_rotate_inv(q, d), inset))


@wp.func
def gap_along(parts: Parts, a: Convex, x: wp.vec3, q: wp.quat, b: Convex, n: wp.vec3):
    """Return how far apart the parts are along the unit direction n from b to a: never more than their distance."""
    pa = extreme_placed(parts, a, x, q, -n, 0.0)
    pb = extreme(parts, b, n, 0.0)
    return wp.dot(n, pa - pb) - a.rim - b.rim


@wp.func
def nearest_on_segment(a: wp.vec3, b: wp.vec3):
    """Weights of a and b in their segment's point nearest to the origin."""
    ab = b - a
    t = wp.clamp(-wp.dot(a, ab) / wp.max(wp.dot(ab, ab), 1.0e-30), 0.0, 1.0)
    return wp.vec4(1.0 - t, t, 0.0, 0.0)


@wp.func
def nearest_on_triangle(a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Weights of a, b and c in their triangle's point nearest to the origin."""
    ab = b - a
    ac = c - a
    d1 = -wp.dot(ab, a)
    d2 = -wp.dot(ac, a)
    d3 = -wp.dot(ab, b)
    d4 = -wp.dot(ac, b)
    d5 = -wp.dot(ab, c)
    d6 = -wp.dot(ac, c)
    vc = d1 * d4 - d3 * d2
    vb = d5 * d2 - d1 * d6
    va = d3 * d6 - d5 * d4
    result = wp.vec4(0.0)
    if d1 <= 0.0 and d2 <= 0.0:
        result = wp.vec4(1.0, 0.0, 0.0, 0.0)
    elif d3 >= 0.0 and d4 <= d3:
        result = wp.vec4(0.0, 1.0, 0.0, 0.0)
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / wp.max(d1 - d3, 1.0e-30)
        result = wp.vec4(1.0 - t, t, 0.0, 0.0)
    elif d6 >= 0.0 and d5 <= d6:
        result = wp.vec4(0.0, 0.0, 1.0, 0.0)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / wp.max(d2 - d6, 1.0e-30)
        result = wp.vec4(1.0 - t, 0.0, t, 0.0)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / wp.max((d4 - d3) + (d5 - d6), 1.0e-30)
        result = wp.vec4(0.0, 1.0 - t, t, 0.0)
    else:
        scale = 1.0 / wp.max(va + vb + vc, 1.0e-30)
        result = wp.vec4(va * scale, vb * scale, vc * scale, 0.0)
    return result


@wp.func
def nearest_on_tetrahedron(a: wp.vec3, b: wp.vec3, c: wp.vec3, d: wp.vec3):
    """Weights of the corners in the tetrahedron's point nearest to the origin; all 0 where the origin is inside."""
    result = wp.vec4(0.0)
    best = float(1.0e30)
    for k in range(4):
        # the face opposite of corner k
        first = wp.where(k == 0, b, a)
        second = wp.where(k < 2, c, b)
        third = wp.where(k < 3, d, c)
        corner = a
        if k == 1:
            corner = b
        elif k == 2:
            corner = c
        elif k == 3:
            corner = d
        normal = wp.cross(second - first, third - first)
        # only a face that has the origin on its other side may have the nearest point
        if wp.dot(normal, corner - first) * wp.dot(normal, -first) <= 0.0:
            u = nearest_on_triangle(first, second, third)
            near = wp.length_sq(u[0] * first + u[1] * second + u[2] * third)
            if near < best:
                best = near
                if k == 0:
                    result = wp.vec4(0.0, u[0], u[1], u[2])
                elif k == 1:
                    result = wp.vec4(u[0], 0.0, u[1], u[2])
                elif k == 2:
                    result = wp.vec4(u[0], u[1], 0.0, u[2])
                else:
                    result = wp.vec4(u[0], u[1], u[2], 0.0)
    return result


@wp.func
def core_direction(parts: Parts, a: Convex, x: wp.vec3, q: wp.quat, b: Convex):
    """From b's core to a's: the unit direction between their nearest points, and 1, or 0 where the cores meet."""
    v = x
    if wp.length_sq(v) < 1.0e-16:
        v = wp.vec3(0.0, 0.0, 1.0e-4)
    s = wp.matrix(shape=(4, 3), dtype=float)
    count = int(0)
    apart = float(1.0)
    iterations = int(0)
    # below this the cores touch, as far as floats of this size tell
    small = 1.0e-12 * (1.0 + wp.length_sq(x))
    while iterations < ITERATIONS:
        iterations = iterations + 1
        p = extreme_placed(parts, a, x, q, -v, a.inset) - extreme(parts, b, v, b.inset)
        size = wp.dot(v, v)
        known = int(0)
        for k in range(count):
            if s[k, 0] == p[0] and s[k, 1] == p[1] and s[k, 2] == p[2]:
                known = 1
        if count > 0 and (known == 1 or size - wp.dot(v, p) <= 1.0e-5 * size):
            break
        for axis in range(3):
            s[count, axis] = p[axis]
        count = count + 1
        weights = wp.vec4(1.0, 0.0, 0.0, 0.0)
        s0 = wp.vec3(s[0, 0], s[0, 1], s[0, 2])
        s1 = wp.vec3(s[1, 0], s[1, 1], s[1, 2])
        s2 = wp.vec3(s[2, 0], s[2, 1], s[2, 2])
        s3 = wp.vec3(s[3, 0], s[3, 1], s[3, 2])
        if count == 2:
            weights = nearest_on_segment(s0, s1)
        elif count == 3:
            weights = nearest_on_triangle(s0, s1, s2)
        elif count == 4:
            weights = nearest_on_tetrahedron(s0, s1, s2, s3)
            if wp.length_sq(weights) == 0.0:
                apart = 0.0
                break
        nearest = weights[0] * s0
        kept = int(0)
        if weights[0] > 0.0:
            kept = 1
        for k in range(1, count):
            if weights[k] > 0.0:
                row = wp.vec3(s[k, 0], s[k, 1], s[k, 2])
                nearest = nearest + weights[k] * row
                for axis in range(3):
                    s[kept, axis] = row[axis]
                kept = kept + 1
        count = kept
        now = wp.length_sq(nearest)
        if now <= small:
            apart = 0.0
            break
        if iterations > 1 and now >= size:
            break
        v = nearest
    n = wp.normalize(v)
    return wp.vec4(n[0], n[1], n[2], apart)


@wp.func
def face_normal(parts: Parts, c: Convex, d: wp.vec3):
    """The outward normal of the face that looks most along d, and the face's index (hull) or kind (cylinder)."""
    n = d
    index = int(0)
    if c.kind == BOX_PART:
        size = wp.vec3(wp.abs(d[0]), wp.abs(d[1]), wp.abs(d[2]))
        if size[0] > size[1] and size[0] > size[2]:
            n = wp.vec3(wp.sign(d[0]), 0.0, 0.0)
            index = 0
        elif size[1] > size[2]:
            n = wp.vec3(0.0, wp.sign(d[1]), 0.0)
            index = 1
        else:
            n = wp.vec3(0.0, 0.0, wp.sign(d[2]))
            index = 2
    elif c.kind == CYLINDER_PART:
        across = wp.sqrt(d[0] * d[0] + d[1] * d[1])
        if across > wp.abs(d[2]):
            n = wp.vec3(d[0] / across, d[1] / across, 0.0)
            index = 1
        else:
            n = wp.vec3(0.0, 0.0, wp.sign(d[2]))
    elif c.kind == CAPSULE_PART:
        across = wp.sqrt(d[0] * d[0] + d[1] * d[1])
        if across > 0.3:
            n = wp.vec3(d[0] / across, d[1] / across, 0.0)
            index = 1
    elif c.kind == TRIANGLE:
        n = wp.normalize(wp.cross(c.b - c.a, c.c - c.a))
        if wp.dot(n, d) < 0.0:
            n = -n
    elif c.kind == HULL:
        span = parts.faces[c.part]
        most = float(-2.0)
        for k in range(span[0], span[1]):
            along = wp.dot(d, parts.normal[k])
            if along > most:
                most = along
                index = k
        n = parts.normal[index]
    return n, index


@wp.func
def face_corners(parts: Parts, c: Convex, d: wp.vec3, n: wp.vec3, index: int, out: wp.array(dtype=wp.vec3)):
    """The corners of the face with normal n and index, in a round, on the part's surface towards d; their number.

    A side of a cylinder or capsule is a segment, a ball or the end of a capsule a point.
    """
    count = int(1)
    if c.kind == BOX_PART:
        h = c.half
        u = wp.vec3(0.0, h[1], 0.0)
        v = wp.vec3(0.0, 0.0, h[2])
        if index == 1:
            u = wp.vec3(h[0], 0.0, 0.0)
        elif index == 2:
            u = wp.vec3(h[0], 0.0, 0.0)
            v = wp.vec3(0.0, h[1], 0.0)
        m = wp.cw_mul(n, h)
        out[0] = m + u + v
        out[1] = m - u + v
        out[2] = m - u - v
        out[3] = m + u - v
        count = 4
    elif c.kind == CYLINDER_PART:
        if index == 1:
            out[0] = wp.vec3(n[0] * c.half[0], n[1] * c.half[0], c.half[1])
            out[1] = wp.vec3(n[0] * c.half[0], n[1] * c.half[0], -c.half[1])
            count = 2
        else:
            # the first corner where the cap reaches farthest along d
            across = wp.sqrt(d[0] * d[0] + d[1] * d[1])
            first = float(0.0)
            if across > 1.0e-6:
                first = wp.atan2(d[1], d[0])
            count = FACE
            for k in range(count):
                angle = first + float(k) * (6.2831853 / float(FACE))
                out[k] = wp.vec3(c.half[0] * wp.cos(angle), c.half[0] * wp.sin(angle), n[2] * c.half[1])
    elif c.kind == CAPSULE_PART and index == 1:
        out[0] = wp.vec3(0.0, 0.0, c.half[1]) + c.rim * d
        out[1] = wp.vec3(0.0, 0.0, -c.half[1]) + c.rim * d
        count = 2
    elif c.kind == TRIANGLE:
        out[0] = c.a + c.rim * d
        out[1] = c.b + c.rim * d
        out[2] = c.c + c.rim * d
        count = 3
    elif c.kind == HULL:
        start = parts.loop_start[index]
        size = parts.loop_start[index + 1] - start
        count = wp.min(size, FACE)
        for k in range(count):
            out[k] = parts.corner[parts.loop[start + (k * size) / count]]
    else:
        out[0] = extreme(parts, c, d, 0.0) + c.rim * d
    return count
