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

from nuno.coupled.articulated_inertia import added, body_inertia, rest_of, seen_from
from nuno.coupled.drive_constraints import project_ball
from nuno.coupled.joint_constraints import ROUNDING
from nuno.coupled.joint_opening import ROTATION_ROUNDING, Trees, arms_of, axis_before, begin_opening, open_joint
from nuno.coupled.joint_response import BALL, HINGE, SLIDER, Joints, apply_joint, block_of
from nuno.coupled.pass_progress import Passing, goes_on, island_of
from nuno.coupled.tie_constraints import within
from nuno.rigid.rigid_body import RigidState

PIVOTED = wp.constant(1.0e-6)
"""[rad or m] What counts as wrong where friction held or slid otherwise before the pass: others go by that."""


@wp.func
def close_joint(rigid: RigidState, joints: Joints, trees: Trees, world: int, t: int, dt: float):
    """Let a joint follow its carrier, and move both by what it bears."""
    k = trees.joint[t]
    r = world * joints.count + k
    nodes = world * (trees.count + trees.roots)
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
    opening = trees.opening[world * trees.count + t]
    shift = wp.vec3(0.0, 0.0, 0.0)
    turn = wp.vec3(0.0, 0.0, 0.0)
    below = opening.arm
    above = opening.other_arm
    arm = below
    other_arm = above
    sign = float(1.0)
    if trees.flipped[t] == 1:
        arm = above
        other_arm = below
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
        rounding = ROTATION_ROUNDING
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
    axis = opening.axis
    if joints.kind[k] == HINGE:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, twist)
    if joints.kind[k] == SLIDER:
        joints.axial[r] = joints.axial[r] + wp.dot(axis, pull)
    apply_joint(rigid, i, j, arm, other_arm, pull, twist)


@wp.func
def gather_node(rigid: RigidState, joints: Joints, trees: Trees, world: int, n: int):
    """Add up the inertia of a body and of what it carries; the forces are there already."""
    at = world * (trees.count + trees.roots) + n
    slot = int(0)
    if n >= trees.count:
        slot = trees.root[n - trees.count]
    else:
        k = trees.joint[n]
        slot = wp.where(trees.flipped[n] == 1, joints.other[k], joints.slot[k])
    own = body_inertia(rigid, world * rigid.capacity + slot)
    for back in range(trees.count):
        t = trees.count - 1 - back
        if trees.carrier[t] == n:
            opening = world * trees.count + t
            own = added(own, seen_from(trees.opening[opening].carried, trees.opening[opening].other_arm))
    trees.node[at].a = own.a
    trees.node[at].b = own.b
    trees.node[at].c = own.c


@wp.func
def project_trees(
    rigid: RigidState, joints: Joints, trees: Trees, passing: Passing, world: int, dt: float, k_pass: int
):
    """One pass over all trees of a world; `trees.wrong` tells how far each joint was from where it should be."""
    nodes = world * (trees.count + trees.roots)
    for n in range(trees.count + trees.roots):
        trees.stale[nodes + n] = wp.where(k_pass == 0, 1, 0)
        trees.node[nodes + n].force = wp.vec3(0.0, 0.0, 0.0)
        trees.node[nodes + n].torque = wp.vec3(0.0, 0.0, 0.0)
    for t in range(trees.count):
        trees.changed[world * trees.count + t] = 0
        if k_pass == 0:
            begin_opening(rigid, joints, trees, world, t, dt)
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
                force = trees.opening[at].carried.force
                arm = trees.opening[at].other_arm
                trees.node[n].force = trees.node[n].force + force
                trees.node[n].torque = trees.node[n].torque + (trees.opening[at].carried.torque + wp.cross(arm, force))
    for n in range(trees.roots):
        at = nodes + trees.count + n
        shift = wp.vec3(0.0, 0.0, 0.0)
        turn = wp.vec3(0.0, 0.0, 0.0)
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
    for t in range(trees.count):
        k = trees.joint[t]
        if joints.kind[k] == BALL:
            if goes_on(passing, island_of(passing, world, joints.body[k])):
                i, j, arm, other_arm = arms_of(rigid, joints, world, k)
                axis = axis_before(rigid, joints, world, k)
                project_ball(
                    rigid, joints, block_of(rigid, BALL, i, j, arm, other_arm, axis), world, k, dt, arm, other_arm
                )
