"""Joints of rigid bodies as the kernels hold them, and a joint's response to forces and torques, as a block."""

import warp as wp

from nuno.rigid.rigid_body import RigidState, point_before, point_of, shift_body, turn_body

FIXED, HINGE, SLIDER, BALL = 0, 1, 2, 3
LOWER, UPPER, FRICTION, STIFFNESS, DAMPING, POSITION, VELOCITY, EFFORT, SPRING, REST, SPRING_DAMPING = range(11)
DRIVES = wp.constant(11)
"""Numbers of what acts along the free direction; an infinite `DAMPING` is a motor that keeps its velocity exactly."""


@wp.struct
class Joints:
    """Pairs of rigid bodies, or a body and the world, with a frame in each whose z axis is free, or nothing, or all."""

    count: int
    kind: wp.array(dtype=int)  # (count)
    body: wp.array(dtype=int)  # (count), among the coupled bodies
    slot: wp.array(dtype=int)  # (count)
    other: wp.array(dtype=int)  # (count), -1: the world
    settles: wp.array(dtype=int)  # (count), 1 where no earlier joint has its body, and 2 more where none has its other
    place: wp.array(dtype=wp.vec3)  # (worlds * count), from the body's centre of mass, in its axes
    turn: wp.array(dtype=wp.quat)
    other_place: wp.array(dtype=wp.vec3)  # likewise of the other, or in the world
    other_turn: wp.array(dtype=wp.quat)
    drive: wp.array(dtype=float)  # (worlds * count * DRIVES)
    limit: wp.array(dtype=float)  # (worlds * count) [N], and [N m]
    pull: wp.array(dtype=wp.vec3)  # (worlds * count) multipliers of the substep: of the place,
    twist: wp.array(dtype=wp.vec3)  # of turns, what acts along the free direction included,
    axial: wp.array(dtype=float)  # what acts along it alone,
    state: wp.array(dtype=int)  # whether friction holds or slides, see `driven`,
    free: wp.array(dtype=wp.vec3)  # and of a ball joint's friction and spring
    total: wp.array(dtype=wp.vec3)  # of all substeps of the frame
    total_twist: wp.array(dtype=wp.vec3)
    total_axial: wp.array(dtype=float)
    unmet: wp.array(dtype=int)  # in how many substeps of the frame it was not met


@wp.struct
class Block:
    """The response of a joint's two frames to multipliers at its place and of its turns, against each other."""

    lever: wp.mat33  # the place, for a torque
    spin: wp.mat33  # turns, for a torque
    push: wp.mat33  # the place, for a force
    push_inverse: wp.mat33  # without the free direction
    spin_inverse: wp.mat33  # of turns, where the place is kept
    across_push: wp.mat33  # takes the free direction out of forces
    across_spin: wp.mat33  # and of torques


@wp.func
def inverted(m: wp.mat33):
    """The inverse of a matrix, scaled so that no product of small inertias leaves the range of floats."""
    size = m[0, 0] + m[1, 1] + m[2, 2]
    return wp.inverse(m / size) / size


@wp.func
def arm_of(rigid: RigidState, i: int, place: wp.vec3):
    """Return a joint's arm from the centre of mass when the substep began; i below 0: nothing moves."""
    arm = wp.vec3(0.0, 0.0, 0.0)
    if i >= 0:
        arm = wp.quat_rotate(rigid.rotation_before[i], place)
    return arm


@wp.func
def other_frame(rigid: RigidState, joints: Joints, world: int, k: int):
    """The joint's frame in the other body, or in the world: place and turn now, and when the substep began."""
    r = world * joints.count + k
    place = joints.other_place[r]
    place_before = joints.other_place[r]
    turn = joints.other_turn[r]
    turn_before = joints.other_turn[r]
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
        place = point_of(rigid, j, joints.other_place[r])
        place_before = point_before(rigid, j, joints.other_place[r])
        turn = rigid.rotation[j] * turn
        turn_before = rigid.rotation_before[j] * turn_before
    return place, turn, place_before, turn_before


@wp.func
def other_frame_now(rigid: RigidState, joints: Joints, world: int, k: int):
    """The joint's frame in the other body, or in the world: place and turn now."""
    r = world * joints.count + k
    place = joints.other_place[r]
    turn = joints.other_turn[r]
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
        place = point_of(rigid, j, joints.other_place[r])
        turn = rigid.rotation[j] * turn
    return place, turn


@wp.func
def block_of(rigid: RigidState, kind: int, i: int, j: int, arm: wp.vec3, other_arm: wp.vec3, axis: wp.vec3):
    """The block of a joint."""
    made = Block()
    own = wp.skew(arm)
    give = rigid.give[i]
    unit = wp.identity(n=3, dtype=float)
    made.push = unit * rigid.weight[i] - own * give * own
    made.lever = -own * give
    made.spin = give
    if j >= 0:
        others = wp.skew(other_arm)
        give = rigid.give[j]
        made.push = made.push + unit * rigid.weight[j] - others * give * others
        made.lever = made.lever - others * give
        made.spin = made.spin + give
    along = wp.outer(axis, axis)
    made.across_push = unit
    made.across_spin = unit
    push = made.push
    if kind == SLIDER:
        made.across_push = unit - along
        push = made.across_push * push * made.across_push + along * (wp.trace(push) / 3.0)
    made.push_inverse = inverted(push)
    if kind == BALL:
        made.across_spin = wp.mat33(0.0)
    if kind == HINGE:
        made.across_spin = unit - along
    lever = made.across_push * made.lever
    kept = made.spin - wp.transpose(lever) * made.push_inverse * lever
    if kind == HINGE:
        kept = made.across_spin * kept * made.across_spin + along * (wp.trace(kept) / 3.0)
    made.spin_inverse = inverted(kept)
    return made


@wp.func
def respond(block: Block, apart: wp.vec3, off: wp.vec3):
    """The force and torque that take back a distance and a turn in the directions that the joint keeps."""
    c = block.across_push * apart
    lever = block.across_push * block.lever
    first = block.push_inverse * c
    e = block.across_spin * (off - wp.transpose(lever) * first)
    twist = -(block.across_spin * (block.spin_inverse * e))
    pull = -(block.across_push * (first + block.push_inverse * (lever * twist)))
    return pull, twist


@wp.func
def apply_joint(rigid: RigidState, i: int, j: int, arm: wp.vec3, other_arm: wp.vec3, pull: wp.vec3, twist: wp.vec3):
    """Move both bodies by a force and a torque at the joint, opposite on the other."""
    shift_body(rigid, i, rigid.weight[i] * pull)
    turn_body(rigid, i, rigid.give[i] * (wp.cross(arm, pull) + twist))
    if j >= 0:
        shift_body(rigid, j, -rigid.weight[j] * pull)
        turn_body(rigid, j, -(rigid.give[j] * (wp.cross(other_arm, pull) + twist)))
