"""Broad phase of coupled bodies: rows of candidate pairs of elements, made anew when anything may have gone too far.

Lists hold all that is nearer than the contact distance and a margin. By one thread they come in an order that the
elements alone decide. Each island of bodies has a margin and lists when it must by itself: what goes on in other worlds
of a batch, or elsewhere in the same one, changes none of its rows.
"""

import warp as wp

from nuno.coupled.bounded_particles import Particles
from nuno.coupled.contact_rows import EDGE_EDGE, EDGE_RIGID, TRIANGLE_RIGID, VERTEX_RIGID, VERTEX_TRIANGLE, Rows
from nuno.rigid.rigid_body import RigidState, point_of


@wp.struct
class Elements:
    """Surfaces of all coupled bodies, the same in every world; bodies are numbered, particles' before rigid ones."""

    bodies: int
    vertices: int
    triangles: int
    edges: int
    parts: int
    points: int
    ridges: int
    vertex: wp.array(dtype=int)
    vertex_body: wp.array(dtype=int)
    triangle: wp.array(dtype=wp.vec3i)
    triangle_body: wp.array(dtype=int)
    triangle_edges: wp.array(dtype=wp.vec3i)  # of each triangle, those that are listed with it; else -1
    edge: wp.array(dtype=wp.vec2i)
    edge_body: wp.array(dtype=int)
    # parts of rigid bodies: convex shapes, each with a place in its body's frame
    part_slot: wp.array(dtype=int)
    part_body: wp.array(dtype=int)
    part_kind: wp.array(dtype=int)
    part_size: wp.array(dtype=wp.vec3)
    part_place: wp.array(dtype=wp.vec3)
    part_rotation: wp.array(dtype=wp.quat)
    part_radius: wp.array(dtype=float)
    part_mesh: wp.array(dtype=wp.uint64)
    # corners of rigid bodies, and the middles of what is round with its radius, in their bodies' frames
    point: wp.array(dtype=wp.vec3)
    point_radius: wp.array(dtype=float)
    point_slot: wp.array(dtype=int)
    point_body: wp.array(dtype=int)
    # sharp edges of rigid bodies, and the axes of what is round with its radius, in their bodies' frames
    ridge_start: wp.array(dtype=wp.vec3)
    ridge_end: wp.array(dtype=wp.vec3)
    ridge_left: wp.array(dtype=wp.vec3)  # the outward normals of the faces beside it; zero: round
    ridge_right: wp.array(dtype=wp.vec3)
    ridge_radius: wp.array(dtype=float)
    ridge_depth: wp.array(dtype=float)  # what is deeper behind it than this has come in elsewhere [m]
    ridge_slot: wp.array(dtype=int)
    ridge_body: wp.array(dtype=int)
    # tables by world and pair of bodies, and by world and body
    touch: wp.array(dtype=int)
    friction: wp.array(dtype=float)
    radius: wp.array(dtype=float)
    compliance: wp.array(dtype=float)  # how far a contact presses a cloth together [m/N]
    island: wp.array(dtype=int)  # in each world, the first body of those that go together
    reach: wp.array(dtype=float)  # in each world, what bounds how far a body's contacts come in a substep [m]
    far: wp.array(dtype=float)  # in each world, up to where a body's rows are listed now [m]; negative: they stay
    solid: wp.array(dtype=int)  # by body, whether its triangles enclose it
    # by particle, where the sorted numbers start of those near it within its own body, if that touches itself
    near_start: wp.array(dtype=int)
    near: wp.array(dtype=int)
    low: wp.array(dtype=wp.vec3)
    high: wp.array(dtype=wp.vec3)


@wp.func
def place(particles: Particles, i: int):
    """Return where a particle is now."""
    return particles.p[i] + particles.u[i]


