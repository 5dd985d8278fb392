"""Contacts of rigid bodies within the passes over joints, and over cloth that lies between rigid bodies.

What a heavy body presses on a light one that is joined, the joint has to bear: solved one after the other, once each
substep, the light one would give way to the contact and come back by the joint, and nothing on it would rest. So where
an island has joints its manifolds are gone through in every pass, before the joints. Their forces add up over the
passes and last from substep to substep, as those of all manifolds do. The same holds where a plate on a table bears
others on napkins: it would give way to them in each substep, and the pile would tremble.

By one thread, a manifold of a tree's body and what does not give is solved by the body's reply, see
`nuno.coupled.tree_replies`.
"""

import warp as wp

from nuno.coupled.joint_opening import Reply, Trees
from nuno.coupled.joint_response import Joints
from nuno.coupled.pass_progress import Passing, goes_on, is_linked, island_of, note_wrong
from nuno.coupled.tree_replies import ask_reply, node_of, push_node
from nuno.numbers.crew import barrier
from nuno.rigid.convex import Parts
from nuno.rigid.pair_motion import Going, Meeting, against, meeting_of, places_of
from nuno.rigid.persistent_manifolds import COLOURS, COUNTS, FAR, POINTS, Contacts
from nuno.rigid.rigid_body import RigidState
from nuno.rigid.rigid_contact import PLACES, beyond, limited, note_approach, part_entry

ROUNDING = wp.constant(2.0e-7)
"""[m] What rounding of coordinates leaves of a contact, at a metre from the origin."""
MENDED = wp.constant(5.0e-7)
"""[m] The same of a tree's body on what does not give: a pass mends it at once, so that a tenth is left of what it
found. Where others give, too, they take turns, and what is left is as much."""


SWEEPS = wp.constant(4)
"""Times that the points of such a manifold are gone through in a pass."""


@wp.struct
class Pushing:
    """The push of an entry's points on a body of a tree in a pass, and how the body goes for it."""

    shift: wp.vec3  # with all that hangs together with it
    turn: wp.vec3
    force: wp.vec3  # times the square of the substep
    torque: wp.vec3  # about its centre of mass


@wp.func
def pushed(p: Pushing, reply: Reply, arm: wp.vec3, push: wp.vec3):
    """Push a body at a point more."""
    torque = wp.cross(arm, push)
    p.shift = p.shift + (reply.a * push + reply.b * torque)
    p.turn = p.turn + (push * reply.b + reply.c * torque)
    p.force = p.force + push
    p.torque = p.torque + torque
    return p


@wp.func
def mass_of(reply: Reply, arm: wp.vec3, direction: wp.vec3):
    """The effective mass of a point along a direction [kg]."""
    lever = wp.cross(arm, direction)
    return 1.0 / (wp.dot(direction, reply.a * direction + 2.0 * (reply.b * lever)) + wp.dot(lever, reply.c * lever))


