"""Convex parts against triangle meshes: each triangle near by is a convex part of its own.

What the triangles give is gathered into manifolds by normal. On an edge that is flat or a valley the normal is the
triangle's: what slides over a floor of triangles does not catch on the seams.
"""

import warp as wp

from nuno.rigid.convex import SURFACE, TRIANGLE, Convex, Parts, core_direction, extreme_placed, gap_along
from nuno.rigid.manifold import SNAP, fewer, lay_over
from nuno.rigid.persistent_manifolds import Contacts, take_points
from nuno.rigid.rigid_body import RigidState

PATCHES = 6
"""Manifolds of a pair with a mesh: normals that it can tell apart."""
HELD = 8
"""Points of a normal that are held before four are chosen."""
ALIKE = wp.constant(0.996)
"""Cosine of 5 degrees: points with normals as near as this share a manifold."""


@wp.func
def ridges_of(parts: Parts, q: int, world: int, face: int):
    """Bits of a face's edges (ab, bc, ca) that stick out."""
    address = parts.edges[world * parts.mesh_stride + q]
    ridge = wp.array(ptr=address + wp.uint64(face) * wp.uint64(4), shape=(1,), dtype=int)
    return ridge[0]


@wp.func
def on_ridge(c: Convex, n: wp.vec3, ridges: int):
    """Return True if what the triangle holds out along n, a corner or an edge, sticks out of the mesh."""
    da = wp.dot(n, c.a)
    db = wp.dot(n, c.b)
    dc = wp.dot(n, c.c)
    most = wp.max(da, wp.max(db, dc))
    size = wp.max(wp.length(c.b - c.a), wp.length(c.c - c.a))
    level = most - 1.0e-3 * size
    found = int(0)
    if da >= level and db >= level:
        found = ridges & 1
    elif db >= level and dc >= level:
        found = ridges & 2
    elif dc >= level and da >= level:
        found = ridges & 4
    elif da >= level:
        found = ridges & 5
    elif db >= level:
        found = ridges & 3
    else:
        found = ridges & 6
    return found != 0


@wp.func
def normal_of_face(parts: Parts, a: Convex, x: wp.vec3, q: wp.quat, c: Convex, solid: int, ridges: int):
    """The direction between a part and a face, and 1, or 0 where a solid's face is looked at from behind."""
    flat = wp.normalize(wp.cross(c.b - c.a, c.c - c.a))
    found = core_direction(parts, a, x, q, c)
    n = wp.vec3(found[0], found[1], found[2])
    good = float(1.0)
    if found[3] == 0.0:
        n = flat
    facing = wp.dot(n, flat)
    if facing > SNAP:
        n = flat
    elif facing <= 0.0:
        # from behind a solid; of a sheet, flat looks to the part's middle, and an edge may be met from there
        if solid == 1:
            good = 0.0
    elif not on_ridge(c, n, ridges):
        n = flat
    return wp.vec4(n[0], n[1], n[2], good)


@wp.func
def hold(
    normals: wp.array(dtype=wp.vec3),
    counts: wp.array(dtype=int),
    held: wp.array(dtype=wp.vec3),
    gaps: wp.array(dtype=float),
    found: int,
    n: wp.vec3,
    point: wp.vec3,
    gap: float,
    same: float,
    room: wp.array(dtype=wp.vec3),
    depth: wp.array(dtype=float),
):
    """Add a point to the manifold with its normal; the number of manifolds. ``room`` and ``depth`` are to work in."""
    best = float(-2.0)
    m = int(-1)
    for k in range(found):
        alike = wp.dot(normals[k], n)
        if alike > best:
            best = alike
            m = k
    now = int(found)
    if best < ALIKE and found < PATCHES:
        m = found
        now = found + 1
        normals[m] = n
        counts[m] = 0
    count = counts[m]
    first = m * HELD
    twice = int(0)
    for k in range(count):
        if wp.length_sq(held[first + k] - point) < same * same:
            twice = 1
            if gap < gaps[first + k]:
                held[first + k] = point
                gaps[first + k] = gap
    if twice == 0:
        if count == HELD:
            for k in range(count):
                room[k] = held[first + k]
                depth[k] = gaps[first + k]
            count = fewer(room, depth, count, normals[m])
            for k in range(count):
                held[first + k] = room[k]
                gaps[first + k] = depth[k]
        held[first + count] = point
        gaps[first + count] = gap
        counts[m] = count + 1
    return now