@wp.kernel(enable_backward=False, module="nuno.coupled.contact_candidates")
def bound_triangles(particles: Particles, elements: Elements):
    """Boxes of all triangles."""
    world, k = wp.tid()
    f = elements.triangle[k]
    first = world * particles.count
    a = place(particles, first + f[0])
    b = place(particles, first + f[1])
    c = place(particles, first + f[2])
    i = world * elements.triangles + k
    elements.low[i] = wp.min(a, wp.min(b, c))
    elements.high[i] = wp.max(a, wp.max(b, c))


@wp.func
def add_row(
    rows: Rows, world: int, kind: int, corners: wp.vec4i, slot: int, part: int, bodies: wp.vec2i, point: wp.vec3
):
    """Note a candidate; what does not fit is counted but not kept."""
    k = wp.atomic_add(rows.count, world, 1)
    if k < rows.room:
        r = world * rows.room + k
        rows.kind[r] = kind
        rows.corners[r] = corners
        rows.slot[r] = slot
        rows.part[r] = part
        rows.bodies[r] = bodies
        rows.point[r] = point


@wp.kernel(enable_backward=False, module="nuno.coupled.contact_candidates")
def keep_rows(elements: Elements, rows: Rows):
    """Of each world's rows, leave those of bodies that are not listed now, in their order."""
    world = wp.tid()
    base = world * rows.room
    kept = int(0)
    for k in range(rows.count[world]):
        r = base + k
        if elements.far[world * elements.bodies + rows.bodies[r][0]] < 0.0:
            to = base + kept
            rows.kind[to] = rows.kind[r]
            rows.corners[to] = rows.corners[r]
            rows.slot[to] = rows.slot[r]
            rows.part[to] = rows.part[r]
            rows.bodies[to] = rows.bodies[r]
            rows.point[to] = rows.point[r]
            kept = kept + 1
    rows.count[world] = kept


@wp.func
def sort_rows(rows: Rows, world: int, start: int):
    """Bring rows of one element against others into those others' order; few, so by insertion."""
    base = world * rows.room
    last = wp.min(rows.count[world], rows.room)
    for a in range(start + 1, last):
        b = int(a)
        while b > start and later(rows.corners[base + b - 1], rows.corners[base + b]):
            swapped = rows.corners[base + b]
            rows.corners[base + b] = rows.corners[base + b - 1]
            rows.corners[base + b - 1] = swapped
            bodies = rows.bodies[base + b]
            rows.bodies[base + b] = rows.bodies[base + b - 1]
            rows.bodies[base + b - 1] = bodies
            b = b - 1


@wp.func
def later(a: wp.vec4i, b: wp.vec4i):
    """Return True if one row's corners come after another's."""
    for k in range(4):
        if a[k] != b[k]:
            return a[k] > b[k]
    return False


@wp.func
def may_touch(elements: Elements, world: int, a: int, b: int):
    """Return True if two bodies touch at all, and go together in this world."""
    together = elements.island[world * elements.bodies + a] == elements.island[world * elements.bodies + b]
    return together and elements.touch[a * elements.bodies + b] != 0


@wp.func
def body_radius(elements: Elements, world: int, body: int):
    """Half the thickness of a body, whose surfaces are in the middle of it."""
    return elements.radius[world * elements.bodies + body]


@wp.func
def near_triangle(particles: Particles, first: int, x: wp.vec3, f: wp.vec3i, far: float):
    """Return True if a point may be nearer than ``far`` to a triangle: to its plane, and to the ball around it."""
    a = place(particles, first + f[0])
    b = place(particles, first + f[1])
    c = place(particles, first + f[2])
    middle = (a + b + c) / 3.0
    size = wp.max(wp.length(a - middle), wp.max(wp.length(b - middle), wp.length(c - middle)))
    n = wp.cross(b - a, c - a)
    height = wp.dot(x - a, n)
    return height * height <= far * far * wp.dot(n, n) and wp.length(x - middle) <= far + size


@wp.func
def is_near(elements: Elements, i: int, j: int):
    """Return True if particle j is one of those near particle i within their body."""
    low = int(elements.near_start[i])
    high = int(elements.near_start[i + 1])
    end = int(high)
    while low < high:
        middle = (low + high) / 2
        if elements.near[middle] < j:
            low = middle + 1
        else:
            high = middle
    found = bool(False)
    if low < end:
        found = elements.near[low] == j
    return found


