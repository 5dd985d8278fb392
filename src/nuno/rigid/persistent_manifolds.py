"""The manifolds of rigid bodies: points with their forces, which last from substep to substep.

A manifold's normal and its points stand in the frames of the two bodies, so that they follow them. Points that are
found again keep their forces and where they stuck.

Names in all functions of rigid contact: e is an entry, a pair's place in its row; p and q are the parts of its owner
and its partner, a and b the slots of their bodies, i and j where these stand in `RigidState`; o is a point.
"""

import warp as wp

from nuno.rigid.convex import BOX_PART, HULL, Parts
from nuno.rigid.manifold import POINTS
from nuno.rigid.rigid_body import RigidState, inverse_mass_at

TRAVEL, REACH, SPEED, LISTINGS = 0, 1, 2, 3
NOTES = 4
"""Per world: how far anything may have gone since the rows were listed [m], how far the list looked [m], the greatest
speed of any surface [m/s], how often it was listed."""
ENTRIES, OVERFLOW, LEFT, COLOURS, WAITING = range(5)
COUNTS = 5
"""Per world: entries with points, whether a row was too short, substeps that are left of a run, colours, entries that
wait for theirs."""

FAR = wp.constant(1.0e6)
"""[m] The gap of a point that nothing can close within the substep: the passes leave it out."""
NEAR_BY = wp.constant(2.0e-4)
"""[m] What a body that seems at rest may be pushed by others within a substep before this contact is seen."""
HOLD = wp.constant(3.0e-5)
"""[m] A point that slipped farther than this holds from there on. What sticks slips far less before it is put back;
where points cannot all go back, as in a jam of overlapping bodies, they would otherwise hold the overlap."""


@wp.struct
class Contacts:
    """Rows of pairs and their manifolds; entry k of part p of world w stands at ``(w * parts + p) * row + k``."""

    parts: int
    row: int
    partner: wp.array(dtype=int)
    patch: wp.array(dtype=int)  # which of a mesh's manifolds
    count: wp.array(dtype=int)
    friction: wp.array(dtype=float)
    bounce: wp.array(dtype=float)
    normal: wp.array(dtype=wp.vec3)  # towards the owner, in the body frame of
    frame: wp.array(dtype=int)  # 0: the partner, 1: the owner
    clear: wp.array(dtype=float)  # how far apart they were when last looked at; negative: never
    margin: wp.array(dtype=float)  # up to which points were taken
    built_place: wp.array(dtype=wp.vec3)  # the owner in the partner's frame, when last looked at
    built_turn: wp.array(dtype=wp.quat)
    # points: POINTS an entry
    local_a: wp.array(dtype=wp.vec3)  # in the owner's body frame
    local_b: wp.array(dtype=wp.vec3)
    force: wp.array(dtype=wp.vec3)  # along the normal and two tangents [N]
    # of the last frame, for `RigidSolver.impulses_of`
    impulse: wp.array(dtype=wp.vec3)  # on the owner, in the world [N s]
    met: wp.array(dtype=int)  # the slot of the body that gave it
    # of a substep
    normal_now: wp.array(dtype=wp.vec3)
    tangent_now: wp.array(dtype=wp.vec3)
    arm_a: wp.array(dtype=wp.vec3)
    arm_b: wp.array(dtype=wp.vec3)
    mass: wp.array(dtype=wp.vec3)  # effective, along normal and tangents [kg]
    start: wp.array(dtype=wp.vec4)  # gap and slip when the substep began [m], speed of approach [m/s]
    aim: wp.array(dtype=float)  # speed at which to part at least [m/s]
    # of a world
    order: wp.array(dtype=int)
    bounds: wp.array(dtype=int)  # where each round starts in the order
    waiting: wp.array(dtype=int)
    height: wp.array(dtype=float)  # by entry [m]
    winner: wp.array(dtype=wp.uint64)  # by body
    counts: wp.array(dtype=int)
    notes: wp.array(dtype=float)
    listed_position: wp.array(dtype=wp.vec3)
    listed_rotation: wp.array(dtype=wp.quat)


