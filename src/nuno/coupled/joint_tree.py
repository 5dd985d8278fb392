"""Trees of joints, solved whole: every joint and what drives it at once, in time proportional to their number.

The articulated-body algorithm (Featherstone: "Rigid Body Dynamics Algorithms", Springer 2008, chapter 7) at the level
of positions. From the leaves to the root, each body takes up the inertia of what hangs on it,

    I_p += J_p^T (I - U D^-1 U^T) J_p,    U = I S,    D = S^T I S + a,

with S the joint's free directions and a the stiffness of what acts along them. From the root to the leaves, each joint
opens by q = D^-1 (u - U^T y_p). Here I y = f, with y a shift and a turn, and f a multiplier: force times the square of
the substep. Projected one after the other, n joints of a chain need some n^2 projections for the same.

Motors, springs, friction and stops are linear about where the joint ends, which `driven` tells as if its carrier stood
still. A joint at a stop or held by friction has no free direction. The next pass looks again.

What of this a pass leaves as it is, the next takes as it was: inertias, as long as no joint beyond changes its
stiffness (`nuno.coupled.joint_opening`). Forces alone are gone through in every pass.

Whether friction holds or slides is a linear complementarity problem, solved by pivots. Where all joints in a wrong
state change it at once, two that turn each other may let go and hold in turns for ever. So a joint changes its state
only where none that it carries does in the pass (single pivots in an order, as in Murty, "Note on a Bard-type scheme
for solving the complementarity problem", Opsearch 11, 1974), and one that slides the wrong way holds before it slides
the other way. A substep's first pass has the states of the substep before, a frame's none.
"""

import warp as wp

from nuno.coupled.articulated_inertia import body_inertia, rest_of, seen_from
from nuno.coupled.drive_constraints import project_ball
from nuno.coupled.joint_opening import (
    ENOUGH_ROTATION,
    ENOUGH_WAY,
    Trees,
    arms_of,
    axis_before,
    begin_opening,
    note_fit,
    open_joint,
)
from nuno.coupled.joint_response import BALL, HINGE, SLIDER, Joints, block_of
from nuno.coupled.pass_progress import Passing, goes_on, island_of
from nuno.coupled.tie_constraints import within
from nuno.rigid.rigid_body import RigidState, shift_body, turn_body

PIVOTED = wp.constant(1.0e-6)
"""[rad or m] What counts as wrong where friction held or slid otherwise before the pass: others go by that."""


@wp.func
def close_joint(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float):
    """Let a joint follow its carrier, and add what it bears to what its bodies are moved by."""
    k = trees.joint[t]
    r = world * joints.count + k
    at = world * trees.count + t
    nodes = world * (trees.count + trees.roots)
    carrier = trees.carrier[t]
    kind = joints.kind[k]
    shift = wp.vec3(0.0, 0.0, 0.0)
    turn = wp.vec3(0.0, 0.0, 0.0)
    sign = wp.where(trees.flipped[t] == 1, -1.0, 1.0)
    if carrier >= 0 and trees.opening[at].alone == 0:
        turn = trees.turn[nodes + carrier]
        shift = trees.shift[nodes + carrier] + wp.cross(turn, trees.opening[at].reach)
    carried = trees.carried[at]
    pull = sign * (carried.a * shift + carried.b * turn + carried.force)
    twist = sign * (shift * carried.b + carried.c * turn + carried.torque)
    axis = trees.opening[at].axis
    # what drives a joint goes by where it ends, and looks again until that stays
    went = float(0.0)
    if kind == BALL:
        held = shift * trees.node[nodes + t].b + trees.node[nodes + t].c * turn
        ball_turn = trees.opening[at].swivel * -held
        went = wp.length(ball_turn)
        turn = turn + ball_turn
    elif kind == HINGE or kind == SLIDER:
        way = wp.dot(trees.opening[at].push, shift) + wp.dot(trees.opening[at].twist, turn)
        q = trees.opening[at].gives * (trees.opening[at].drive - way)
        went = wp.abs(q)
        if kind == HINGE:
            turn = turn + (sign * q) * axis
        else:
            shift = shift + (sign * q) * axis
    trees.wrong[at] = wp.max(trees.wrong[at], went - wp.where(kind == SLIDER, ENOUGH_WAY, ENOUGH_ROTATION))
    trees.turn[nodes + t] = turn + trees.opening[at].turn
    trees.shift[nodes + t] = shift + trees.opening[at].shift
    limit = joints.limit[r] * dt * dt
    pull_sum = within(joints.pull[r] + pull, limit)
    twist_sum = within(joints.twist[r] + twist, limit)
    pull = pull_sum - joints.pull[r]
    twist = twist_sum - joints.twist[r]
    joints.pull[r] = pull_sum
    joints.twist[r] = twist_sum
    if kind == HINGE:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, twist)
    if kind == SLIDER:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, pull)
    pull = sign * pull
    twist = sign * twist
    n = nodes + t
    trees.pull[n] = trees.pull[n] + pull
    trees.twist[n] = trees.twist[n] + (wp.cross(trees.opening[at].arm, pull) + twist)
    if carrier >= 0:
        n = nodes + carrier
        trees.pull[n] = trees.pull[n] - pull
        trees.twist[n] = trees.twist[n] - (wp.cross(trees.opening[at].other_arm, pull) + twist)