@wp.func
def list_vertex(
    particles: Particles, elements: Elements, rows: Rows, bvh: wp.uint64, root: int, world: int, k: int, far: float
):
    """Triangles near vertex k, of other bodies or of other parts of its own."""
    i = elements.vertex[k]
    body = elements.vertex_body[k]
    x = place(particles, world * particles.count + i)
    reach = wp.vec3(far, far, far)
    query = wp.bvh_query_aabb(bvh, x - reach, x + reach, root)
    hit = int(0)
    while wp.bvh_query_next(query, hit):
        t = hit - world * elements.triangles
        other = elements.triangle_body[t]
        if may_touch(elements, world, body, other):
            f = elements.triangle[t]
            joined = bool(False)
            if other == body:
                joined = is_near(elements, i, f[0]) or is_near(elements, i, f[1]) or is_near(elements, i, f[2])
            if not joined:
                corners = wp.vec4i(i, f[0], f[1], f[2])
                add_row(rows, world, VERTEX_TRIANGLE, corners, -1, -1, wp.vec2i(body, other), wp.vec3())


@wp.func
def list_edge(
    particles: Particles, elements: Elements, rows: Rows, bvh: wp.uint64, root: int, world: int, k: int, far: float
):
    """Edges near edge k, of later bodies or of other parts of its own."""
    e = elements.edge[k]
    body = elements.edge_body[k]
    first = world * particles.count
    a = place(particles, first + e[0])
    b = place(particles, first + e[1])
    reach = wp.vec3(far, far, far)
    query = wp.bvh_query_aabb(bvh, wp.min(a, b) - reach, wp.max(a, b) + reach, root)
    hit = int(0)
    while wp.bvh_query_next(query, hit):
        t = hit - world * elements.triangles
        other = elements.triangle_body[t]
        if other >= body and may_touch(elements, world, body, other):
            edges = elements.triangle_edges[t]
            for c in range(3):
                f = elements.edge[wp.max(edges[c], 0)]
                joined = edges[c] < 0
                if other == body and not joined:
                    # each pair once
                    joined = edges[c] <= k or is_near(elements, e[0], f[0]) or is_near(elements, e[0], f[1])
                    joined = joined or is_near(elements, e[1], f[0]) or is_near(elements, e[1], f[1])
                if not joined:
                    c0 = place(particles, first + f[0])
                    s = wp.closest_point_edge_edge(a, b, c0, place(particles, first + f[1]), 1.0e-9)
                    if s[2] < far:
                        corners = wp.vec4i(e[0], e[1], f[0], f[1])
                        add_row(rows, world, EDGE_EDGE, corners, -1, -1, wp.vec2i(body, other), wp.vec3())


@wp.func
def list_parts(
    particles: Particles, rigid: RigidState, elements: Elements, rows: Rows, world: int, k: int,
    far: float,
):  # fmt: skip
    """Parts of rigid bodies near vertex k."""
    i = elements.vertex[k]
    body = elements.vertex_body[k]
    x = place(particles, world * particles.count + i)
    for part in range(elements.parts):
        other = elements.part_body[part]
        if may_touch(elements, world, body, other):
            slot = elements.part_slot[part]
            centre = point_of(rigid, world * rigid.capacity + slot, elements.part_place[part])
            if wp.length(x - centre) < far + elements.part_radius[part]:
                corners = wp.vec4i(i, -1, -1, -1)
                add_row(rows, world, VERTEX_RIGID, corners, slot, part, wp.vec2i(body, other), wp.vec3())


