"""Contacts of rigid bodies within the passes over joints, and over cloth that lies between rigid bodies.

What a heavy body presses on a light one that is joined, the joint has to bear: solved one after the other, once each
substep, the light one would give way to the contact and come back by the joint, and nothing on it would rest. So where
an island has joints its manifolds are gone through in every pass, before the joints. Their forces add up over the
passes and last from substep to substep, as those of all manifolds do. The same holds where a plate on a table bears
others on napkins: it would give way to them in each substep, and the pile would tremble.
"""

import warp as wp

from nuno.coupled.joint_response import Joints
from nuno.coupled.pass_progress import Passing, goes_on, is_linked, island_of, note_wrong
from nuno.numbers.crew import barrier
from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import COLOURS, COUNTS, FAR, POINTS, Contacts
from nuno.rigid.rigid_body import RigidState, rotation_between
from nuno.rigid.rigid_contact import part_entry

ROUNDING = wp.constant(2.0e-7)
"""[m] What rounding of coordinates leaves of a contact, at a metre from the origin."""


@wp.func
def resolve_entry(rigid: RigidState, parts: Parts, c: Contacts, world: int, e: int, i: int, j: int, dt: float):
    """Take one pass over a manifold; returns how far that moved its bodies at the contact, beyond rounding [m]."""
    a = rigid.position[i]
    b = rigid.position[j]
    turn_a = rigid.rotation[i]
    turn_b = rigid.rotation[j]
    part_entry(rigid, parts, c, world, e, dt)
    o = e * POINTS
    arm_a = c.arm_a[o]
    arm_b = c.arm_b[o]
    if c.start[o][0] >= FAR:  # a point that is far away has the arms of whenever it was near last
        arm_a = c.local_a[o]
        arm_b = c.local_b[o]
    went_a = wp.length(rigid.position[i] - a)
    went_a = went_a + wp.length(rotation_between(turn_a, rigid.rotation[i])) * wp.length(arm_a)
    went_b = wp.length(rigid.position[j] - b)
    went_b = went_b + wp.length(rotation_between(turn_b, rigid.rotation[j])) * wp.length(arm_b)
    floor = ROUNDING * (1.0 + wp.max(wp.length(a), wp.length(b)))
    return wp.max(wp.max(went_a, went_b) - floor, 0.0)


@wp.func
def island_with_passes(joints: Joints, passing: Passing, world: int, a: int, b: int):
    """The body among the coupled ones by which a manifold of two slots is gone through in every pass, or -1.

    None is where neither a joint nor cloth between rigid bodies is in the island, nor between two bodies that are
    joined to each other: that may contradict the joint, and pass after pass both would grow.
    """
    body = wp.max(passing.body_of[a], passing.body_of[b])
    if body >= 0:
        if passing.jointed[world * passing.bodies + body] == 0 and is_linked(passing, world, body) == 0:
            body = -1
    for k in range(joints.count):
        if wp.min(joints.slot[k], joints.other[k]) == wp.min(a, b):
            if wp.max(joints.slot[k], joints.other[k]) == wp.max(a, b):
                body = -1
    return body


@wp.func
def resolve_entries(
    rigid: RigidState, parts: Parts, c: Contacts, joints: Joints, passing: Passing, world: int, dt: float, k_pass: int,
    rowed: bool, rank: int, size: int,
):  # fmt: skip
    """Take one pass over the manifolds of such islands; returns how far that moved anything [m].

    Not in the first pass: forces are those that the last substep ended with, and joints bear none yet. With joints
    first, what rests is where it should be after one pass.
    """
    wrong = float(0.0)
    base = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + COLOURS]):
        for k in range(c.bounds[base + r] + rank, c.bounds[base + r + 1], size):
            e = c.order[base + k]
            a = parts.slot[(e - base) / c.row]
            b = parts.slot[c.partner[e]]
            body = island_with_passes(joints, passing, world, a, b)
            if body >= 0:
                island = island_of(passing, world, body)
                if goes_on(passing, island):
                    i = world * rigid.capacity + a
                    j = world * rigid.capacity + b
                    off = float(1.0)
                    if k_pass > 0:
                        off = resolve_entry(rigid, parts, c, world, e, i, j, dt)
                    # once rows are left as they are, only joints are gone on for
                    if rowed or passing.jointed[world * passing.bodies + body] != 0:
                        note_wrong(passing, island, off, size)
                        wrong = wp.max(wrong, off)
        barrier(size)
    return wrong


@wp.func
def resolve_others(
    rigid: RigidState, parts: Parts, c: Contacts, joints: Joints, passing: Passing, world: int, dt: float, rank: int,
    size: int,
):  # fmt: skip
    """Take one pass over all other manifolds, and over those of bodies that are held entirely: see `stand_on`."""
    base = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + COLOURS]):
        for k in range(c.bounds[base + r] + rank, c.bounds[base + r + 1], size):
            e = c.order[base + k]
            a = parts.slot[(e - base) / c.row]
            b = parts.slot[c.partner[e]]
            held = rigid.weight[world * rigid.capacity + a] < 0.0 or rigid.weight[world * rigid.capacity + b] < 0.0
            if held or island_with_passes(joints, passing, world, a, b) < 0:
                part_entry(rigid, parts, c, world, e, dt)
        barrier(size)
