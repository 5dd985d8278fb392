"""Joints of rigid bodies, with limits, friction, motors and springs, solved beside the contacts of coupled bodies.

After Müller, Macklin, Chentanez, Jeschke, Kim: "Detailed rigid body simulation with extended position based dynamics"
(SCA 2020), with two changes. A joint's place and turn are solved together, as a block, so that one pass is enough for
one joint. Multipliers act along the arms and axes of where the substep began, as in SHAKE (Ryckaert, Ciccotti,
Berendsen 1977): with those of where it ends, as in implicit Euler, what swings freely would lose energy.

What acts along the free direction of a hinge or slider (friction, spring, motor, stop) is a function of where it ends;
their sum and the inertia are solved in closed form.
"""

import warp as wp

from nuno.coupled.drive_constraints import project_axis, project_ball
from nuno.coupled.joint_response import (
    BALL,
    FIXED,
    HINGE,
    SLIDER,
    Joints,
    apply_joint,
    arm_of,
    block_of,
    other_frame,
    other_frame_now,
    respond,
)
from nuno.coupled.tie_constraints import CATCH_UP, UNMET, left_over, stand_on, within
from nuno.rigid.rigid_body import RigidState, in_world, point_before, point_of, rotation_between

JOINT_SWEEPS = wp.constant(8)
"""Times that joints outside of trees are gone through in a pass, where there are several."""
ROUNDING = wp.constant(2.0e-7)
"""[m], [rad] What rounding of coordinates leaves of a joint, at a metre from the origin."""


@wp.func
def misfit(kind: int, apart: wp.vec3, turn: wp.quat, other_turn: wp.quat, axis: wp.vec3):
    """The distance and the turn of a joint's frames that should not be; its axis lies in the other's frame."""
    c = apart
    off = wp.vec3(0.0, 0.0, 0.0)
    if kind == SLIDER:
        c = c - axis * wp.dot(c, axis)
    if kind == HINGE:
        off = wp.cross(axis, wp.quat_rotate(turn, wp.vec3(0.0, 0.0, 1.0)))
    elif kind != BALL:
        off = rotation_between(other_turn, turn)
    return c, off


@wp.func
def project_joint(rigid: RigidState, joints: Joints, world: int, k: int, dt: float):
    """One projection of a joint; returns how far it was from where it should be, beyond rounding."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    weight = rigid.weight[i]
    other_turn = joints.other_turn[r]
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
        weight = weight + rigid.weight[j]
        other_turn = rigid.rotation_before[j] * other_turn
    if weight == 0.0:
        return float(0.0)
    kind = joints.kind[k]
    axis = wp.quat_rotate(other_turn, wp.vec3(0.0, 0.0, 1.0))
    arm = arm_of(rigid, i, joints.place[r])
    other_arm = arm_of(rigid, j, joints.other_place[r])
    if kind == SLIDER and j >= 0:
        # the other bears it where this body is on its line
        other_arm = point_before(rigid, i, joints.place[r]) - rigid.position_before[j]
    block = block_of(rigid, kind, i, j, arm, other_arm, axis)
    apart, off = joint_apart(rigid, joints, world, k, dt)
    pull, twist = respond(block, apart, off)
    most = joints.limit[r] * dt * dt
    pull_sum = within(joints.pull[r] + pull, most)
    twist_sum = within(joints.twist[r] + twist, most)
    pull = pull_sum - joints.pull[r]
    twist = twist_sum - joints.twist[r]
    joints.pull[r] = pull_sum
    joints.twist[r] = twist_sum
    apply_joint(rigid, i, j, arm, other_arm, pull, twist)
    # what acts along the free direction keeps the others as they are, so that one pass is enough for one joint
    if kind == HINGE or kind == SLIDER:
        project_axis(rigid, joints, block, world, k, dt, axis, arm, other_arm)
    elif kind == BALL:
        project_ball(rigid, joints, block, world, k, dt, arm, other_arm)
    floor = ROUNDING * (1.0 + wp.length(rigid.position[i]))
    return wp.max(wp.max(wp.length(apart), wp.length(off)) - floor, 0.0)


@wp.func
def joint_misfit(rigid: RigidState, joints: Joints, world: int, k: int):
    """The distance and the turn of a joint's frames that should not be, as they are now."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    place, other_turn = other_frame_now(rigid, joints, world, k)
    return misfit(
        joints.kind[k], point_of(rigid, i, joints.place[r]) - place, rigid.rotation[i] * joints.turn[r], other_turn,
        wp.quat_rotate(other_turn, wp.vec3(0.0, 0.0, 1.0)),
    )  # fmt: skip


