"""Joints of trees from the leaves to the root: each one's response to its carrier. See `nuno.coupled.joint_tree`."""

import warp as wp

from nuno.coupled.articulated_inertia import Inertia, rest_of
from nuno.coupled.drive_constraints import angle_about, driven, motor_bound
from nuno.coupled.joint_constraints import ROUNDING, joint_before
from nuno.coupled.joint_response import (
    BALL,
    DRIVES,
    HINGE,
    SLIDER,
    Joints,
    arm_of,
    inverted,
    other_frame,
)
from nuno.coupled.tie_constraints import CATCH_UP, left_over
from nuno.rigid.rigid_body import RigidState, fine_turn, point_before

LIMITED = wp.constant(0.999)
"""Of a joint's limit, from where on it bears no more in the substep."""

ENOUGH_ROTATION = wp.constant(2.0e-6)
"""[rad] From which on a joint's turn asks for another pass. Rounding leaves 0.7e-6 of two bodies' turns and their
products with its frames, and contacts, whose own rounding of 4e-7 m turns a foot by 3e-6, as much again. What a pass
finds it also mends, but for the square of it, so that what is left is far less. Friction that lets go or takes hold
counts as wrong however little that turns, see `nuno.coupled.joint_tree.PIVOTED`."""
ENOUGH_WAY = wp.constant(3.0e-6)
"""[m] The same of a slider's way."""


@wp.struct
class Opening:
    """Response of a joint of a tree to the body that carries it, at the joint's point."""

    push: wp.vec3  # U of a hinge or slider: a force,
    twist: wp.vec3  # and a torque
    gives: float  # D^-1; 0 where nothing is free
    swivel: wp.mat33  # D^-1 of a ball joint
    drive: float  # u
    shift: wp.vec3  # what it takes back of a wrong place, and what it is driven by where that is given,
    turn: wp.vec3  # and of a wrong turn
    alone: int  # 1: what hangs on it follows nothing
    inertia: float  # what a unit of way takes along a free direction
    slope: float  # stiffness of what drives it
    axis: wp.vec3  # where the substep began
    arm: wp.vec3  # to the joint, of what it carries
    other_arm: wp.vec3  # and of what carries it
    reach: wp.vec3  # to the joint, from where the inertia of what carries it is taken
    start: float  # where it was along its free direction
    apart: wp.vec3  # how far its frames were from each other: places,
    off: wp.vec3  # and turns
    left: wp.vec3  # of a wrong place, and of a wrong turn, what may not be mended in the substep
    left_off: wp.vec3


@wp.struct
class Fit:
    """The frames of a joint against each other."""

    apart: wp.vec3  # places that should not be apart, beyond what may stay so in the substep
    off: wp.vec3  # turns that should not be, likewise
    along: float  # of a hinge or slider, where it is along its free direction


@wp.struct
class Trees:
    """Joints that make trees, those that carry before those that are carried, and the joints that are in none."""

    count: int  # joints in trees
    roots: int  # bodies that no joint carries
    lone: int  # joints in no tree
    joint: wp.array(dtype=int)  # (count)
    carrier: wp.array(dtype=int)  # (count) the node that carries: a joint's place here, or count and a root's; -1: none
    flipped: wp.array(dtype=int)  # (count) 1 where it carries its own body's other
    heir: wp.array(dtype=int)  # (count + roots) the last joint that a node carries, -1: none
    next_heir: wp.array(dtype=int)  # (count) the one before that the same node carries
    root: wp.array(dtype=int)  # (roots) slot
    alone: wp.array(dtype=int)  # (lone)
    node: wp.array(dtype=Inertia)  # (worlds * (count + roots)), at the joint's point, of roots at the centre of mass
    carried: wp.array(dtype=Inertia)  # (worlds * count), what a carrier feels of it at the joint's point
    opening: wp.array(dtype=Opening)  # (worlds * count)
    fit: wp.array(dtype=Fit)  # (worlds * count), in this pass
    shift: wp.array(dtype=wp.vec3)  # (worlds * (count + roots)), of where the node's inertia is taken
    turn: wp.array(dtype=wp.vec3)
    pull: wp.array(dtype=wp.vec3)  # (worlds * (count + roots)), what joints bear of a pass, on the node's body,
    twist: wp.array(dtype=wp.vec3)  # about its centre of mass
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
def half_turn(rigid: RigidState, i: int):
    """The turn of a body since the substep began, as the tangent of half its angle along its axis; i below 0: none."""
    turn = wp.vec3(0.0, 0.0, 0.0)
    if i >= 0:
        turn = 0.5 * fine_turn(rigid.rotation_before[i], rigid.rotation[i])
    return turn


