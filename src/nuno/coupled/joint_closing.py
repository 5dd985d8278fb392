"""Joints closed again where one of their bodies was parted from what it is deep in.

What overlaps is parted by positions alone, which gives nothing a velocity, and body by body: a link that stands in a
wall is taken out of it alone, and its joints open. The next substep closes them. With contacts that let nothing come
nearer that is a contradiction: pass after pass both grow, by kilonewtons, until the link is flung away.

So joints are closed right away, by positions alone too, as an impulse on the whole tree would have moved it: motors,
springs and friction leave their free directions alone, and stops hold. Where a link cannot go without its tree, as
between two walls, it stays.
"""

import warp as wp

from nuno.coupled.joint_constraints import begin_joint, joint_at, project_joint, projections_of
from nuno.coupled.joint_opening import Trees
from nuno.coupled.joint_response import DRIVES, LOWER, UPPER, Joints
from nuno.coupled.joint_tree import project_trees
from nuno.coupled.pass_progress import Passing, goes_on, island_of
from nuno.rigid.rigid_body import RigidState

CLOSING_PASSES = wp.constant(4)
"""Passes: a tree needs one, and one more for stops and for the square of its turns."""
PARTED = wp.constant(2)
"""Of `RigidState.joined`: a body that was parted from what it is deep in."""


def limp_joints(joints: Joints, worlds: int, device: str) -> Joints:
    """Return the same joints with multipliers of their own, and room for drives of which only stops are left."""
    made = Joints()
    for name in Joints.vars:
        setattr(made, name, getattr(joints, name))
    for name, kind in (("pull", wp.vec3), ("twist", wp.vec3), ("free", wp.vec3), ("axial", float), ("state", int)):
        setattr(made, name, wp.zeros(worlds * joints.count, dtype=kind, device=device))
    made.drive = wp.zeros(worlds * joints.count * DRIVES, dtype=float, device=device)
    return made


@wp.func
def is_parted(rigid: RigidState, joints: Joints, world: int, k: int):
    """Return True if a body of joint k was parted from what it is deep in."""
    start = world * rigid.capacity
    parted = rigid.joined[start + joints.slot[k]] == PARTED
    if joints.other[k] >= 0:
        parted = parted or rigid.joined[start + joints.other[k]] == PARTED
    return parted


@wp.func
def take_parted(rigid: RigidState, joints: Joints, passing: Passing, world: int):
    """Let passes go on in islands whose joints are to be closed, and in no others; returns whether there are any."""
    found = int(0)
    if passing.many != 0:
        for b in range(passing.bodies):
            passing.done[world * passing.bodies + b] = 1
    for k in range(joints.count):
        if is_parted(rigid, joints, world, k):
            found = 1
            if passing.many != 0:
                passing.done[island_of(passing, world, joints.body[k])] = 0
    return found


@wp.func
def loosen_joint(joints: Joints, limp: Joints, world: int, k: int):
    """Give a limp joint the stops of the joint, and no multiplier."""
    begin_joint(limp, world, k)
    r = world * joints.count + k
    limp.state[r] = 0
    limp.drive[r * DRIVES + LOWER] = joints.drive[r * DRIVES + LOWER]
    limp.drive[r * DRIVES + UPPER] = joints.drive[r * DRIVES + UPPER]


@wp.kernel(enable_backward=False)
def close_joints(
    rigid: RigidState, joints: Joints, limp: Joints, trees: Trees, passing: Passing, dt: float, size: int,
    first_world: int,
):  # fmt: skip
    """Close the joints of islands in which one of their bodies was parted from what it is deep in."""
    tid = wp.tid()
    world = first_world + tid / size
    if tid % size == 0:
        if take_parted(rigid, joints, passing, world) != 0:
            for k in range(joints.count):
                loosen_joint(joints, limp, world, k)
            passes = int(CLOSING_PASSES)  # of a constant each pass would be compiled by itself
            for k_pass in range(passes):
                project_trees(rigid, limp, trees, passing, world, dt, k_pass)
                for at in range(projections_of(trees.lone)):
                    k = trees.alone[joint_at(trees.lone, at)]
                    if goes_on(passing, island_of(passing, world, limp.body[k])):
                        project_joint(rigid, limp, world, k, dt)
