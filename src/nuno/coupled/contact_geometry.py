"""Contact geometry of coupled bodies: weights, normal and distance of each candidate row for one substep.

All is taken where the substep began, when nothing crossed: that tells the side, and of a face of a solid body the
outside is known. Only a vertex that comes in under an edge in the substep has the normal of the face that it comes to.
A row whose parts are too close already asks for what they have and a little more, so that they part slowly.
"""

import warp as wp

from nuno.contact.particle.distances import (
    BOX,
    CAPSULE,
    CYLINDER,
    SPHERE,
    distance_box,
    distance_cylinder,
    distance_round,
)
from nuno.contact.self.narrow_phase import closest_on_edges
from nuno.coupled.bounded_particles import Particles
from nuno.coupled.contact_candidates import Elements, body_radius
from nuno.coupled.contact_rows import EDGE_EDGE, EDGE_RIGID, LEAVE_SPEED, VERTEX_RIGID, VERTEX_TRIANGLE, Rows
from nuno.rigid.rigid_body import RigidState, point_before

SQUEEZE = wp.constant(0.05)
"""Share of the distance by which a cloth is pressed together at most; beyond that it is hard, and nothing comes in."""
RIM_SHARE = wp.constant(0.5)
"""Of the contact distance, what an edge keeps of a rigid body's sharp edge. Straight cells of a cloth that is bent, or
pressed between two bodies, come nearer to rims than the cloth that they stand for: with all of the distance, the rims
of fingers bear what their faces should."""
SLANT = wp.constant(0.05)
"""Sine of the angle between two edges from which on they cross; less, and their ends touch, not they. By as much a
normal may lean out of those between the two faces at a sharp edge: an edge that lies on a face leaves it in between."""
LEANS = wp.constant(0.999)
"""Cosine of the angle between two normals from which on they are taken as one, which keeps its bits."""


@wp.func
def over_triangle(x: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3):
    """Height of a point over a triangle's plane, the plane's normal, and the point's barycentric coordinates there."""
    e = b - a
    f = c - a
    r = x - a
    n = wp.cross(e, f)
    nn = wp.dot(n, n) + 1.0e-20
    v = wp.dot(wp.cross(r, f), n) / nn
    w = wp.dot(wp.cross(e, r), n) / nn
    length = wp.sqrt(nn)
    return wp.dot(r, n) / length, n / length, wp.vec3(1.0 - v - w, v, w)


@wp.func
def part_distance(elements: Elements, part: int, x: wp.vec3):
    """Signed distance from a rigid body's part, and its normal, of a point in the body's frame."""
    local = wp.quat_rotate_inv(elements.part_rotation[part], x - elements.part_place[part])
    size = elements.part_size[part]
    kind = elements.part_kind[part]
    gap = float(1.0e6)
    nx = float(0.0)
    ny = float(0.0)
    nz = float(1.0)
    if kind == BOX:
        gap, nx, ny, nz = distance_box(local[0], local[1], local[2], size[0], size[1], size[2])
    elif kind == CYLINDER:
        gap, nx, ny, nz = distance_cylinder(local[0], local[1], local[2], size[0], size[1])
    elif kind == SPHERE or kind == CAPSULE:
        gap, nx, ny, nz = distance_round(local[0], local[1], local[2], size[0], size[1])
    else:
        mesh = elements.part_mesh[part]
        query = wp.mesh_query_point_sign_normal(mesh, local, 2.0 * elements.part_radius[part])
        if query.result:
            offset = local - wp.mesh_eval_position(mesh, query.face, query.u, query.v)
            normal = wp.mesh_eval_face_normal(mesh, query.face)
            gap = wp.length(offset) * query.sign
            if wp.abs(gap) > 1.0e-7:
                normal = offset / gap
            nx = normal[0]
            ny = normal[1]
            nz = normal[2]
    return gap, wp.quat_rotate(elements.part_rotation[part], wp.vec3(nx, ny, nz))


