"""Joints of trees from the leaves to the root: each one's response to its carrier. See `nuno.coupled.joint_tree`."""

import warp as wp

from nuno.coupled.articulated_inertia import Inertia, rest_of, seen_from
from nuno.coupled.drive_constraints import angle_about, driven, wrapped
from nuno.coupled.joint_constraints import ROUNDING, joint_left, joint_misfit
from nuno.coupled.joint_response import (
    BALL,
    DRIVES,
    HINGE,
    SLIDER,
    Joints,
    arm_of,
    inverted,
    other_frame,
    other_frame_now,
)
from nuno.rigid.rigid_body import RigidState, point_before, point_of

LIMITED = wp.constant(0.999)
"""Of a joint's limit, from where on it bears no more in the substep."""

ROTATION_ROUNDING = wp.constant(2.0e-6)
"""[rad] What rounding leaves of a joint's turn: of two bodies' turns and their products with its frames 0.7e-6, and as
much again of contacts, whose own rounding of 4e-7 m turns a foot by 3e-6. Friction that lets go or takes hold counts as
wrong however little that turns, see `nuno.coupled.joint_tree.PIVOTED`."""


@wp.struct
class Opening:
    """Response of a joint of a tree to the body that carries it."""

    carried: Inertia  # what that body feels of it
    push: wp.mat33  # U, columns: forces,
    twist: wp.mat33  # and torques
    gives: wp.mat33  # D^-1
    drive: wp.vec3  # u
    along: wp.mat33  # S, columns: shifts,
    about: wp.mat33  # and turns
    shift: wp.vec3  # what it takes back of a wrong place,
    turn: wp.vec3  # and of a wrong turn
    alone: int  # 1: what hangs on it follows nothing
    whole: Inertia  # of what it carries, as seen from it
    line: wp.vec3  # of a hinge or slider, the multiplier's shift and turn of its free direction:
    spin: wp.vec3
    inertia: float  # what a unit of way takes along it
    slope: float  # stiffness of what drives it
    axis: wp.vec3  # where the substep began
    arm: wp.vec3  # to the joint, of what it carries
    other_arm: wp.vec3  # and of what carries it
    start: float  # where it was along its free direction
    left: wp.vec3  # of a wrong place, and of a wrong turn, what may not be mended in the substep
    left_off: wp.vec3


@wp.struct
class Trees:
    """Joints that make trees, those that carry before those that are carried, and the joints that are in none."""

    count: int  # joints in trees
    roots: int  # bodies that no joint carries
    lone: int  # joints in no tree
    joint: wp.array(dtype=int)  # (count)
    carrier: wp.array(dtype=int)  # (count) the node that carries: a joint's place here, or count and a root's; -1: none
    flipped: wp.array(dtype=int)  # (count) 1 where it carries its own body's other
    root: wp.array(dtype=int)  # (roots) slot
    alone: wp.array(dtype=int)  # (lone)
    node: wp.array(dtype=Inertia)  # (worlds * (count + roots)), at the centre of mass
    opening: wp.array(dtype=Opening)  # (worlds * count)
    shift: wp.array(dtype=wp.vec3)  # (worlds * (count + roots)), of the centre of mass
    turn: wp.array(dtype=wp.vec3)
    stale: wp.array(dtype=int)  # (worlds * (count + roots)), whether the inertia of a node is to be added up anew
    changed: wp.array(dtype=int)  # (worlds * count), whether friction of it, or of what it carries, did in the pass
    wrong: wp.array(dtype=float)  # (worlds * count), how far each joint was from where it should be


@wp.func
def arms_of(rigid: RigidState, joints: Joints, world: int, k: int):
    """Return a joint's bodies and its arms in both; a slider's other bears it where its own body is on the line."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
    other_arm = arm_of(rigid, j, joints.other_place[r])
    if joints.kind[k] == SLIDER and j >= 0:
        other_arm = point_before(rigid, i, joints.place[r]) - rigid.position_before[j]
    return i, j, arm_of(rigid, i, joints.place[r]), other_arm


@wp.func
def axis_before(rigid: RigidState, joints: Joints, world: int, k: int):
    """A joint's axis in the world where the substep began."""
    r = world * joints.count + k
    turn = joints.other_turn[r]
    if joints.other[k] >= 0:
        turn = rigid.rotation_before[world * rigid.capacity + joints.other[k]] * turn
    return wp.quat_rotate(turn, wp.vec3(0.0, 0.0, 1.0))


