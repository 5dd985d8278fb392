"""Particles that lie on one rigid body while rows press on them from the other side: a napkin between two plates.

One after the other, the row above moves the light particle and the row below moves it back, and what passes from one
heavy body to the other in a pass is as little as the particle is light: 28 passes are then far from the end, and
where they stop depends on their order. A plate was so tilted by nanometres in each substep, always alike, and what lay
on it crept by up to 50 um/s. So a row that presses on such a particle counts with what the body under it gives
way by, too, and the row below follows within the same projection (`give_on`, `follow`). Friction on both sides is
solved at once (`rub_both`). Bodies then feel each other through the cloth as if they touched.

Only where rows are solved one after the other. What follows is written for such rows alone: Warp hands structures over
by value, and a function that is called in two more places is no longer inlined, which made all rows take twice as long.
"""

import numpy as np
import warp as wp

from nuno.coupled.bounded_particles import MOST, OPPOSED, Particles, against
from nuno.coupled.contact_rows import VERTEX_RIGID, Rows
from nuno.coupled.joint_response import Joints
from nuno.coupled.pass_progress import Passing
from nuno.coupled.tie_constraints import Holds
from nuno.rigid.rigid_body import RigidState, inverse_mass_at, point_motion, point_of, shift_whole, turn_whole

SPLIT = wp.constant(1.0e-4)
"""Share of a particle's inverse mass that a body gives way by at least while friction on both sides is solved. Two that
are led give way to nothing, and how they share friction would be open. Once nothing slips it changes nothing."""


@wp.func
def support_of(particles: Particles, rows: Rows, r: int, i: int, n: wp.vec3):
    """Return the row of another rigid body that particle i lies on when row r pushes it along n; -1: none."""
    found = int(-1)
    if particles.shape[MOST * i] < 0:
        s = int(particles.first_row[i])
        while s >= 0:
            if s != r and rows.slot[s] != rows.slot[r] and wp.dot(rows.normal[s], n) < -OPPOSED:
                if found < 0:
                    found = s
                elif rows.push[s] > rows.push[found]:
                    found = s
            s = rows.next[s]
    return found


@wp.func
def no_supports():
    """Four times none."""
    return wp.vec4i(-1, -1, -1, -1)


@wp.func
def supports_of(particles: Particles, first: int, rows: Rows, r: int):
    """The rows that each particle of row r is pressed on, -1: none."""
    found = no_supports()
    corners = rows.corners[r]
    weights = rows.weights[r]
    for k in range(4):
        if corners[k] >= 0 and weights[k] != 0.0:
            n = rows.normal[r] * wp.sign(weights[k])
            found[k] = support_of(particles, rows, r, first + corners[k], n)
    return found


def held_slots(worlds: int, capacity: int, holds: Holds, joints: Joints) -> np.ndarray:
    """Return (worlds * capacity) int32, 1 for each rigid body that a grip or joint holds, in part or entirely."""
    held = np.zeros((worlds, capacity), dtype=np.int32)
    if holds.count:
        there = holds.limit.numpy().reshape(worlds, holds.count) >= 0.0
        for k, slot in enumerate(holds.slot.numpy()[: holds.count]):
            held[there[:, k], slot] = 1
    for slots in (joints.slot, joints.other) if joints.count else ():
        found = slots.numpy()[: joints.count]
        held[:, found[found >= 0]] = 1
    return held.ravel()


@wp.func
def link_supports(particles: Particles, rows: Rows, passing: Passing, world: int, first: int, base: int, count: int):
    """Chain the active rows of each particle that are with rigid bodies, and note the islands in which one lies on two.

    The two rows of such a particle are mates where it has no more. Returns how many rows press on such particles.
    """
    found = int(0)
    slot = int(-1)
    several = bool(False)
    for k in range(count):
        own = rows.slot[rows.active[base + k]]
        if own >= 0:
            several = several or (slot >= 0 and own != slot)
            slot = own
    for b in range(passing.bodies):
        passing.linked[world * passing.bodies + b] = 0
    if several:
        for k in range(count):
            corners = rows.corners[rows.active[base + k]]
            for c in range(4):
                if corners[c] >= 0:
                    particles.first_row[first + corners[c]] = -1
        for k in range(count):
            r = rows.active[base + k]
            if rows.kind[r] == VERTEX_RIGID:
                i = first + rows.corners[r][0]
                rows.next[r] = particles.first_row[i]
                particles.first_row[i] = r
        for k in range(count):
            r = rows.active[base + k]
            on = supports_of(particles, first, rows, r)
            mate = int(-1)
            if wp.max(on) >= 0:
                found += 1
                passing.linked[world * passing.bodies + passing.island[world * passing.bodies + rows.bodies[r][0]]] = 1
                if rows.kind[r] == VERTEX_RIGID:
                    if rows.next[rows.next[particles.first_row[first + rows.corners[r][0]]]] < 0:
                        mate = on[0]
            rows.mate[r] = mate
    return found


@wp.func
def with_mate(rows: Rows, r: int, k_pass: int):
    """Return True if a row was solved in this pass with its mate, whose turn came first."""
    mate = rows.mate[r]
    solved = bool(False)
    if mate >= 0:
        first = mate < r
        if k_pass % 2 == 1:
            first = mate > r
        solved = first and rows.push[mate] > 0.0
    return solved


