"""Trees of joints, solved whole: every joint and what drives it at once, in time proportional to their number.

The articulated-body algorithm (Featherstone: "Rigid Body Dynamics Algorithms", Springer 2008, chapter 7) at the level
of positions. From the leaves to the root, each body takes up the inertia of what hangs on it,

    I_p += J_p^T (I - U D^-1 U^T) J_p,    U = I S,    D = S^T I S + a,

with S the joint's free directions and a the stiffness of what acts along them. From the root to the leaves, each joint
opens by q = D^-1 (u - U^T y_p). Here I y = f, with y a shift and a turn, and f a multiplier: force times the square of
the substep. Projected one after the other, n joints of a chain need some n^2 projections for the same.

Motors, springs, friction and stops are linear about where the joint ends, which `driven` tells as if its carrier stood
still. A joint at a stop or held by friction has no free direction. The next pass looks again.

Whether friction holds or slides is a linear complementarity problem, solved by pivots. Where all joints in a wrong
state change it at once, two that turn each other may let go and hold in turns for ever. So a joint changes its state
only where none that it carries does in the pass (single pivots in an order, as in Murty, "Note on a Bard-type scheme
for solving the complementarity problem", Opsearch 11, 1974), and one that slides the wrong way holds before it slides
the other way. A substep's first pass has the states of the substep before, a frame's none.
"""

import warp as wp

from nuno.coupled.drive_constraints import angle_about, driven, project_ball, wrapped
from nuno.coupled.joint_constraints import ROUNDING, joint_apart
from nuno.coupled.joint_response import (
    BALL,
    DRIVES,
    HINGE,
    SLIDER,
    Joints,
    apply_joint,
    arm_of,
    block_of,
    inverted,
    other_frame,
)
from nuno.coupled.pass_progress import Passing, goes_on, island_of
from nuno.coupled.tie_constraints import within
from nuno.rigid.rigid_body import RigidState, point_before, point_of

LIMITED = wp.constant(0.999)
"""Of a joint's limit, from where on it bears no more in the substep."""

TURN_ROUNDING = wp.constant(2.0e-6)
"""[rad] What rounding leaves of a joint's turn: of two bodies' turns and their products with its frames 0.7e-6, and as
much again of contacts, whose own rounding of 4e-7 m turns a foot by 3e-6. Passes that go on below mend nothing."""


@wp.struct
class Inertia:
    """Multipliers that shift a frame by x and turn it by t: force + a x + b t, and torque + b^T x + c t."""

    a: wp.mat33
    b: wp.mat33
    c: wp.mat33
    force: wp.vec3
    torque: wp.vec3


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
    changed: wp.array(dtype=int)  # (worlds * count), whether friction of it, or of what it carries, did in the pass
    wrong: wp.array(dtype=float)  # (worlds * count), how far each joint was from where it should be


@wp.func
def seen_from(own: Inertia, arm: wp.vec3):
    """The inertia of a frame as that of another of the same body, from which ``arm`` leads to it."""
    s = wp.skew(arm)
    made = Inertia()
    made.a = own.a
    made.b = own.b - own.a * s
    made.c = own.c + s * own.b - wp.transpose(own.b) * s - s * own.a * s
    made.force = own.force
    made.torque = own.torque + wp.cross(arm, own.force)
    return made


@wp.func
def added(one: Inertia, other: Inertia):
    """The sum of two inertias of one frame."""
    made = Inertia()
    made.a = one.a + other.a
    made.b = one.b + other.b
    made.c = one.c + other.c
    made.force = one.force + other.force
    made.torque = one.torque + other.torque
    return made


@wp.func
def rest_of(own: Inertia):
    """Return the shift and turn of a frame that nothing carries."""
    inverse = inverted(own.a)
    across = wp.transpose(own.b) * inverse
    turn = -(inverted(own.c - across * own.b) * (own.torque - across * own.force))
    shift = -(inverse * (own.force + own.b * turn))
    return shift, turn