@wp.func
def slot_of_node(joints: Joints, trees: Trees, n: int):
    """Return the slot of a node's body."""
    slot = int(0)
    if n >= trees.count:
        slot = trees.root[n - trees.count]
    else:
        k = trees.joint[n]
        slot = wp.where(trees.flipped[n] == 1, joints.other[k], joints.slot[k])
    return slot


@wp.func
def gather_node(rigid: RigidState, joints: Joints, trees: Trees, world: int, n: int):
    """Add up the inertia of a body and of what it carries; the forces are there already."""
    at = world * (trees.count + trees.roots) + n
    arm = wp.vec3(0.0, 0.0, 0.0)
    if n < trees.count:
        arm = trees.opening[world * trees.count + n].arm
    own = body_inertia(rigid, world * rigid.capacity + slot_of_node(joints, trees, n), arm)
    a = own.a
    b = own.b
    c = own.c
    t = trees.heir[n]
    while t >= 0:
        opening = world * trees.count + t
        seen = seen_from(trees.carried[opening], trees.opening[opening].reach)
        a = a + seen.a
        b = b + seen.b
        c = c + seen.c
        t = trees.next_heir[t]
    trees.node[at].a = a
    trees.node[at].b = b
    trees.node[at].c = c


@wp.func
def move_node(rigid: RigidState, joints: Joints, trees: Trees, passing: Passing, world: int, n: int):
    """Move a node's body by what its joints bear of the pass."""
    k = trees.joint[wp.where(n < trees.count, n, wp.max(trees.heir[n], 0))]
    if goes_on(passing, island_of(passing, world, joints.body[k])):
        i = world * rigid.capacity + slot_of_node(joints, trees, n)
        at = world * (trees.count + trees.roots) + n
        shift_body(rigid, i, rigid.weight[i] * trees.pull[at])
        turn_body(rigid, i, rigid.give[i] * trees.twist[at])


@wp.func
def project_trees(
    rigid: RigidState, joints: Joints, trees: Trees, passing: Passing, world: int, dt: float, k_pass: int
):
    """One pass over all trees of a world; `trees.wrong` tells how far each joint was from where it should be."""
    nodes = world * (trees.count + trees.roots)
    nothing = wp.vec3(0.0, 0.0, 0.0)
    for n in range(trees.count + trees.roots):
        trees.stale[nodes + n] = wp.where(k_pass == 0, 1, 0)
        trees.node[nodes + n].force = nothing
        trees.node[nodes + n].torque = nothing
        trees.pull[nodes + n] = nothing
        trees.twist[nodes + n] = nothing
    for t in range(trees.count):
        trees.changed[world * trees.count + t] = 0
        if k_pass == 0:
            begin_opening(rigid, joints, trees, world, t, dt)
        note_fit(rigid, joints, trees, world, t)
    for back in range(trees.count):
        t = trees.count - 1 - back
        k = trees.joint[t]
        at = world * trees.count + t
        if goes_on(passing, island_of(passing, world, joints.body[k])):
            if trees.stale[nodes + t] == 1:
                gather_node(rigid, joints, trees, world, t)
            may = wp.where(k_pass > 0 and trees.changed[at] == 0, 1, 0)
            state = joints.state[world * joints.count + k]
            wrong, anew = open_joint(rigid, joints, trees, world, t, dt, may, trees.stale[nodes + t])
            if joints.state[world * joints.count + k] != state:
                trees.changed[at] = 1
                wrong = wp.max(wrong, PIVOTED)
            trees.wrong[at] = wrong
            if trees.carrier[t] >= 0:
                n = nodes + trees.carrier[t]
                if trees.carrier[t] < trees.count:
                    carrying = world * trees.count + trees.carrier[t]
                    trees.changed[carrying] = wp.max(trees.changed[carrying], trees.changed[at])
                trees.stale[n] = wp.max(trees.stale[n], anew)
                force = trees.carried[at].force
                trees.node[n].force = trees.node[n].force + force
                trees.node[n].torque = trees.node[n].torque + (
                    trees.carried[at].torque + wp.cross(trees.opening[at].reach, force)
                )
    for n in range(trees.roots):
        at = nodes + trees.count + n
        shift = nothing
        turn = nothing
        if rigid.weight[world * rigid.capacity + trees.root[n]] > 0.0:
            if trees.stale[at] == 1:
                gather_node(rigid, joints, trees, world, trees.count + n)
            shift, turn = rest_of(trees.node[at])
        trees.shift[at] = shift
        trees.turn[at] = turn
    for t in range(trees.count):
        k = trees.joint[t]
        if goes_on(passing, island_of(passing, world, joints.body[k])):
            close_joint(rigid, joints, trees, world, t, dt)
    for n in range(trees.count + trees.roots):
        move_node(rigid, joints, trees, passing, world, n)
    for t in range(trees.count):
        k = trees.joint[t]
        if joints.kind[k] == BALL:
            if goes_on(passing, island_of(passing, world, joints.body[k])):
                i, j, arm, other_arm = arms_of(rigid, joints, world, k)
                axis = axis_before(rigid, joints, world, k)
                project_ball(
                    rigid, joints, block_of(rigid, BALL, i, j, arm, other_arm, axis), world, k, dt, arm, other_arm
                )
