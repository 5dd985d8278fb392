"""Ties between bodies that move: points that stay together, and rigid bodies that are held in a frame.

Both are solved beside the contacts of `nuno.coupled.contact_rows`, pass by pass, so that a load on one side reaches the
other within a substep. Their multipliers over dt^2 are the forces and torques that they carry.
"""

import warp as wp

from nuno.coupled.bounded_particles import Particles
from nuno.coupled.contact_rows import blend
from nuno.rigid.rigid_body import (
    RigidState,
    apply_rigid_correction,
    inverse_mass_at,
    point_before,
    point_of,
    rotation_between,
    shift_body,
    turn_body,
)

CATCH_UP = wp.constant(1.0)
"""[m/s], [rad/s] A stiff tie or hold that starts from a wrong place mends that no faster, beside the motion of what
leads it: contradictions are no explosions."""
HARD = wp.constant(9.9e3)
"""[N] What a hold must bear at least for contacts to take its body as immovable: the least limit that is chosen where
none is asked for. A weaker one gives way to impacts."""
UNMET = wp.constant(5.0e-4)
"""[m], [rad] What the passes leave of a tie or hold that counts as not met: ten times what they leave under loads."""


@wp.struct
class Ties:
    """Sums of particles that stay on a point of a rigid body, a place, or other particles (weights below 0)."""

    count: int
    step: float  # a substep's share of the frame
    corners: wp.array(dtype=wp.vec4i)  # (worlds * count), -1: none
    weights: wp.array(dtype=wp.vec4)
    body: wp.array(dtype=int)  # (count), among the coupled bodies
    slot: wp.array(dtype=int)  # -1: none
    point: wp.array(dtype=wp.vec3)
    kinematic: wp.array(dtype=int)  # (count), 1 for a place that is prescribed
    place: wp.array(dtype=wp.vec3)  # (worlds * 2 * count), which is there at the frame's start and end
    compliance: wp.array(dtype=float)  # (count) [m/N]
    limit: wp.array(dtype=float)  # (worlds * count) [N], what each point bears at most
    pull: wp.array(dtype=wp.vec3)  # of the substep, and of all substeps of the frame [kg m]
    total: wp.array(dtype=wp.vec3)
    unmet: wp.array(dtype=int)  # (worlds * count), in how many substeps of the frame it was not met


@wp.struct
class Holds:
    """Rigid bodies whose frame follows another rigid body's, or key poses."""

    count: int
    step: float  # a substep's share of the frame
    body: wp.array(dtype=int)  # (count), among the coupled bodies
    slot: wp.array(dtype=int)  # (count)
    leader: wp.array(dtype=int)  # (count), -1: the key poses
    compliance: wp.array(dtype=float)  # (count) [m/N], and over the square of 1 m [1/(N m)] for turns
    free: wp.array(dtype=wp.vec3)  # (worlds * count), along which the body slides, in the world's frame; zero: none
    place: wp.array(dtype=wp.vec3)  # (worlds * 2 * count): at the frame's start and end, or in the leader's frame
    turn: wp.array(dtype=wp.quat)
    # (worlds * count) [N], what it bears at most, and of turns [N m]; negative: it does not hold in this world
    limit: wp.array(dtype=float)
    pull: wp.array(dtype=wp.vec3)  # (worlds * count)
    twist: wp.array(dtype=wp.vec3)
    total: wp.array(dtype=wp.vec3)
    total_twist: wp.array(dtype=wp.vec3)
    unmet: wp.array(dtype=int)  # (worlds * count), in how many substeps of the frame it was not met


@wp.func
def within(v: wp.vec3, most: float):
    """A vector, no longer than ``most``."""
    result = v
    if wp.length_sq(v) > most * most:
        result = v * (most / wp.length(v))
    return result


@wp.func
def left_over(apart: wp.vec3, mended: float):
    """Return what is left of a distance of which ``mended`` is taken back."""
    return apart - within(apart, mended)