@wp.func
def forget_impulses(s: RigidState, parts: Parts, c: Contacts, world: int, rank: int, size: int):
    """Begin a frame of those that are active in this run."""
    for k in range(rank, parts.count * c.row, size):
        e = world * c.parts * c.row + k
        a = parts.slot[k / c.row]
        if a >= 0 and wp.length_sq(c.impulse[e]) > 0.0:
            if s.active[a] != 0 or s.active[c.met[e]] != 0:
                c.impulse[e] = wp.vec3(0.0)


@wp.func
def tangent_of(n: wp.vec3):
    """A unit vector across n (Duff et al. 2017)."""
    sign = wp.where(n[2] < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + n[2])
    return wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -sign * n[0])


@wp.func
def moves(s: RigidState, i: int, slot: int):
    """1 for a body that moves in this run, else 0."""
    return wp.where(s.active[slot] != 0, 1.0, 0.0)


@wp.func
def frame_for(s: RigidState, parts: Parts, p: int, q: int, i: int, j: int):
    """Return the body whose turns a normal follows: 0 the partner's, 1 the owner's, if the partner may roll."""
    flat_a = parts.kind[p] == BOX_PART or parts.kind[p] == HULL
    flat_b = parts.kind[q] == BOX_PART or parts.kind[q] == HULL
    result = int(0)
    if s.inverse_mass[i] > 0.0 and s.inverse_mass[j] > 0.0 and flat_a and not flat_b:
        result = 1
    return result


@wp.func
def turn_for(s: RigidState, c: Contacts, e: int, i: int, j: int):
    """The rotation that an entry's normal follows."""
    q = s.rotation[j]
    if c.frame[e] == 1:
        q = s.rotation[i]
    return q


@wp.func
def take_points(
    s: RigidState,
    parts: Parts,
    c: Contacts,
    e: int,
    p: int,
    i: int,
    j: int,
    normal: wp.vec3,
    count: int,
    moved: float,
    place: wp.array(dtype=wp.vec3),
    gap: wp.array(dtype=float),
):
    """Replace an entry's points by those found in the partner's part frame; what was there before is found again."""
    q = c.partner[e]
    old_a = wp.zeros(shape=(4,), dtype=wp.vec3)
    old_force = wp.zeros(shape=(4,), dtype=wp.vec3)
    old_slip = wp.zeros(shape=(4,), dtype=wp.vec3)
    xa = s.position[i]
    qa = s.rotation[i]
    xb = s.position[j]
    qb = s.rotation[j]
    old_turn = turn_for(s, c, e, i, j)
    old_n = wp.quat_rotate(old_turn, c.normal[e])
    old_t = wp.quat_rotate(old_turn, tangent_of(c.normal[e]))
    old_u = wp.cross(old_n, old_t)
    old = c.count[e]
    for k in range(old):
        o = e * POINTS + k
        f = c.force[o]
        old_a[k] = c.local_a[o]
        old_force[k] = f
        slip = xa + wp.quat_rotate(qa, c.local_a[o]) - xb - wp.quat_rotate(qb, c.local_b[o])
        if f[0] <= 0.0 or is_slipping(f, c.friction[e]):
            slip = wp.vec3(0.0)
        old_slip[k] = slip
    n = wp.quat_rotate(qb, wp.quat_rotate(parts.turn[q], normal))
    c.frame[e] = frame_for(s, parts, p, q, i, j)
    turn = turn_for(s, c, e, i, j)
    in_body = wp.quat_rotate_inv(turn, n)
    t = wp.quat_rotate(turn, tangent_of(in_body))
    u = wp.cross(n, t)
    c.normal[e] = in_body
    c.count[e] = count
    # what rolls is met at another point of its own each time
    known = wp.min(0.1 * parts.smallest[p] + moved, 0.3 * parts.smallest[p])
    for k in range(count):
        o = e * POINTS + k
        on_b = parts.place[q] + wp.quat_rotate(parts.turn[q], place[k] - gap[k] * normal)
        point = xb + wp.quat_rotate(qb, parts.place[q] + wp.quat_rotate(parts.turn[q], place[k]))
        local = wp.quat_rotate_inv(qa, point - xa)
        force = wp.vec3(0.0)
        slip = wp.vec3(0.0)
        nearest = float(known)
        who = int(-1)
        for m in range(old):
            far = wp.length(old_a[m] - local)
            if far < nearest:
                nearest = far
                who = m
        if who >= 0:
            f = old_force[who]
            along = f[1] * old_t + f[2] * old_u
            force = wp.vec3(f[0], wp.dot(along, t), wp.dot(along, u))
            slip = old_slip[who]
            slip = slip - wp.dot(slip, n) * n
            # only one point may go on from an old one
            old_a[who] = wp.vec3(1.0e6)
        c.local_a[o] = local
        c.local_b[o] = on_b - wp.quat_rotate_inv(qb, slip)
        c.force[o] = force