@wp.func
def on_its_way(elements: Elements, part: int, x: wp.vec3, go: wp.vec3, gap: float, n: wp.vec3, point: wp.vec3,
               apart: float, dt: float):  # fmt: skip
    """The distance of a point outside of a box or cylinder along the normal of where it comes to, and that normal.

    What comes in under an edge lies on the face beyond it when the substep ends. The normal of where it began leans
    over the edge: it would hold the point back, and throw what the edge belongs to. The normal where it goes to along
    the surface is taken instead if it is more nearly square to that way, and asks for no smaller distance.

    Args:
        elements: All.
        part: Which of the bodies' parts.
        x: Where the point began, in the body's frame.
        go: How far it goes in the substep, in the body's frame [m].
        gap: Its distance where it began [m].
        n: The normal there.
        point: The part's nearest point there.
        apart: The contact distance [m].
        dt: The substep [s].

    Returns:
        The distance, the normal and the part's point under it.
    """
    kind = elements.part_kind[part]
    if kind == BOX or kind == CYLINDER:
        there = x + go - n * wp.dot(go, n)
        found, normal = part_distance(elements, part, there)
        if wp.dot(normal, n) < LEANS and found > 0.0 and wp.abs(wp.dot(go, normal)) < wp.abs(wp.dot(go, n)):
            under = there - normal * found
            height = wp.dot(x - under, normal)
            if height + LEAVE_SPEED * dt >= wp.min(apart, gap):
                gap = height
                n = normal
                point = under
    return gap, n, point


@wp.func
def cross_ridge(elements: Elements, k: int, a: wp.vec3, b: wp.vec3):
    """Return how a body's edge from a to b crosses sharp edge k of a rigid one, all in the rigid body's frame.

    Two edges touch along the normal across both, which at a sharp edge is between those of its faces; that tells the
    side even where one has come in behind the other. An edge that goes away from a face at its rim, or along it, is
    borne by the face and has its normal: one that leans would bear what slides as if it were rougher. The distance of
    what is round comes from its axis.

    Returns:
        Distance [m] and normal, away from the rigid body; parts of the way along both edges; whether they cross.
    """
    c = elements.ridge_start[k]
    e = b - a
    f = elements.ridge_end[k] - c
    d = a - c
    n = wp.cross(e, f)
    nn = wp.dot(n, n)
    sine = wp.sqrt(nn / (wp.length_sq(e) * wp.length_sq(f) + 1.0e-30))
    s = -wp.dot(wp.cross(d, f), n) / (nn + 1.0e-30)
    t = -wp.dot(wp.cross(d, e), n) / (nn + 1.0e-30)
    gap = float(1.0e6)
    crosses = sine > SLANT and wp.min(wp.min(s, 1.0 - s), wp.min(t, 1.0 - t)) > -1.0e-3
    if crosses:
        n = n / wp.sqrt(nn)
        left = elements.ridge_left[k]
        right = elements.ridge_right[k]
        radius = elements.ridge_radius[k]
        out = wp.dot(d, n)
        if radius == 0.0:
            out = wp.dot(n, left + right)
        if out < 0.0:
            n = -n
        if radius == 0.0:
            # how far it leans from each face's normal towards the other's; from the one next to it, by little if at all
            along = wp.normalize(wp.cross(left, right))
            from_left = wp.dot(wp.cross(left, n), along)
            from_right = wp.dot(wp.cross(n, right), along)
            crosses = from_left > -SLANT and from_right > -SLANT
            if from_left < 0.0:
                n = left
            elif from_right < 0.0:
                n = right
        gap = wp.dot(d + e * s, n) - radius
        crosses = crosses and gap > -elements.ridge_depth[k]
    return gap, n, s, t, crosses