@wp.func
def push_points(c: Contacts, m: Meeting, reply: Reply, start: Going, e: int, step: float):
    """Bring the forces of an entry's points to what they have to be: `solve_points` of places, by a reply."""
    p = Pushing()
    p.shift = start.xa
    p.turn = start.ta
    rate = 1.0 / step
    mass = wp.zeros(shape=(4,), dtype=wp.vec3)
    # all points alike first, as in `solve_points`
    counted = int(0)
    count = float(0.0)
    least = float(1.0e30)
    mean = float(0.0)
    middle = wp.vec3(0.0)
    each = float(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        if c.start[o][0] < FAR:
            arm = c.arm_a[o]
            f = c.force[o]
            over = beyond(c, o, wp.dot(m.n, against(start, arm, c.arm_b[o])), PLACES)
            masses = wp.vec3(mass_of(reply, arm, m.n), mass_of(reply, arm, m.t), mass_of(reply, arm, m.u))
            mass[k] = rate * masses  # type: ignore[index]
            if over < 0.0 or f[0] > 0.0:
                count = count + 1.0
                least = wp.min(least, f[0])
                mean = mean + over
                middle = middle + arm
                counted = counted | (1 << k)
    if count > 1.0:
        middle = middle / count  # type: ignore[assignment]
        each = -mean / count * rate / count * mass_of(reply, middle, m.n)
        each = wp.max(each, -least)
        p = pushed(p, reply, middle, (step * count * each) * m.n)
    for visit in range(SWEEPS * c.count[e]):
        k = visit % c.count[e]
        o = e * POINTS + k
        arm = c.arm_a[o]
        f = c.force[o]
        if visit == k and (counted & (1 << k)) != 0:
            f = wp.vec3(f[0] + each, f[1], f[2])
            c.force[o] = f
        if c.start[o][0] < FAR:
            went = p.shift + wp.cross(p.turn, arm) - start.xb - wp.cross(start.tb, c.arm_b[o])
            normal_force = wp.max(0.0, f[0] - beyond(c, o, wp.dot(m.n, went), PLACES) * mass[k][0])
            if normal_force > 0.0 or f[0] > 0.0:
                slip_t = f[1] - wp.dot(m.t, went) * mass[k][1]
                slip_u = f[2] - wp.dot(m.u, went) * mass[k][2]
                force = limited(wp.vec3(normal_force, slip_t, slip_u), c.friction[e])
                c.force[o] = force
                d = force - f
                p = pushed(p, reply, arm, step * (d[0] * m.n + d[1] * m.t + d[2] * m.u))
    return p


@wp.func
def part_by_reply(
    rigid: RigidState, c: Contacts, joints: Joints, trees: Trees, m: Meeting, world: int, e: int, node: int, dt: float
):
    """`part_entry` of a tree's body and what does not give; how far that moves the body at the contact [m]."""
    if c.bounce[e] > 0.0:
        note_approach(rigid, c, m, world, e)
    g = places_of(rigid, m)
    at = world * (trees.count + trees.roots) + node
    # trees have yet to move by what contacts pushed in this pass
    g.xa = g.xa + trees.ahead[at]
    g.ta = g.ta + trees.ahead_turn[at]
    p = push_points(c, m, trees.reply[at], g, e, dt * dt)
    push_node(joints, trees, world, node, p.force, p.torque)
    return wp.length(p.shift - g.xa) + wp.length(p.turn - g.ta) * wp.length(c.local_a[e * POINTS])


@wp.func
def resolve_entry(
    rigid: RigidState, parts: Parts, c: Contacts, joints: Joints, trees: Trees, world: int, e: int, dt: float,
    size: int,
):  # fmt: skip
    """Take one pass over a manifold; returns how far that moves its bodies at the contact, beyond rounding [m]."""
    m = meeting_of(rigid, parts, c, world, e)
    far = 1.0 + wp.max(wp.length(rigid.position[m.i]), wp.length(rigid.position[m.j]))
    node = int(-1)
    if size == 1 and rigid.weight[m.j] == 0.0:  # many threads would push one tree in any order
        node = node_of(trees, m.i - world * rigid.capacity, m.wa)
    went = float(0.0)
    if node >= 0:
        went = part_by_reply(rigid, c, joints, trees, m, world, e, node, dt) - MENDED * far
    else:
        before = places_of(rigid, m)
        part_entry(rigid, parts, c, world, e, dt)
        after = places_of(rigid, m)
        o = e * POINTS
        arm_a = c.arm_a[o]
        arm_b = c.arm_b[o]
        if c.start[o][0] >= FAR:  # a point that is far away has the arms of whenever it was near last
            arm_a = c.local_a[o]
            arm_b = c.local_b[o]
        went_a = wp.length(after.xa - before.xa) + wp.length(after.ta - before.ta) * wp.length(arm_a)
        went_b = wp.length(after.xb - before.xb) + wp.length(after.tb - before.tb) * wp.length(arm_b)
        went = wp.max(went_a, went_b) - ROUNDING * far
    return wp.max(went, 0.0)


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
    rigid: RigidState, parts: Parts, c: Contacts, joints: Joints, trees: Trees, passing: Passing, world: int,
    dt: float, k_pass: int, rowed: bool, rank: int, size: int,
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
                    off = float(1.0)
                    if k_pass > 0:
                        off = resolve_entry(rigid, parts, c, joints, trees, world, e, dt, size)
                    elif size == 1 and rigid.weight[world * rigid.capacity + b] == 0.0:
                        ask_reply(trees, world, a)
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
