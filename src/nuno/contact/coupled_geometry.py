"""Where the candidates of coupled bodies touch: weights, normal and distance of each row for one substep.

All is taken where the substep began, when nothing crossed: that tells the side, and of a face of a solid body the
outside is known. A row whose parts are too close
already asks for what they have and a little more, so that they part slowly.
"""

import warp as wp

from nuno.contact.coupled_lists import Elements, body_radius
from nuno.contact.coupled_rows import (
    EDGE_EDGE,
    LEAVE_SPEED,
    VERTEX_RIGID,
    VERTEX_TRIANGLE,
    Particles,
    Rows,
)
from nuno.contact.distances import BOX, CAPSULE, CYLINDER, SPHERE, distance_box, distance_cylinder, distance_round
from nuno.contact.nearness import closest_on_edges
from nuno.solver.rigid_body import RigidState, point_before

SQUEEZE = wp.constant(0.05)
"""Share of the distance by which a cloth is pressed together at most; beyond that it is hard, and nothing comes in."""


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
    local = wp.quat_rotate_inv(elements.part_turn[part], x - elements.part_place[part])
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
    return gap, wp.quat_rotate(elements.part_turn[part], wp.vec3(nx, ny, nz))


@wp.kernel(enable_backward=False, module="nuno.contact.coupled_geometry")
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
        n = wp.quat_rotate(turn, normal)
        rows.point[r] = x - normal * gap
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
    if kind != VERTEX_RIGID and gap < -inner:
        # far inside a solid body, this is not the face that it came through
        return
    rows.active[world * rows.room + wp.atomic_add(rows.active_count, world, 1)] = r
    rows.normal[r] = n
    rows.weights[r] = weights
    rows.distance[r] = wp.min(apart, gap + LEAVE_SPEED * dt)
    of = world * elements.bodies
    rows.soft[r] = (elements.soft[of + bodies[0]] + elements.soft[of + bodies[1]]) / (dt * dt)
    rows.squeeze[r] = SQUEEZE * apart
    rows.friction[r] = elements.friction[(world * elements.bodies + bodies[0]) * elements.bodies + bodies[1]]
    rows.push[r] = 0.0
    rows.drag[r] = wp.vec3(0.0, 0.0, 0.0)
    rows.sharing[r] = 0
    rows.push_change[r] = 0.0
    rows.drag_change[r] = wp.vec3(0.0, 0.0, 0.0)