@wp.func
def is_slipping(force: wp.vec3, mu: float):
    """Return True if friction is at its limit."""
    limit = 0.999 * mu * force[0]
    return force[1] * force[1] + force[2] * force[2] >= limit * limit


@wp.func
def ready(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, p: int, dt: float, down: float):
    """Return what the passes of a substep need of each point."""
    q = c.partner[e]
    a = parts.slot[p]
    b = parts.slot[q]
    i = world * s.capacity + a
    j = world * s.capacity + b
    qa = s.rotation[i]
    qb = s.rotation[j]
    turn = turn_for(s, c, e, i, j)
    n = wp.quat_rotate(turn, c.normal[e])
    t = wp.quat_rotate(turn, tangent_of(c.normal[e]))
    u = wp.cross(n, t)
    c.normal_now[e] = n
    c.tangent_now[e] = t
    va = moves(s, i, a) * s.velocity[i]
    wa = moves(s, i, a) * s.spin[i]
    vb = moves(s, j, b) * s.velocity[j]
    wb = moves(s, j, b) * s.spin[j]
    away = s.position[i] - s.position[j]
    for k in range(c.count[e]):
        o = e * POINTS + k
        ra = wp.quat_rotate(qa, c.local_a[o])
        rb = wp.quat_rotate(qb, c.local_b[o])
        off = away + ra - rb
        gap = wp.dot(n, off)
        slip = off - gap * n
        f = c.force[o]
        if f[0] <= 0.0 or is_slipping(f, c.friction[e]) or wp.length_sq(slip) > HOLD * HOLD:
            # what slid holds from where it is now
            c.local_b[o] = c.local_b[o] + wp.quat_rotate_inv(qb, slip)
            rb = rb + slip
            slip = wp.vec3(0.0)
        speed = va + wp.cross(wa, ra) - vb - wp.cross(wb, rb)
        if f[0] <= 0.0 and gap > 2.0 * dt * (wp.length(speed) + down * dt) + NEAR_BY:
            c.start[o] = wp.vec4(FAR, 0.0, 0.0, 0.0)
        else:
            c.arm_a[o] = ra
            c.arm_b[o] = rb
            c.start[o] = wp.vec4(gap, wp.dot(t, slip), wp.dot(u, slip), wp.dot(n, speed))
            c.mass[o] = wp.vec3(
                1.0 / (inverse_mass_at(s, i, ra, n) + inverse_mass_at(s, j, rb, n)),
                1.0 / (inverse_mass_at(s, i, ra, t) + inverse_mass_at(s, j, rb, t)),
                1.0 / (inverse_mass_at(s, i, ra, u) + inverse_mass_at(s, j, rb, u)),
            )