@wp.kernel(enable_backward=False, module="nuno.coupled.contact_geometry")
def measure_rows(particles: Particles, rigid: RigidState, elements: Elements, rows: Rows, dt: float):
    """Weights, normal and distance of every row."""
    world, k = wp.tid()
    if k >= wp.min(rows.count[world], rows.room):
        return
    r = world * rows.room + k
    first = world * particles.count
    q = rows.corners[r]
    bodies = rows.bodies[r]
    apart = body_radius(elements, world, bodies[0]) + body_radius(elements, world, bodies[1])
    reach = elements.reach[world * elements.bodies + bodies[0]]
    kind = rows.kind[r]
    gap = float(1.0e6)
    n = wp.vec3(0.0, 0.0, 1.0)
    weights = wp.vec4(1.0, 0.0, 0.0, 0.0)
    inside = float(1.0)
    radius = float(0.0)
    if kind == VERTEX_TRIANGLE:
        x = particles.p[first + q[0]]
        height, n0, b = over_triangle(
            x, particles.p[first + q[1]], particles.p[first + q[2]], particles.p[first + q[3]]
        )
        side = wp.where(height < 0.0, -1.0, 1.0)
        if elements.solid[bodies[1]] != 0:
            side = 1.0
        gap = height * side
        n = n0 * side
        weights = wp.vec4(1.0, -b[0], -b[1], -b[2])
        inside = wp.min(b[0], wp.min(b[1], b[2])) + 1.0e-3
    elif kind == EDGE_EDGE:
        a = particles.p[first + q[0]]
        c = particles.p[first + q[2]]
        e = particles.p[first + q[1]] - a
        f = particles.p[first + q[3]] - c
        d = a - c
        s, t = closest_on_edges(d[0], d[1], d[2], e[0], e[1], e[2], f[0], f[1], f[2])
        d = d + e * s - f * t
        gap = wp.length(d)
        inside = gap - 1.0e-9
        n = d / wp.max(gap, 1.0e-9)
        weights = wp.vec4(1.0 - s, s, t - 1.0, -t)
    elif kind == VERTEX_RIGID:
        i = world * rigid.capacity + rows.slot[r]
        turn = rigid.rotation_before[i]
        x = wp.quat_rotate_inv(turn, particles.p[first + q[0]] - rigid.position_before[i])
        signed, normal = part_distance(elements, rows.part[r], x)
        gap = signed
        point = x - normal * gap
        if gap > 0.0 and gap <= apart + reach:
            now = particles.p[first + q[0]] + particles.u[first + q[0]] - rigid.position[i]
            go = wp.quat_rotate_inv(rigid.rotation[i], now) - x
            gap, normal, point = on_its_way(elements, rows.part[r], x, go, gap, normal, point, apart, dt)
        n = wp.quat_rotate(turn, normal)
        rows.point[r] = point
    elif kind == EDGE_RIGID:
        i = world * rigid.capacity + rows.slot[r]
        k_ridge = rows.part[r]
        turn = rigid.rotation_before[i]
        a = wp.quat_rotate_inv(turn, particles.p[first + q[0]] - rigid.position_before[i])
        b = wp.quat_rotate_inv(turn, particles.p[first + q[1]] - rigid.position_before[i])
        signed, normal, s, t, crosses = cross_ridge(elements, k_ridge, a, b)
        gap = signed
        inside = wp.where(crosses, 1.0, 0.0)
        n = wp.quat_rotate(turn, normal)
        weights = wp.vec4(1.0 - s, s, 0.0, 0.0)
        start = elements.ridge_start[k_ridge]
        rows.point[r] = start + (elements.ridge_end[k_ridge] - start) * t + normal * elements.ridge_radius[k_ridge]
    else:
        i = world * rigid.capacity + rows.slot[r]
        point = elements.point[rows.part[r]]
        radius = elements.point_radius[rows.part[r]]
        x = point_before(rigid, i, point)
        height, n0, b = over_triangle(
            x, particles.p[first + q[0]], particles.p[first + q[1]], particles.p[first + q[2]]
        )
        side = wp.where(height < 0.0, 1.0, -1.0)
        if elements.solid[bodies[0]] != 0:
            side = -1.0
        gap = -height * side - radius
        n = n0 * side
        rows.point[r] = point + wp.quat_rotate_inv(rigid.rotation_before[i], n) * radius
        weights = wp.vec4(b[0], b[1], b[2], 0.0)
        inside = wp.min(b[0], wp.min(b[1], b[2])) + 1.0e-3
    if inside <= 0.0 or gap > apart + reach:
        return
    inner = apart + reach + radius
    if bodies[0] == bodies[1]:
        # the far side of a thin part is inside of it too
        inner = apart
    if kind != VERTEX_RIGID and kind != EDGE_RIGID and gap < -inner:
        # far inside a solid body, this is not the face that it came through
        return
    rows.active[world * rows.room + wp.atomic_add(rows.active_count, world, 1)] = r
    for c in range(4):
        if q[c] >= 0:
            particles.pressed[first + q[c]] = 1
    rows.normal[r] = n
    rows.weights[r] = weights
    of = world * elements.bodies
    compliance = (elements.compliance[of + bodies[0]] + elements.compliance[of + bodies[1]]) / (dt * dt)
    squeeze = SQUEEZE * apart
    if kind == EDGE_RIGID:
        # where vertices bear what lies on a face, an edge at its rim takes nothing of it and makes it no harder
        apart = RIM_SHARE * apart
        compliance = 0.0
    rows.compliance[r] = compliance
    rows.squeeze[r] = squeeze
    rows.distance[r] = wp.min(apart, gap + LEAVE_SPEED * dt)
    rows.friction[r] = elements.friction[(world * elements.bodies + bodies[0]) * elements.bodies + bodies[1]]
    rows.push[r] = 0.0
    rows.drag[r] = wp.vec3(0.0, 0.0, 0.0)
    rows.sharing[r] = 0
    rows.push_change[r] = 0.0
    rows.drag_change[r] = wp.vec3(0.0, 0.0, 0.0)