@wp.func
def carried_by(turn: wp.vec3, arm: wp.vec3):
    """Return how far a `half_turn` takes the end of an arm."""
    across = wp.cross(turn, arm)
    return (2.0 / (1.0 + wp.dot(turn, turn))) * (across + wp.cross(turn, across))


@wp.func
def note_fit(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int):
    """Note how a joint's frames are against each other: of all joints before any moves, as none needs another's.

    From where the substep began on, by what the bodies moved since: small numbers have more digits than quaternions.
    Of frames put together anew floats would round 0.7 urad, and passes go on for that.
    """
    k = trees.joint[t]
    at = world * trees.count + t
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
    kind = joints.kind[k]
    flipped = trees.flipped[t] == 1
    axis = trees.opening[at].axis
    arm = wp.where(flipped, trees.opening[at].other_arm, trees.opening[at].arm)
    other_arm = wp.where(flipped, trees.opening[at].arm, trees.opening[at].other_arm)
    turn = half_turn(rigid, i)
    other_turn = half_turn(rigid, j)
    away = rigid.position[i] - rigid.position_before[i] + carried_by(turn, arm)
    if j >= 0:
        away = away - (rigid.position[j] - rigid.position_before[j] + carried_by(other_turn, other_arm))
    # of the two against each other
    turned = (turn - other_turn - wp.cross(other_turn, turn)) / (1.0 + wp.dot(turn, other_turn))
    apart = trees.opening[at].apart + away
    off = trees.opening[at].off
    made = Fit()
    if kind == HINGE:
        line = axis + wp.cross(off, axis)  # of the body's own frame
        u = carried_by(other_turn, axis)
        v = carried_by(turn, line)
        off = off + (wp.cross(axis, v) + wp.cross(u, line) + wp.cross(u, v))
        made.along = trees.opening[at].start + 2.0 * wp.atan(wp.dot(turned, axis))
    elif kind == SLIDER:
        now = axis + carried_by(other_turn, axis)
        # the place on the line goes with the other body: what it is away now is along the line, or wrong
        along = wp.dot(now, away)
        apart = apart - now * along
        off = off + 2.0 * turned
        made.along = trees.opening[at].start + along
    elif kind != BALL:
        off = off + 2.0 * turned
    made.apart = apart - trees.opening[at].left
    made.off = off - trees.opening[at].left_off
    trees.fit[at] = made