@wp.func
def joint_before(rigid: RigidState, joints: Joints, world: int, k: int):
    """The distance and turn of `joint_misfit` where the substep began."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    _place, _turn, place_before, other_before = other_frame(rigid, joints, world, k)
    return misfit(
        joints.kind[k], point_before(rigid, i, joints.place[r]) - place_before,
        rigid.rotation_before[i] * joints.turn[r], other_before,
        wp.quat_rotate(other_before, wp.vec3(0.0, 0.0, 1.0)),
    )  # fmt: skip


@wp.func
def joint_left(rigid: RigidState, joints: Joints, world: int, k: int, dt: float):
    """The distance and turn that a joint leaves in a substep: what it may not mend of how that began."""
    apart, off = joint_before(rigid, joints, world, k)
    return left_over(apart, CATCH_UP * dt), left_over(off, CATCH_UP * dt)


@wp.func
def joint_apart(rigid: RigidState, joints: Joints, world: int, k: int, dt: float):
    """The distance and turn that should not be, beyond what the joint may mend in a substep."""
    apart, off = joint_misfit(rigid, joints, world, k)
    left_apart, left_off = joint_left(rigid, joints, world, k, dt)
    return apart - left_apart, off - left_off


@wp.func
def projections_of(count: int):
    """Return how many projections a pass has of ``count`` joints; one by itself needs no more than one."""
    return wp.where(count > 1, JOINT_SWEEPS * count, count)


@wp.func
def joint_at(count: int, at: int):
    """Return which of ``count`` joints a projection is of: to and fro, so that both ends of a loop are heard alike."""
    k = at % count
    if (at / count) % 2 == 1:
        k = count - 1 - k
    return k


@wp.func
def begin_joint(joints: Joints, world: int, k: int):
    """No multiplier yet in a substep."""
    r = world * joints.count + k
    joints.pull[r] = wp.vec3(0.0, 0.0, 0.0)
    joints.twist[r] = wp.vec3(0.0, 0.0, 0.0)
    joints.free[r] = wp.vec3(0.0, 0.0, 0.0)
    joints.axial[r] = 0.0


@wp.func
def settle_spin(rigid: RigidState, i: int, dt: float):
    """Let a body's angular momentum be what its torques made of it, before its velocities are read off.

    Read off the turns alone, these are I^-1 of where the substep began times the torque, which for a bar that turns is
    not its angular momentum's change: of two joined bars, a tenth of it would be lost in 2 s.
    """
    if rigid.weight[i] > 0.0:
        now = rigid.rotation[i]
        start = rigid.rotation_before[i]
        free = rigid.rotation_free[i]
        gained = rotation_between(free, now) / dt
        torque = in_world(start, rigid.inertia[i]) * gained
        momentum = in_world(free, rigid.inertia[i]) * rigid.spin[i]
        # differences, for products of the inertia and its inverse are 1 but for rounding, always alike
        there = in_world(free, rigid.inverse_inertia[i]) * momentum + rigid.give[i] * torque
        change = in_world(now, rigid.inverse_inertia[i]) * (momentum + torque) - there
        read = (rotation_between(start, now) - rotation_between(start, free)) / dt  # as `read_velocity` will
        rigid.spin[i] = rigid.spin[i] + (change + (gained - read))


@wp.func
def settle_spins(rigid: RigidState, joints: Joints, world: int, k: int, dt: float):
    """`settle_spin` of a joint's bodies, those of earlier joints excepted."""
    if (joints.settles[k] & 1) != 0:
        settle_spin(rigid, world * rigid.capacity + joints.slot[k], dt)
    if (joints.settles[k] & 2) != 0:
        settle_spin(rigid, world * rigid.capacity + joints.other[k], dt)


@wp.func
def sum_joint(rigid: RigidState, joints: Joints, world: int, k: int, dt: float):
    """Add what a joint bore in the substep to the frame's sums, and note whether it was met."""
    r = world * joints.count + k
    pull = joints.pull[r]
    twist = joints.twist[r]
    joints.total[r] = joints.total[r] + pull
    joints.total_twist[r] = joints.total_twist[r] + twist
    joints.total_axial[r] = joints.total_axial[r] + joints.axial[r]
    most = 0.999 * joints.limit[r] * dt * dt
    apart, off = joint_apart(rigid, joints, world, k, dt)
    missed = wp.length(pull) > most or wp.length(twist) > most
    rigid.joined[world * rigid.capacity + joints.slot[k]] = 1
    if joints.other[k] >= 0:
        rigid.joined[world * rigid.capacity + joints.other[k]] = 1
    if missed or wp.length(apart) > UNMET or wp.length(off) > UNMET:
        joints.unmet[r] = joints.unmet[r] + 1
    elif joints.kind[k] == FIXED:
        stand_on(rigid, world, joints.slot[k], joints.other[k], joints.limit[r])