@wp.func
def bounds_of(parts: Parts, a: Convex, x: wp.vec3, q: wp.quat, reach: float):
    """The corners of a part's box along the axes of the mesh's frame, larger all round by ``reach``."""
    ex = wp.vec3(1.0, 0.0, 0.0)
    ey = wp.vec3(0.0, 1.0, 0.0)
    ez = wp.vec3(0.0, 0.0, 1.0)
    low = wp.vec3(
        extreme_placed(parts, a, x, q, -ex, 0.0)[0],
        extreme_placed(parts, a, x, q, -ey, 0.0)[1],
        extreme_placed(parts, a, x, q, -ez, 0.0)[2],
    )
    high = wp.vec3(
        extreme_placed(parts, a, x, q, ex, 0.0)[0],
        extreme_placed(parts, a, x, q, ey, 0.0)[1],
        extreme_placed(parts, a, x, q, ez, 0.0)[2],
    )
    grow = wp.vec3(a.rim + reach)
    return low - grow, high + grow


@wp.func
def collide_mesh(
    s: RigidState,
    parts: Parts,
    c: Contacts,
    world: int,
    e: int,
    p: int,
    i: int,
    j: int,
    part: Convex,
    x: wp.vec3,
    q: wp.quat,
    margin: float,
    moved: float,
    place: wp.array(dtype=wp.vec3),
    gap: wp.array(dtype=float),
):
    """All manifolds of a part with a mesh: the entry e and the others of its row with the same partner."""
    normals = wp.zeros(shape=(6,), dtype=wp.vec3)
    counts = wp.zeros(shape=(6,), dtype=int)
    held = wp.zeros(shape=(48,), dtype=wp.vec3)
    gaps = wp.zeros(shape=(48,), dtype=float)
    room = wp.zeros(shape=(8,), dtype=wp.vec3)
    depth = wp.zeros(shape=(8,), dtype=float)
    b = c.partner[e]
    solid = wp.where(parts.kind[b] == SURFACE, 1, 0)
    mesh = parts.mesh[world * parts.mesh_stride + b]
    same = 0.1 * parts.smallest[p]
    low, high = bounds_of(parts, part, x, q, margin + parts.rim[b])
    found = int(0)
    face = int(0)
    query = wp.mesh_query_aabb(mesh, low, high)
    while wp.mesh_query_aabb_next(query, face):
        t = Convex()
        t.kind = TRIANGLE
        t.rim = parts.rim[b]
        t.a = wp.mesh_eval_position(mesh, face, 1.0, 0.0)
        t.b = wp.mesh_eval_position(mesh, face, 0.0, 1.0)
        t.c = wp.mesh_eval_position(mesh, face, 0.0, 0.0)
        ridges = ridges_of(parts, b, world, face)
        flat = wp.cross(t.b - t.a, t.c - t.a)
        if solid == 0 and wp.dot(flat, x - t.a) < 0.0:
            # a sheet is met on the side where the part's middle is
            other = t.b
            t.b = t.c
            t.c = other
            ridges = ((ridges & 1) << 2) | (ridges & 2) | ((ridges & 4) >> 2)
        if wp.length_sq(flat) > 1.0e-20:
            d = normal_of_face(parts, part, x, q, t, solid, ridges)
            if d[3] > 0.0:
                n = wp.vec3(d[0], d[1], d[2])
                least = gap_along(parts, part, x, q, t, n)
                if least <= margin:
                    count = lay_over(parts, part, x, q, t, n, least, margin, place, gap)
                    for k in range(count):
                        found = hold(normals, counts, held, gaps, found, n, place[k], gap[k], same, room, depth)
    first = (e / c.row) * c.row
    c.clear[e] = wp.where(found > 0, 0.0, margin)
    for k in range(c.row):
        entry = first + k
        if c.partner[entry] == b:
            m = c.patch[entry]
            count = int(0)
            n = wp.vec3(0.0, 0.0, 1.0)
            if m < found:
                n = normals[m]
                count = counts[m]
                for h in range(count):
                    place[h] = held[m * HELD + h]
                    gap[h] = gaps[m * HELD + h]
                count = fewer(place, gap, count, n)
            if count > 0 or c.count[entry] > 0:
                take_points(s, parts, c, entry, p, i, j, n, count, moved, place, gap)