@wp.func
def begin_opening(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float):
    """Keep what of a joint stays as it is for a whole substep; those of joints that carry it come before."""
    k = trees.joint[t]
    at = world * trees.count + t
    _i, _j, arm, other_arm = arms_of(rigid, joints, world, k)
    axis = axis_before(rigid, joints, world, k)
    apart, off = joint_before(rigid, joints, world, k)
    made = Opening()
    made.axis = axis
    made.arm = wp.where(trees.flipped[t] == 1, other_arm, arm)
    made.other_arm = wp.where(trees.flipped[t] == 1, arm, other_arm)
    made.reach = made.other_arm
    carrier = trees.carrier[t]
    if carrier >= 0 and carrier < trees.count:
        made.reach = made.other_arm - trees.opening[world * trees.count + carrier].arm
    made.apart = apart
    made.off = off
    made.left = left_over(apart, CATCH_UP * dt)
    made.left_off = left_over(off, CATCH_UP * dt)
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
    apart = trees.fit[at].apart
    off = trees.fit[at].off
    place = trees.fit[at].along
    i = world * rigid.capacity + joints.slot[k]
    rounding = ROUNDING * (1.0 + wp.length(rigid.position[i]))
    wrong = wp.max(wp.max(wp.length(apart) - rounding, wp.length(off) - ENOUGH_ROTATION), 0.0)
    anew = stale
    limit = LIMITED * joints.limit[r] * dt * dt
    if wp.length_sq(joints.pull[r]) > limit * limit or wp.length_sq(joints.twist[r]) > limit * limit:
        if trees.opening[at].alone == 0:
            anew = 1
        trees.opening[at].alone = 1
        shift, turn = rest_of(trees.node[n])
        trees.opening[at].shift = shift
        trees.opening[at].turn = turn
        trees.opening[at].drive = 0.0
        trees.opening[at].gives = 0.0
        trees.opening[at].push = wp.vec3(0.0, 0.0, 0.0)
        trees.opening[at].twist = wp.vec3(0.0, 0.0, 0.0)
        trees.opening[at].swivel = wp.mat33(0.0)
        trees.carried[at] = Inertia()
        return wrong, anew
    if trees.opening[at].alone == 1:
        anew = 1
    trees.opening[at].alone = 0
    a = trees.node[n].a
    b = trees.node[n].b
    c = trees.node[n].c
    shift = -sign * apart
    turn = -sign * off
    force = trees.node[n].force + (a * shift + b * turn)
    torque = trees.node[n].torque + (shift * b + c * turn)
    if kind == HINGE or kind == SLIDER:
        axis = sign * trees.opening[at].axis
        if stale == 1:
            # of a unit of way along the free direction
            if kind == HINGE:
                trees.opening[at].push = b * axis
                trees.opening[at].twist = c * axis
                trees.opening[at].inertia = wp.dot(axis, trees.opening[at].twist)
            else:
                trees.opening[at].push = a * axis
                trees.opening[at].twist = axis * b
                trees.opening[at].inertia = wp.dot(axis, trees.opening[at].push)
        inertia = trees.opening[at].inertia
        push = trees.opening[at].push
        twist = trees.opening[at].twist
        along = wp.dot(axis, force)
        if kind == HINGE:
            along = wp.dot(axis, torque)
            rounding = ENOUGH_ROTATION
        else:
            rounding = ENOUGH_WAY
        old = joints.axial[r]
        w = 1.0 / inertia
        free = place - (along + old) * w
        bound = motor_bound(joints, r, dt)
        went, slope, state = driven(
            joints.drive, r * DRIVES, w, trees.opening[at].start, free, dt, joints.state[r], may, bound
        )
        joints.state[r] = state
        end = free + went
        if slope != trees.opening[at].slope:
            anew = 1
        trees.opening[at].slope = slope
        step = end - place
        if wp.isinf(slope):
            if kind == HINGE:
                turn = turn + axis * step
            else:
                shift = shift + axis * step
            force = force + push * step
            torque = torque + twist * step
            wrong = wp.max(wrong, wp.abs(step) - rounding)
            trees.opening[at].gives = 0.0
            trees.opening[at].drive = 0.0
            if anew == 1:
                trees.carried[at].a = a
                trees.carried[at].b = b
                trees.carried[at].c = c
        else:
            gives = 1.0 / (inertia + slope)
            drive = went * inertia + slope * step - old - along
            force = force + push * (gives * drive)
            torque = torque + twist * (gives * drive)
            trees.opening[at].gives = gives
            trees.opening[at].drive = drive
            if anew == 1:
                far_push = gives * push
                trees.carried[at].a = a - wp.outer(far_push, push)
                trees.carried[at].b = b - wp.outer(far_push, twist)
                trees.carried[at].c = c - wp.outer(gives * twist, twist)
    elif kind == BALL:
        # it turns with nothing: what is carried is a mass at its point
        if anew == 1:
            swivel = inverted(c)
            trees.opening[at].swivel = swivel
            trees.carried[at].a = a - b * swivel * wp.transpose(b)
            trees.carried[at].b = wp.mat33(0.0)
            trees.carried[at].c = wp.mat33(0.0)
        free_turn = trees.opening[at].swivel * -torque
        turn = turn + free_turn
        force = force + b * free_turn
        torque = wp.vec3(0.0, 0.0, 0.0)
    elif anew == 1:
        trees.carried[at].a = a
        trees.carried[at].b = b
        trees.carried[at].c = c
    trees.opening[at].shift = shift
    trees.opening[at].turn = turn
    trees.carried[at].force = force
    trees.carried[at].torque = torque
    return wrong, anew