@wp.func
def start_along(rigid: RigidState, joints: Joints, world: int, k: int, axis: wp.vec3):
    """Return where a hinge or slider was along its free direction when the substep began."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    _place, _turn, place_before, other_before = other_frame(rigid, joints, world, k)
    start = float(0.0)
    if joints.kind[k] == HINGE:
        start = angle_about(other_before, rigid.rotation_before[i] * joints.turn[r])
    else:
        start = wp.dot(axis, point_before(rigid, i, joints.place[r]) - place_before)
    return start


@wp.func
def place_along(rigid: RigidState, joints: Joints, world: int, k: int, start: float):
    """Return where a hinge or slider is along its free direction, which was at ``start``."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    place, other_turn = other_frame_now(rigid, joints, world, k)
    now = float(0.0)
    if joints.kind[k] == HINGE:
        now = start + wrapped(angle_about(other_turn, rigid.rotation[i] * joints.turn[r]) - start)
    else:
        now_axis = wp.quat_rotate(other_turn, wp.vec3(0.0, 0.0, 1.0))
        now = wp.dot(now_axis, point_of(rigid, i, joints.place[r]) - place)
    return now


@wp.func
def begin_opening(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float):
    """Keep what of a joint stays as it is for a whole substep."""
    k = trees.joint[t]
    at = world * trees.count + t
    _i, _j, arm, other_arm = arms_of(rigid, joints, world, k)
    axis = axis_before(rigid, joints, world, k)
    left, left_off = joint_left(rigid, joints, world, k, dt)
    made = Opening()
    made.axis = axis
    made.arm = wp.where(trees.flipped[t] == 1, other_arm, arm)
    made.other_arm = wp.where(trees.flipped[t] == 1, arm, other_arm)
    made.left = left
    made.left_off = left_off
    if joints.kind[k] == HINGE or joints.kind[k] == SLIDER:
        made.start = start_along(rigid, joints, world, k, axis)
    trees.opening[at] = made