@wp.func
def body_inertia(rigid: RigidState, i: int):
    """A rigid body's own inertia at its centre of mass; without mass, none."""
    made = Inertia()
    if rigid.weight[i] > 0.0:
        made.a = wp.identity(n=3, dtype=float) / rigid.weight[i]
        made.c = inverted(rigid.give[i])
    return made


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
def places_along(rigid: RigidState, joints: Joints, world: int, k: int, axis: wp.vec3):
    """Return where a hinge or slider was along its free direction when the substep began, and where it is."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    place, other_turn, place_before, other_before = other_frame(rigid, joints, world, k)
    start = float(0.0)
    now = float(0.0)
    if joints.kind[k] == HINGE:
        start = angle_about(other_before, rigid.rotation_before[i] * joints.turn[r])
        now = start + wrapped(angle_about(other_turn, rigid.rotation[i] * joints.turn[r]) - start)
    else:
        now_axis = wp.quat_rotate(other_turn, wp.vec3(0.0, 0.0, 1.0))
        start = wp.dot(axis, point_before(rigid, i, joints.place[r]) - place_before)
        now = wp.dot(now_axis, point_of(rigid, i, joints.place[r]) - place)
    return start, now


@wp.func
def open_joint(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, own: Inertia, dt: float, may: int):
    """Return a joint's response to its carrier, and how far it is from where it should be, beyond rounding.

    Args:
        rigid: The rigid bodies.
        joints: The joints.
        trees: Their trees.
        world: Whose they are.
        t: The joint's place in the trees.
        own: The inertia of what it carries, as seen from the joint.
        dt: Of the substep [s].
        may: 0 where friction is to stay as it is, holding or sliding.
    """
    k = trees.joint[t]
    r = world * joints.count + k
    kind = joints.kind[k]
    sign = wp.where(trees.flipped[t] == 1, -1.0, 1.0)
    unit = wp.identity(n=3, dtype=float)
    first = wp.mat33(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    axis = axis_before(rigid, joints, world, k)
    apart, off = joint_apart(rigid, joints, world, k, dt)
    i = world * rigid.capacity + joints.slot[k]
    rounding = ROUNDING * (1.0 + wp.length(rigid.position[i]))
    wrong = wp.max(wp.max(wp.length(apart) - rounding, wp.length(off) - TURN_ROUNDING), 0.0)
    if kind == HINGE:
        rounding = TURN_ROUNDING
    made = Opening()
    limit = LIMITED * joints.limit[r] * dt * dt
    if wp.length(joints.pull[r]) > limit or wp.length(joints.twist[r]) > limit:
        made.alone = 1
        shift, turn = rest_of(own)
        made.shift = shift
        made.turn = turn
    else:
        made.shift = -sign * apart
        made.turn = -sign * off
        free = wp.mat33(0.0)  # 1 on the diagonal for each free direction
        stiff = wp.mat33(0.0)
        aim = wp.vec3(0.0, 0.0, 0.0)
        if kind == BALL:
            free = unit
            made.about = sign * unit
        if kind == HINGE or kind == SLIDER:
            along = wp.vec3(0.0, 0.0, 0.0)
            about = sign * axis
            if kind == SLIDER:
                along = sign * axis
                about = wp.vec3(0.0, 0.0, 0.0)
            push = own.a * along + own.b * about
            twist = wp.transpose(own.b) * along + own.c * about
            inertia = wp.dot(along, push) + wp.dot(about, twist)
            pull = wp.dot(push, made.shift) + wp.dot(twist, made.turn)
            pull = pull + wp.dot(along, own.force) + wp.dot(about, own.torque)
            start, now = places_along(rigid, joints, world, k, axis)
            old = joints.axial[r]
            went, slope, state = driven(
                joints.drive, r * DRIVES, 1.0 / inertia, start, now - (pull + old) / inertia, dt, joints.state[r], may
            )
            joints.state[r] = state
            end = now - (pull + old) / inertia + went
            if wp.isinf(slope):
                made.shift = made.shift + along * (end - now)
                made.turn = made.turn + about * (end - now)
                wrong = wp.max(wrong, wp.abs(end - now) - rounding)
            else:
                free = first
                stiff = first * slope
                aim = wp.vec3(went * inertia - slope * (now - end) - old, 0.0, 0.0)
                made.along = wp.outer(along, wp.vec3(1.0, 0.0, 0.0))
                made.about = wp.outer(about, wp.vec3(1.0, 0.0, 0.0))
        made.push = own.a * made.along + own.b * made.about
        made.twist = wp.transpose(own.b) * made.along + own.c * made.about
        # directions that are not free get a 1 that nothing else meets
        size = wp.trace(own.c) + wp.trace(own.a)
        d = wp.transpose(made.along) * made.push + wp.transpose(made.about) * made.twist + stiff + (unit - free) * size
        made.gives = free * inverted(d)
        force = own.force + own.a * made.shift + own.b * made.turn
        torque = own.torque + wp.transpose(own.b) * made.shift + own.c * made.turn
        made.drive = aim - wp.transpose(made.along) * force - wp.transpose(made.about) * torque
        made.carried.a = own.a - made.push * made.gives * wp.transpose(made.push)
        made.carried.b = own.b - made.push * made.gives * wp.transpose(made.twist)
        made.carried.c = own.c - made.twist * made.gives * wp.transpose(made.twist)
        made.carried.force = force + made.push * (made.gives * made.drive)
        made.carried.torque = torque + made.twist * (made.gives * made.drive)
    return made, wrong


@wp.func
def close_joint(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float):
    """Let a joint follow its carrier, and move both by what it bears."""
    k = trees.joint[t]
    r = world * joints.count + k
    nodes = world * (trees.count + trees.roots)
    i, j, arm, other_arm = arms_of(rigid, joints, world, k)
    opening = trees.opening[world * trees.count + t]
    shift = wp.vec3(0.0, 0.0, 0.0)
    turn = wp.vec3(0.0, 0.0, 0.0)
    below = arm
    above = other_arm
    sign = float(1.0)
    if trees.flipped[t] == 1:
        below = other_arm
        above = arm
        sign = -1.0
    if trees.carrier[t] >= 0 and opening.alone == 0:
        turn = trees.turn[nodes + trees.carrier[t]]
        shift = trees.shift[nodes + trees.carrier[t]] + wp.cross(turn, above)
    pull = sign * (opening.carried.a * shift + opening.carried.b * turn + opening.carried.force)
    twist = sign * (wp.transpose(opening.carried.b) * shift + opening.carried.c * turn + opening.carried.torque)
    q = opening.gives * (opening.drive - wp.transpose(opening.push) * shift - wp.transpose(opening.twist) * turn)
    turn = turn + opening.turn + opening.about * q
    shift = shift + opening.shift + opening.along * q
    # what drives a joint goes by where it ends, and looks again until that stays
    at = world * trees.count + t
    rounding = ROUNDING * (1.0 + wp.length(rigid.position[i]))
    if joints.kind[k] == HINGE or joints.kind[k] == BALL:
        rounding = TURN_ROUNDING
    trees.wrong[at] = wp.max(trees.wrong[at], wp.length(q) - rounding)
    trees.turn[nodes + t] = turn
    trees.shift[nodes + t] = shift - wp.cross(turn, below)
    limit = joints.limit[r] * dt * dt
    pull_sum = within(joints.pull[r] + pull, limit)
    twist_sum = within(joints.twist[r] + twist, limit)
    pull = pull_sum - joints.pull[r]
    twist = twist_sum - joints.twist[r]
    joints.pull[r] = pull_sum
    joints.twist[r] = twist_sum
    axis = axis_before(rigid, joints, world, k)
    if joints.kind[k] == HINGE:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, twist)
    if joints.kind[k] == SLIDER:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, pull)
    apply_joint(rigid, i, j, arm, other_arm, pull, twist)


@wp.func
def project_trees(
    rigid: RigidState, joints: Joints, trees: Trees, passing: Passing, world: int, dt: float, k_pass: int
):
    """One pass over all trees of a world; `trees.wrong` tells how far each joint was from where it should be."""
    nodes = world * (trees.count + trees.roots)
    for t in range(trees.count):
        trees.changed[world * trees.count + t] = 0
        k = trees.joint[t]
        slot = wp.where(trees.flipped[t] == 1, joints.other[k], joints.slot[k])
        trees.node[nodes + t] = body_inertia(rigid, world * rigid.capacity + slot)
    for n in range(trees.roots):
        trees.node[nodes + trees.count + n] = body_inertia(rigid, world * rigid.capacity + trees.root[n])
    for back in range(trees.count):
        t = trees.count - 1 - back
        k = trees.joint[t]
        if goes_on(passing, island_of(passing, world, joints.body[k])):
            i, j, arm, other_arm = arms_of(rigid, joints, world, k)
            below = arm
            above = other_arm
            if trees.flipped[t] == 1:
                below = other_arm
                above = arm
            may = wp.where(k_pass > 0 and trees.changed[world * trees.count + t] == 0, 1, 0)
            state = joints.state[world * joints.count + k]
            opening, wrong = open_joint(
                rigid, joints, trees, world, t, seen_from(trees.node[nodes + t], -below), dt, may
            )
            if joints.state[world * joints.count + k] != state:
                trees.changed[world * trees.count + t] = 1
            if trees.carrier[t] >= 0 and trees.carrier[t] < trees.count:
                carrying = world * trees.count + trees.carrier[t]
                trees.changed[carrying] = wp.max(trees.changed[carrying], trees.changed[world * trees.count + t])
            trees.opening[world * trees.count + t] = opening
            trees.wrong[world * trees.count + t] = wrong
            if trees.carrier[t] >= 0:
                n = nodes + trees.carrier[t]
                trees.node[n] = added(trees.node[n], seen_from(opening.carried, above))
    for n in range(trees.roots):
        at = nodes + trees.count + n
        shift = wp.vec3(0.0, 0.0, 0.0)
        turn = wp.vec3(0.0, 0.0, 0.0)
        if rigid.weight[world * rigid.capacity + trees.root[n]] > 0.0:
            shift, turn = rest_of(trees.node[at])
        trees.shift[at] = shift
        trees.turn[at] = turn
    for t in range(trees.count):
        k = trees.joint[t]
        if goes_on(passing, island_of(passing, world, joints.body[k])):
            close_joint(rigid, joints, trees, world, t, dt)
    for t in range(trees.count):
        k = trees.joint[t]
        if joints.kind[k] == BALL:
            if goes_on(passing, island_of(passing, world, joints.body[k])):
                i, j, arm, other_arm = arms_of(rigid, joints, world, k)
                axis = axis_before(rigid, joints, world, k)
                project_ball(
                    rigid, joints, block_of(rigid, BALL, i, j, arm, other_arm, axis), world, k, dt, arm, other_arm
                )