@wp.func
def list_point(
    particles: Particles, rigid: RigidState, elements: Elements, rows: Rows, bvh: wp.uint64, root: int,
    world: int, k: int, far: float,
):  # fmt: skip
    """Triangles near corner k of a rigid body, or near what is round about it."""
    slot = elements.point_slot[k]
    body = elements.point_body[k]
    x = point_of(rigid, world * rigid.capacity + slot, elements.point[k])
    around = far + elements.point_radius[k]
    reach = wp.vec3(around, around, around)
    query = wp.bvh_query_aabb(bvh, x - reach, x + reach, root)
    hit = int(0)
    while wp.bvh_query_next(query, hit):
        t = hit - world * elements.triangles
        other = elements.triangle_body[t]
        if may_touch(elements, world, body, other):
            f = elements.triangle[t]
            if near_triangle(particles, world * particles.count, x, f, around):
                corners = wp.vec4i(f[0], f[1], f[2], -1)
                add_row(rows, world, TRIANGLE_RIGID, corners, slot, k, wp.vec2i(other, body), elements.point[k])


@wp.func
def list_ridge(
    particles: Particles, rigid: RigidState, elements: Elements, rows: Rows, bvh: wp.uint64, root: int,
    world: int, k: int, far: float,
):  # fmt: skip
    """Edges near sharp edge k of a rigid body, or near what is round about its axis."""
    slot = elements.ridge_slot[k]
    body = elements.ridge_body[k]
    i = world * rigid.capacity + slot
    first = world * particles.count
    a = point_of(rigid, i, elements.ridge_start[k])
    b = point_of(rigid, i, elements.ridge_end[k])
    around = far + elements.ridge_radius[k]
    reach = wp.vec3(around, around, around)
    query = wp.bvh_query_aabb(bvh, wp.min(a, b) - reach, wp.max(a, b) + reach, root)
    hit = int(0)
    while wp.bvh_query_next(query, hit):
        t = hit - world * elements.triangles
        other = elements.triangle_body[t]
        if may_touch(elements, world, body, other):
            edges = elements.triangle_edges[t]
            for c in range(3):
                if edges[c] >= 0:
                    f = elements.edge[edges[c]]
                    c0 = place(particles, first + f[0])
                    s = wp.closest_point_edge_edge(a, b, c0, place(particles, first + f[1]), 1.0e-9)
                    if s[2] < around:
                        corners = wp.vec4i(f[0], f[1], -1, -1)
                        add_row(rows, world, EDGE_RIGID, corners, slot, k, wp.vec2i(other, body), wp.vec3())


@wp.kernel(enable_backward=False, module="nuno.coupled.contact_candidates")
def list_rows(
    particles: Particles, rigid: RigidState, elements: Elements, rows: Rows, bvh: wp.uint64, size: int,
):  # fmt: skip
    """List all pairs nearer than their bodies' ``far``, the contact distance included."""
    tid = wp.tid()
    world = tid / size
    rank = tid % size
    of = world * elements.bodies
    root = int(-1)
    if elements.triangles > 0:
        root = wp.bvh_get_group_root(bvh, world)
    for k in range(rank, elements.vertices, size):
        far = elements.far[of + elements.vertex_body[k]]
        if far >= 0.0:
            if elements.triangles > 0:
                start = rows.count[world]
                list_vertex(particles, elements, rows, bvh, root, world, k, far)
                if size == 1:
                    sort_rows(rows, world, start)
            list_parts(particles, rigid, elements, rows, world, k, far)
    if elements.triangles > 0:
        for k in range(rank, elements.edges, size):
            far = elements.far[of + elements.edge_body[k]]
            if far >= 0.0:
                start = rows.count[world]
                list_edge(particles, elements, rows, bvh, root, world, k, far)
                if size == 1:
                    sort_rows(rows, world, start)
        for k in range(rank, elements.points, size):
            far = elements.far[of + elements.point_body[k]]
            if far >= 0.0:
                start = rows.count[world]
                list_point(particles, rigid, elements, rows, bvh, root, world, k, far)
                if size == 1:
                    sort_rows(rows, world, start)
        for k in range(rank, elements.ridges, size):
            far = elements.far[of + elements.ridge_body[k]]
            if far >= 0.0:
                start = rows.count[world]
                list_ridge(particles, rigid, elements, rows, bvh, root, world, k, far)
                if size == 1:
                    sort_rows(rows, world, start)