@wp.func
def open_joint(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float, may: int, stale: int):
    """Work out a joint's response to its carrier.

    Args:
        rigid: The rigid bodies.
        joints: The joints.
        trees: Their trees.
        world: Whose they are.
        t: The joint's place in the trees.
        dt: Of the substep [s].
        may: 0 where friction is to stay as it is, holding or sliding.
        stale: 1 where the inertia of what it carries is another than in the pass before, or there was none.

    Returns:
        How far it is from where it should be, beyond rounding, and 1 where the inertia that its carrier feels of it
        is another.
    """
    k = trees.joint[t]
    r = world * joints.count + k
    at = world * trees.count + t
    n = world * (trees.count + trees.roots) + t
    kind = joints.kind[k]
    sign = wp.where(trees.flipped[t] == 1, -1.0, 1.0)
    unit = wp.identity(n=3, dtype=float)
    first = wp.mat33(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    made = trees.opening[at]
    if stale == 1:
        made.whole = seen_from(trees.node[n], -made.arm)
    else:
        made.whole.force = trees.node[n].force
        made.whole.torque = trees.node[n].torque + wp.cross(-made.arm, trees.node[n].force)
    axis = made.axis
    apart, off = joint_misfit(rigid, joints, world, k)
    apart = apart - made.left
    off = off - made.left_off
    i = world * rigid.capacity + joints.slot[k]
    rounding = ROUNDING * (1.0 + wp.length(rigid.position[i]))
    wrong = wp.max(wp.max(wp.length(apart) - rounding, wp.length(off) - ROTATION_ROUNDING), 0.0)
    anew = stale
    if kind == HINGE:
        rounding = ROTATION_ROUNDING
    limit = LIMITED * joints.limit[r] * dt * dt
    if wp.length(joints.pull[r]) > limit or wp.length(joints.twist[r]) > limit:
        if made.alone == 0:
            anew = 1
        made.alone = 1
        shift, turn = rest_of(made.whole)
        made.shift = shift
        made.turn = turn
        made.drive = wp.vec3(0.0, 0.0, 0.0)
        made.carried.force = wp.vec3(0.0, 0.0, 0.0)
        made.carried.torque = wp.vec3(0.0, 0.0, 0.0)
        if anew == 1:
            made.along = wp.mat33(0.0)
            made.about = wp.mat33(0.0)
            made.push = wp.mat33(0.0)
            made.twist = wp.mat33(0.0)
            made.gives = wp.mat33(0.0)
            made.carried.a = wp.mat33(0.0)
            made.carried.b = wp.mat33(0.0)
            made.carried.c = wp.mat33(0.0)
    else:
        if made.alone == 1:
            anew = 1
        made.alone = 0
        made.shift = -sign * apart
        made.turn = -sign * off
        free = wp.mat33(0.0)  # 1 on the diagonal for each free direction
        stiff = wp.mat33(0.0)
        aim = wp.vec3(0.0, 0.0, 0.0)
        along = wp.mat33(0.0)
        about = wp.mat33(0.0)
        if kind == BALL:
            free = unit
            about = sign * unit
        if kind == HINGE or kind == SLIDER:
            line = wp.vec3(0.0, 0.0, 0.0)
            spin = sign * axis
            if kind == SLIDER:
                line = sign * axis
                spin = wp.vec3(0.0, 0.0, 0.0)
            if stale == 1:
                made.line = made.whole.a * line + made.whole.b * spin
                made.spin = wp.transpose(made.whole.b) * line + made.whole.c * spin
                made.inertia = wp.dot(line, made.line) + wp.dot(spin, made.spin)
            inertia = made.inertia
            pull = wp.dot(made.line, made.shift) + wp.dot(made.spin, made.turn)
            pull = pull + wp.dot(line, made.whole.force) + wp.dot(spin, made.whole.torque)
            start = made.start
            now = place_along(rigid, joints, world, k, start)
            old = joints.axial[r]
            went, slope, state = driven(
                joints.drive, r * DRIVES, 1.0 / inertia, start, now - (pull + old) / inertia, dt, joints.state[r], may
            )
            joints.state[r] = state
            end = now - (pull + old) / inertia + went
            if slope != made.slope:
                anew = 1
            made.slope = slope
            if wp.isinf(slope):
                made.shift = made.shift + line * (end - now)
                made.turn = made.turn + spin * (end - now)
                wrong = wp.max(wrong, wp.abs(end - now) - rounding)
            else:
                free = first
                stiff = first * slope
                aim = wp.vec3(went * inertia - slope * (now - end) - old, 0.0, 0.0)
                along = wp.outer(line, wp.vec3(1.0, 0.0, 0.0))
                about = wp.outer(spin, wp.vec3(1.0, 0.0, 0.0))
        if anew == 1:
            made.along = along
            made.about = about
            made.push = made.whole.a * along + made.whole.b * about
            made.twist = wp.transpose(made.whole.b) * along + made.whole.c * about
            # directions that are not free get a 1 that nothing else meets
            size = wp.trace(made.whole.c) + wp.trace(made.whole.a)
            d = wp.transpose(along) * made.push + wp.transpose(about) * made.twist + stiff + (unit - free) * size
            made.gives = free * inverted(d)
            made.carried.a = made.whole.a - made.push * made.gives * wp.transpose(made.push)
            made.carried.b = made.whole.b - made.push * made.gives * wp.transpose(made.twist)
            made.carried.c = made.whole.c - made.twist * made.gives * wp.transpose(made.twist)
        force = made.whole.force + made.whole.a * made.shift + made.whole.b * made.turn
        torque = made.whole.torque + wp.transpose(made.whole.b) * made.shift + made.whole.c * made.turn
        made.drive = aim - wp.transpose(made.along) * force - wp.transpose(made.about) * torque
        made.carried.force = force + made.push * (made.gives * made.drive)
        made.carried.torque = torque + made.twist * (made.gives * made.drive)
    trees.opening[at] = made
    return wrong, anew