@wp.func
def rubs_both(particles: Particles, start: int, rows: Rows, r: int):
    """Return True if the friction of a row with a mate is solved with its mate's.

    Not where something holds a body: how two that are held share friction is open, and a difference between them would
    use it up.
    """
    mate = rows.mate[r]
    free = particles.held[start + rows.slot[r]] == 0 and particles.held[start + rows.slot[mate]] == 0
    return free and rows.friction[mate] > 0.0


@wp.func
def support_weight(rigid: RigidState, start: int, rows: Rows, s: int, n: wp.vec3):
    """Return the inverse mass of a support's body along n."""
    i = start + rows.slot[s]
    arm = wp.vec3(wp.quat_rotate(rigid.rotation[i], rows.point[s]))
    return inverse_mass_at(rigid, i, arm, n)


@wp.func
def support_slip(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, s: int):
    """Return how far the particle on a support moved in the substep, over what the body's point did."""
    return particles.u[first + rows.corners[s][0]] - point_motion(rigid, start + rows.slot[s], rows.point[s])


@wp.func
def move_support(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, s: int, impulse: wp.vec3):
    """`apply_row` of a support, where rows are solved one after the other."""
    j = first + rows.corners[s][0]
    i = start + rows.slot[s]
    particles.u[j] = particles.u[j] + impulse * particles.w[j]
    arm = wp.quat_rotate(rigid.rotation[i], rows.point[s])
    shift_whole(rigid, i, rigid.weight[i] * -impulse)
    turn_whole(rigid, i, rigid.give[i] * wp.cross(arm, -impulse))


@wp.func
def ease_on(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, s: int):
    """Return how far support s is from where it asks to be [m], and its response to a unit of its multiplier."""
    j = first + rows.corners[s][0]
    n = rows.normal[s]
    compliance = float(rows.compliance[s])
    pressed = float(compliance * rows.push[s])
    if pressed > rows.squeeze[s]:
        pressed = rows.squeeze[s]
        compliance = 0.0
    at = particles.p[j] + particles.u[j] - point_of(rigid, start + rows.slot[s], rows.point[s])
    ease = particles.w[j] + support_weight(rigid, start, rows, s, n) + compliance + 1.0e-9
    return wp.dot(at, n) - rows.distance[s] + pressed, ease


@wp.func
def give_on(w: float, gap: float, total: float, pushed: float, cosine: float, push: float):
    """`give_along` of a particle on a support: times what it would go freely, and how far besides [m].

    Args:
        w: Its inverse mass.
        gap: Of the support; see `ease_on`.
        total: Response of the support.
        pushed: Its multiplier so far.
        cosine: Of the angle from the support's normal to the direction of the push.
        push: How far the push would take the particle freely [m].
    """
    share = float(1.0)
    besides = float(-cosine * w * pushed)
    if pushed * total > gap + push * cosine:
        share = wp.max(1.0 - cosine * cosine * w / total, 0.0)
        besides = -cosine * w * gap / total
    return share, besides


@wp.func
def follow(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, s: int):
    """Take a support's push to where the particle on it stays, after another row has moved that."""
    gap, total = ease_on(particles, rigid, first, start, rows, s)
    push = rows.push[s]
    more = wp.max(push - gap / total, 0.0)
    rows.push[s] = more
    move_support(particles, rigid, first, start, rows, s, rows.normal[s] * (more - push))


@wp.func
def rub_both(free: wp.vec3, w: float, free_a: wp.vec3, wa: float, limit_a: float, free_b: wp.vec3, wb: float,
             limit_b: float):  # fmt: skip
    """Friction on a particle between two rigid bodies, a and b: `rub_between` of two that both give way.

    Args:
        free: Where the particle would come to without friction [m].
        w: Its inverse mass.
        free_a: Where a's point would come to without friction with the particle [m].
        wa: Its inverse mass.
        limit_a: The largest multiplier between a and the particle.
        free_b: As of a.
        wb: As of a.
        limit_b: As of a.

    Returns:
        The two multipliers.
    """
    det = w * wa + w * wb + wa * wb
    a = ((free_a - free) * wb + (free_a - free_b) * w) / det
    b = ((free_b - free) * wa + (free_b - free_a) * w) / det
    if wp.length(a) > limit_a or wp.length(b) > limit_b:
        # it sticks to a, and slides on b
        part = w / (w + wa)
        slip = wp.lerp(free, free_a, part) - free_b
        b = against(slip, wp.min(limit_b, wp.length(slip) / (wb + wa * part + 1.0e-12)))
        a = (free_a - free - b * w) / (w + wa)
        if wp.length(a) > limit_a:
            # a slides over it, and it sticks to b
            part = w / (w + wb)
            slip = wp.lerp(free, free_b, part) - free_a
            a = against(slip, wp.min(limit_a, wp.length(slip) / (wa + wb * part + 1.0e-12)))
            b = (free_b - free - a * w) / (w + wb)
            if wp.length(b) > limit_b:
                # it slides on both
                place = free
                tries = int(3)
                for _again in range(tries):
                    a = against(place - free_a, limit_a)
                    b = against(place - free_b, limit_b)
                    place = free + (a + b) * w
    return a, b
