"""Ties between bodies that move: points that stay together, and rigid bodies that are held in a frame.

Both are solved beside the contacts of `nuno.contact.coupled_rows`, pass by pass, so that a load on one side reaches the
other within a substep. Their multipliers over dt^2 are the forces and torques that they carry.
"""

import warp as wp

from nuno.contact.coupled_particles import Particles
from nuno.contact.coupled_rows import blend
from nuno.solver.rigid_body import (
    RigidState,
    apply_rigid_correction,
    inverse_mass_at,
    point_of,
    shift_body,
    turn_between,
    turned,
)


@wp.struct
class Ties:
    """Sums of particles that stay on a point of a rigid body, or on particles of the other side (weights below 0)."""

    count: int
    corners: wp.array(dtype=wp.vec4i)  # (worlds * count), -1: none
    weights: wp.array(dtype=wp.vec4)
    body: wp.array(dtype=int)  # (count), among the coupled bodies
    slot: wp.array(dtype=int)  # -1: none
    point: wp.array(dtype=wp.vec3)
    compliance: wp.array(dtype=float)  # (count) [m/N]
    pull: wp.array(dtype=wp.vec3)  # of the substep, and of all substeps of the frame [kg m]
    total: wp.array(dtype=wp.vec3)


@wp.struct
class Holds:
    """Rigid bodies whose frame follows another rigid body's, or key poses."""

    count: int
    body: wp.array(dtype=int)  # (count), among the coupled bodies
    slot: wp.array(dtype=int)  # (count)
    leader: wp.array(dtype=int)  # (count), -1: the key poses
    compliance: wp.array(dtype=float)  # (count) [m/N], and over the square of 1 m [1/(N m)] for turns
    free: wp.array(dtype=wp.vec3)  # (worlds * count), along which the body slides, in the world's frame; zero: none
    place: wp.array(dtype=wp.vec3)  # (worlds * 2 * count): at the frame's start and end, or in the leader's frame
    turn: wp.array(dtype=wp.quat)
    pull: wp.array(dtype=wp.vec3)  # (worlds * count)
    twist: wp.array(dtype=wp.vec3)
    total: wp.array(dtype=wp.vec3)
    total_twist: wp.array(dtype=wp.vec3)


@wp.func
def project_tie(particles: Particles, rigid: RigidState, ties: Ties, world: int, k: int, dt: float):
    """One projection of the distance between the sides, along itself; returns how far it was."""
    r = world * ties.count + k
    first = world * particles.count
    corners = ties.corners[r]
    weights = ties.weights[r]
    if corners[0] < 0:
        return float(0.0)
    apart = blend(particles.p, first, corners, weights) + blend(particles.u, first, corners, weights)
    slot = ties.slot[r]
    i = world * rigid.capacity + slot
    if slot >= 0:
        apart = apart - point_of(rigid, i, ties.point[r])
    alpha = ties.compliance[k] / (dt * dt)
    apart = apart + ties.pull[r] * alpha
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
        ties.pull[r] = ties.pull[r] + pull
        for c in range(4):
            if corners[c] >= 0:
                j = first + corners[c]
                particles.u[j] = particles.u[j] + pull * (weights[c] * particles.w[j])
        if slot >= 0:
            apply_rigid_correction(rigid, i, arm, -pull)
    return length


@wp.func
def project_hold(rigid: RigidState, holds: Holds, world: int, k: int, dt: float, fraction: float):
    """One projection of a rigid body's place and turn onto its frame's; returns how far the place was."""
    r = world * holds.count + k
    i = world * rigid.capacity + holds.slot[k]
    key = 2 * r
    place = holds.place[key] + (holds.place[key + 1] - holds.place[key]) * fraction
    turn = wp.quat_slerp(holds.turn[key], holds.turn[key + 1], fraction)
    leader = holds.leader[k]
    j = world * rigid.capacity + leader
    arm = wp.vec3(0.0, 0.0, 0.0)
    if leader >= 0:
        arm = wp.quat_rotate(rigid.rotation[j], place)
        place = rigid.position[j] + arm
        turn = rigid.rotation[j] * turn
    alpha = holds.compliance[k] / (dt * dt)
    apart = rigid.position[i] - place + holds.pull[r] * alpha
    free = holds.free[r]
    apart = apart - free * wp.dot(apart, free)
    length = wp.length(apart)
    if length > 1.0e-12:
        n = apart / length
        weight = rigid.weight[i] + alpha + 1.0e-12
        if leader >= 0:
            weight += inverse_mass_at(rigid, j, arm, n)
        pull = n * (-length / weight)
        holds.pull[r] = holds.pull[r] + pull
        shift_body(rigid, i, pull * rigid.weight[i])
        if leader >= 0:
            apply_rigid_correction(rigid, j, arm, -pull)
    off = turn_between(turn, rigid.rotation[i]) + holds.twist[r] * alpha
    angle = wp.length(off)
    if angle > 1.0e-9:
        n = off / angle
        weight = wp.dot(n, rigid.give[i] * n) + alpha + 1.0e-12
        if leader >= 0:
            weight += wp.dot(n, rigid.give[j] * n)
        twist = n * (-angle / weight)
        holds.twist[r] = holds.twist[r] + twist
        rigid.rotation[i] = turned(rigid.rotation[i], rigid.give[i] * twist)
        if leader >= 0:
            rigid.rotation[j] = turned(rigid.rotation[j], rigid.give[j] * (-twist))
    return length