@wp.func
def tie_apart(particles: Particles, rigid: RigidState, ties: Ties, world: int, k: int, dt: float, fraction: float):
    """Return how far the sides of a tie are apart, beyond what it may mend in a substep."""
    r = world * ties.count + k
    first = world * particles.count
    corners = ties.corners[r]
    weights = ties.weights[r]
    before = blend(particles.p, first, corners, weights)
    apart = before + blend(particles.u, first, corners, weights)
    slot = ties.slot[r]
    i = world * rigid.capacity + slot
    if slot >= 0:
        before = before - point_before(rigid, i, ties.point[r])
        apart = apart - point_of(rigid, i, ties.point[r])
    if ties.kinematic[k] != 0:
        goes = ties.place[2 * r + 1] - ties.place[2 * r]
        apart = apart - (ties.place[2 * r] + goes * fraction)
        before = before - (ties.place[2 * r] + goes * (fraction - ties.step))
    if ties.compliance[k] == 0.0:
        apart = apart - left_over(before, CATCH_UP * dt)
    return apart


@wp.func
def project_tie(particles: Particles, rigid: RigidState, ties: Ties, world: int, k: int, dt: float, fraction: float):
    """One projection of the distance between the sides, along itself; returns how far it was."""
    r = world * ties.count + k
    first = world * particles.count
    corners = ties.corners[r]
    weights = ties.weights[r]
    if corners[0] < 0:
        return float(0.0)
    slot = ties.slot[r]
    i = world * rigid.capacity + slot
    alpha = ties.compliance[k] / (dt * dt)
    apart = tie_apart(particles, rigid, ties, world, k, dt, fraction) + ties.pull[r] * alpha
    length = wp.length(apart)
    if length > 1.0e-12:
        n = apart / length
        weight = alpha + 1.0e-9
        for c in range(4):
            if corners[c] >= 0:
                weight += weights[c] * weights[c] * particles.w[first + corners[c]]
        arm = wp.vec3(0.0, 0.0, 0.0)
        if slot >= 0:
            arm = wp.quat_rotate(rigid.rotation[i], ties.point[r])
            weight += inverse_mass_at(rigid, i, arm, n)
        pull = n * (-length / weight)
        total = ties.pull[r] + pull
        most = ties.limit[r] * dt * dt
        if wp.length(total) > most:
            total = within(total, most)
            pull = total - ties.pull[r]
        ties.pull[r] = total
        for c in range(4):
            if corners[c] >= 0:
                j = first + corners[c]
                particles.u[j] = particles.u[j] + pull * (weights[c] * particles.w[j])
        if slot >= 0:
            apply_rigid_correction(rigid, i, arm, -pull)
    return length


@wp.func
def sum_tie(particles: Particles, rigid: RigidState, ties: Ties, world: int, k: int, dt: float, fraction: float):
    """Add what a tie bore in the substep to the frame's sum, and note whether it was met."""
    r = world * ties.count + k
    pull = ties.pull[r]
    ties.total[r] = ties.total[r] + pull
    if ties.corners[r][0] >= 0:
        missed = wp.length(pull) > 0.999 * ties.limit[r] * dt * dt
        if ties.compliance[k] == 0.0:
            missed = missed or wp.length(tie_apart(particles, rigid, ties, world, k, dt, fraction)) > UNMET
        if missed:
            ties.unmet[r] = ties.unmet[r] + 1


@wp.func
def hold_pose(holds: Holds, world: int, k: int, fraction: float):
    """Return a hold's pose of its body at a fraction of the frame: place and turn, or in its leader's frame."""
    key = 2 * (world * holds.count + k)
    place = holds.place[key] + (holds.place[key + 1] - holds.place[key]) * fraction
    turn = wp.quat_slerp(holds.turn[key], holds.turn[key + 1], fraction)
    return place, turn


@wp.func
def hold_apart(rigid: RigidState, holds: Holds, world: int, k: int, dt: float, fraction: float):
    """Return how far a held body is from its frame beyond what the hold may mend in a substep."""
    r = world * holds.count + k
    i = world * rigid.capacity + holds.slot[k]
    place, turn = hold_pose(holds, world, k, fraction)
    leader = holds.leader[k]
    j = world * rigid.capacity + leader
    if leader >= 0:
        place = point_of(rigid, j, place)
        turn = rigid.rotation[j] * turn
    apart = rigid.position[i] - place
    off = rotation_between(turn, rigid.rotation[i])
    free = holds.free[r]
    if holds.compliance[k] == 0.0:
        place, turn = hold_pose(holds, world, k, fraction - holds.step)
        if leader >= 0:
            place = point_before(rigid, j, place)
            turn = rigid.rotation_before[j] * turn
        before = rigid.position_before[i] - place
        apart = apart - left_over(before - free * wp.dot(before, free), CATCH_UP * dt)
        off = off - left_over(rotation_between(turn, rigid.rotation_before[i]), CATCH_UP * dt)
    return apart - free * wp.dot(apart, free), off


@wp.func
def project_hold(rigid: RigidState, holds: Holds, world: int, k: int, dt: float, fraction: float):
    """One projection of a rigid body's place and turn onto its frame's; returns how far the place was."""
    r = world * holds.count + k
    i = world * rigid.capacity + holds.slot[k]
    leader = holds.leader[k]
    j = world * rigid.capacity + leader
    arm = wp.vec3(0.0, 0.0, 0.0)
    if leader >= 0:
        place, _turn = hold_pose(holds, world, k, fraction)
        arm = wp.quat_rotate(rigid.rotation[j], place)
    alpha = holds.compliance[k] / (dt * dt)
    most = holds.limit[r] * dt * dt
    free = holds.free[r]
    apart, off = hold_apart(rigid, holds, world, k, dt, fraction)
    stretch = holds.pull[r] * alpha
    apart = apart + (stretch - free * wp.dot(stretch, free))
    length = wp.length(apart)
    if length > 1.0e-12:
        n = apart / length
        weight = rigid.weight[i] + alpha + 1.0e-12
        if leader >= 0:
            weight += inverse_mass_at(rigid, j, arm, n)
        pull = n * (-length / weight)
        total = holds.pull[r] + pull
        if wp.length(total) > most:
            total = within(total, most)
            pull = total - holds.pull[r]
        holds.pull[r] = total
        shift_body(rigid, i, pull * rigid.weight[i])
        if leader >= 0:
            apply_rigid_correction(rigid, j, arm, -pull)
    # the projection of the place has turned the leader
    apart, off = hold_apart(rigid, holds, world, k, dt, fraction)
    off = off + holds.twist[r] * alpha
    angle = wp.length(off)
    if angle > 1.0e-9:
        n = off / angle
        weight = wp.dot(n, rigid.give[i] * n) + alpha + 1.0e-12
        if leader >= 0:
            weight += wp.dot(n, rigid.give[j] * n)
        twist = n * (-angle / weight)
        total = holds.twist[r] + twist
        if wp.length(total) > most:
            total = within(total, most)
            twist = total - holds.twist[r]
        holds.twist[r] = total
        turn_body(rigid, i, rigid.give[i] * twist)
        if leader >= 0:
            turn_body(rigid, j, rigid.give[j] * (-twist))
    return length


@wp.func
def stand_on(rigid: RigidState, world: int, slot: int, leader: int, limit: float):
    """Mark a body that is held entirely by what does not give, by a negative weight for the rest of the substep.

    Contacts of rigid bodies come after the holds. To them a light plate in a hand would give under a heavy box, and
    only the next substep's hold would put it back: the box would wobble and walk. See `nuno.rigid.pair_motion`.
    """
    hard = limit >= HARD
    if leader >= 0:
        hard = hard and rigid.weight[world * rigid.capacity + leader] <= 0.0
    if hard:
        i = world * rigid.capacity + slot
        rigid.weight[i] = -wp.abs(rigid.weight[i])


@wp.func
def sum_hold(rigid: RigidState, holds: Holds, world: int, k: int, dt: float, fraction: float):
    """Add what a hold bore in the substep to the frame's sums, and note whether it was met."""
    r = world * holds.count + k
    pull = holds.pull[r]
    twist = holds.twist[r]
    holds.total[r] = holds.total[r] + pull
    holds.total_twist[r] = holds.total_twist[r] + twist
    most = 0.999 * holds.limit[r] * dt * dt
    missed = wp.length(pull) > most or wp.length(twist) > most
    if holds.compliance[k] == 0.0:
        apart, off = hold_apart(rigid, holds, world, k, dt, fraction)
        missed = missed or wp.length(apart) > UNMET or wp.length(off) > UNMET
        if not missed and wp.length_sq(holds.free[r]) == 0.0:
            stand_on(rigid, world, holds.slot[k], holds.leader[k], holds.limit[r])
    if missed:
        holds.unmet[r] = holds.unmet[r] + 1
