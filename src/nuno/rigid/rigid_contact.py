"""Contact between rigid bodies: the passes of a substep over the manifolds.

Forces start from those of the last substep, so that what rests is solved before it is begun: a stack of any height
needs one pass a substep. Positions come first: nothing passes through and nothing slips that friction holds. Then
velocities: what hit bounces, and friction slows what slides. Then positions alone: what still overlaps goes apart,
and what stuck goes back where it stuck, which gives nothing a velocity.
"""

import warp as wp

from nuno.rigid.caught_bodies import CAUGHT, FADED, is_caught, note_pressed
from nuno.rigid.convex import Parts
from nuno.rigid.first_guess import bound_guess
from nuno.rigid.manifold import POINTS
from nuno.rigid.pair_motion import (
    Going,
    Meeting,
    against,
    ease,
    free_places_of,
    keep_places,
    keep_speeds,
    meeting_of,
    places_of,
    speeds_of,
)
from nuno.rigid.persistent_manifolds import FAR, Contacts, is_slipping
from nuno.rigid.rigid_body import RigidState

PLACES, SPEEDS = 0, 1
"""Targets of the points' solution."""
MEND = wp.constant(0.2)
"""Share of an overlap, and of a slip that should not be, that a substep takes back."""
REST = wp.constant(2.0e-5)
"""[m] Overlap that is left alone: mending the last of it would open gaps beside it, and nothing would rest."""
PART_SPEED = wp.constant(0.5)
"""[m/s] What overlaps parts no faster, so that a bad start is no explosion."""
DEEP = wp.constant(2.0e-3)
"""[m] Overlap from which on joints are closed after it was parted: see `nuno.coupled.joint_closing`. Feet that land
come less deep, 1.4 mm at most in a walk of Talos. Of bodies that are caught `CAUGHT` counts."""


@wp.func
def limited(force: wp.vec3, mu: float):
    """A point's force, friction within its cone."""
    size = wp.sqrt(force[1] * force[1] + force[2] * force[2])
    most = mu * force[0]
    scale = float(1.0)
    if size > most:
        scale = most / wp.max(size, 1.0e-30)
    return wp.vec3(force[0], scale * force[1], scale * force[2])


@wp.func
def start_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float):
    """Apply the last substep's forces to the velocities, and note what presses a body and cannot go."""
    m = meeting_of(s, parts, c, world, e)
    total = wp.vec3(0.0)
    turn_a = wp.vec3(0.0)
    turn_b = wp.vec3(0.0)
    touches = int(0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        f = limited(c.force[o], c.friction[e])
        if c.start[o][0] < 0.0 or f[0] > 0.0:
            touches = 1
        c.force[o] = f
        push = dt * (f[0] * m.n + f[1] * m.t + f[2] * m.u)
        total = total + push
        turn_a = turn_a + wp.cross(c.arm_a[o], push)
        turn_b = turn_b + wp.cross(c.arm_b[o], push)
    if m.wa > 0.0:
        s.velocity[m.i] = s.velocity[m.i] + m.wa * total
        s.spin[m.i] = s.spin[m.i] + m.ia * turn_a
    if m.wb > 0.0:
        s.velocity[m.j] = s.velocity[m.j] - m.wb * total
        s.spin[m.j] = s.spin[m.j] - m.ib * turn_b
    if touches == 1:
        note_pressed(s, m)


@wp.func
def beyond(c: Contacts, o: int, along: float, of: int):
    """Return how much farther a point goes along the normal than it has to; negative where it is to be pushed.

    Of places what touches may come no nearer, and what does not may not overlap [m]; of speeds it is to part at its
    aim [m/s].
    """
    result = along - c.aim[o]
    if of == PLACES:
        gap = c.start[o][0]
        result = gap + along - wp.min(gap, 0.0)
    return result


@wp.func
def solve_points(c: Contacts, m: Meeting, start: Going, e: int, step: float, of: int, back: int):
    """Bring the forces of an entry's points to what they have to be; how the bodies go then.

    ``step`` is what a force makes of a mass: of places dt² [s2], of speeds dt [s]. ``back`` takes the points in
    reverse.
    """
    g = start
    rate = 1.0 / step
    # all points alike first: what lands flat is not set spinning by the order of its corners
    counted = int(0)
    count = float(0.0)
    least = float(1.0e30)
    mean = float(0.0)
    arm_a = wp.vec3(0.0)
    arm_b = wp.vec3(0.0)
    each = float(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        f = c.force[o]
        over = beyond(c, o, wp.dot(m.n, against(g, ra, rb)), of)
        if c.start[o][0] < FAR and (over < 0.0 or f[0] > 0.0):
            count = count + 1.0
            least = wp.min(least, f[0])
            mean = mean + over
            arm_a = arm_a + ra
            arm_b = arm_b + rb
            counted = counted | (1 << k)
    if count > 1.0:
        arm_a = arm_a / count
        arm_b = arm_b / count
        each = -mean / count * rate / (count * ease(m, arm_a, arm_b, m.n))
        each = wp.max(each, -least)
        # written out at each push: of a struct that a function gives back Warp makes copies, 5 % of a run's time
        push = (step * count * each) * m.n
        g.xa = g.xa + m.wa * push
        g.ta = g.ta + m.ia * wp.cross(arm_a, push)
        g.xb = g.xb - m.wb * push
        g.tb = g.tb - m.ib * wp.cross(arm_b, push)
        g.changed = 1
    for h in range(c.count[e]):
        k = wp.where(back == 1, c.count[e] - 1 - h, h)
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        mass = c.mass[o]
        f = c.force[o]
        if (counted & (1 << k)) != 0:
            f = wp.vec3(f[0] + each, f[1], f[2])
            c.force[o] = f
        went = against(g, ra, rb)
        over = beyond(c, o, wp.dot(m.n, went), of)
        normal_force = wp.max(0.0, f[0] - over * mass[0] * rate)
        if c.start[o][0] < FAR and (normal_force > 0.0 or f[0] > 0.0):
            slip_t = f[1] - wp.dot(m.t, went) * mass[1] * rate
            slip_u = f[2] - wp.dot(m.u, went) * mass[2] * rate
            force = limited(wp.vec3(normal_force, slip_t, slip_u), c.friction[e])
            c.force[o] = force
            d = force - f
            push = step * (d[0] * m.n + d[1] * m.t + d[2] * m.u)
            g.xa = g.xa + m.wa * push
            g.ta = g.ta + m.ia * wp.cross(ra, push)
            g.xb = g.xb - m.wb * push
            g.tb = g.tb - m.ib * wp.cross(rb, push)
            g.changed = 1
    return g


@wp.func
def note_approach(s: RigidState, c: Contacts, m: Meeting, world: int, e: int):
    """Keep in ``aim`` how fast each point would part in this substep without its contact [m/s], for `bounce_speed`."""
    g = speeds_of(s, m, world)
    for k in range(c.count[e]):
        o = e * POINTS + k
        if c.start[o][0] < FAR:
            c.aim[o] = wp.dot(m.n, against(g, c.arm_a[o], c.arm_b[o]))


@wp.func
def bounce_speed(bounce: float, gain: float, free: float, pushed: float, dt: float):
    """The speed [m/s] at which a point parts after an impact, so that the bounce alone takes energy.

    A body's speed is that of the middle of the substep before; half a ``gain``, of what forces make of it in a substep,
    brings it to the instant. Without the contact the point would now go at ``free`` [m/s] and be ``pushed`` [m] farther
    in: under the same forces it had another speed where it touched. It leaves at ``bounce`` times that, from where it
    is. All speeds are along the normal, negative towards the other.

    Of the approach's own speed alone the fall within the substep of the impact would be lost, and half a substep of
    gravity twice over: at each bounce about 3/2 g dt v of the energy per mass.
    """
    now = free + 0.5 * gain
    square = wp.max(now * now + 2.0 * gain / dt * pushed, 0.0)
    return wp.max(bounce * wp.sqrt(square) - 0.5 * gain, 0.0)


@wp.func
def part_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float):
    """Positions: nothing comes nearer than touching, and nothing slips that friction holds."""
    m = meeting_of(s, parts, c, world, e)
    if c.bounce[e] > 0.0:
        note_approach(s, c, m, world, e)
    keep_places(s, m, solve_points(c, m, places_of(s, m), e, dt * dt, PLACES, 0))


@wp.func
def aim_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, still: float):
    """The speed at which each point is to part at least, in place of its speed of approach.

    What touches is to part at the speed of its bounce; what does not yet is left alone.
    """
    m = meeting_of(s, parts, c, world, e)
    g = places_of(s, m)
    for k in range(c.count[e]):
        o = e * POINTS + k
        start = c.start[o]
        if start[0] < FAR:
            gap = start[0] + wp.dot(m.n, against(g, c.arm_a[o], c.arm_b[o]))
            wanted = -FAR
            if c.force[o][0] > 0.0 or gap < REST:
                wanted = 0.0
                if start[3] < -still and c.bounce[e] > 0.0:
                    # what an earlier impact left in neighbours' forces is undone within the substep: it is no gain
                    gain = wp.clamp(c.aim[o] - start[3], -still, still)
                    free = start[3] + gain
                    went = wp.dot(m.n, against(free_places_of(s, m), c.arm_a[o], c.arm_b[o])) + (free - c.aim[o]) * dt
                    wanted = bounce_speed(c.bounce[e], gain, free, gap - start[0] - went, dt)
            c.aim[o] = wanted


@wp.func
def slow_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, back: int):
    """Velocities: what touches parts at the speed of its bounce, and does not slip while friction holds it.

    ``back`` takes the points in reverse. They stand in a round, and pass after pass the one way would drive what rests
    to wobble the same way round: a stack of boxes on its corners, or a heavy box on a light one.
    """
    m = meeting_of(s, parts, c, world, e)
    keep_speeds(s, m, solve_points(c, m, speeds_of(s, m, world), e, dt, SPEEDS, back))


@wp.func
def note_impulse(parts: Parts, c: Contacts, m: Meeting, e: int, dt: float):
    """Add to an entry's impulse what its points gave the owner in this substep.

    It outlasts the entry: what bounced away within the frame may have left the row by its end.
    """
    total = wp.vec3(0.0)
    for k in range(c.count[e]):
        f = c.force[e * POINTS + k]
        total = total + (f[0] * m.n + f[1] * m.t + f[2] * m.u)
    if wp.length_sq(total) > 0.0:
        other = parts.slot[c.partner[e]]
        if c.met[e] != other:
            c.impulse[e] = wp.vec3(0.0)
        c.impulse[e] = c.impulse[e] + dt * total
        c.met[e] = other


@wp.func
def begin_mending(s: RigidState, i: int):
    """Keep where a body is before `mend_entry` parts what overlaps."""
    s.position_free[i] = s.position[i]
    s.rotation_free[i] = s.rotation[i]


@wp.func
def note_parted(s: RigidState, i: int, weight: float):
    """Note that a body was taken out of an overlap by itself, if joints say where it is."""
    if weight > 0.0 and s.joined[i] != 0:
        s.joined[i] = 2


@wp.func
def mend_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, still: float):
    """Positions alone: take back a share of what overlaps, and of what slipped though friction held it.

    The force of an impact is forgotten: the next substep begins with forces that last. What a caught body is deep in
    begins it with a little less each time.
    """
    m = meeting_of(s, parts, c, world, e)
    note_impulse(parts, c, m, e, dt)
    # a light body on a joint would go aside for a heavy one on it, and a motor or friction would not bring it back
    stays = (s.joined[m.i] != 0) != (s.joined[m.j] != 0) and wp.min(m.wa, m.wb) > 0.0
    if stays:
        if s.joined[m.i] != 0:
            m.wa = 0.0
            m.ia = wp.mat33(0.0)
        else:
            m.wb = 0.0
            m.ib = wp.mat33(0.0)
    g = places_of(s, m)
    before = free_places_of(s, m)
    deep = int(0)
    caught = is_caught(s, m)
    depth = wp.where(caught, CAUGHT, DEEP)
    for h in range(c.count[e]):
        k = c.count[e] - 1 - h
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        start = c.start[o]
        mass = c.mass[o]
        if stays:
            mass = wp.vec3(1.0 / ease(m, ra, rb, m.n), 1.0 / ease(m, ra, rb, m.t), 1.0 / ease(m, ra, rb, m.u))
        f = c.force[o]
        went = against(g, ra, rb)
        gap = start[0] + wp.dot(m.n, went)
        back = wp.vec3(0.0)
        if gap < -REST:
            # of all entries together: what other points have parted it by counts
            parted = wp.dot(m.n, went - against(before, ra, rb))
            back = wp.max(wp.min(-MEND * (gap + REST), PART_SPEED * dt - wp.max(parted, 0.0)), 0.0) * mass[0] * m.n
            if gap < -depth:
                deep = 1
        if f[0] > 0.0 and not is_slipping(f, c.friction[e]):
            back = back - MEND * (start[1] + wp.dot(m.t, went)) * mass[1] * m.t
            back = back - MEND * (start[2] + wp.dot(m.u, went)) * mass[2] * m.u
        if start[3] < -still:
            c.force[o] = wp.vec3(0.0)
        elif caught and gap < -CAUGHT:
            c.force[o] = FADED * f
        if wp.length_sq(back) > 0.0:
            g.xa = g.xa + m.wa * back
            g.ta = g.ta + m.ia * wp.cross(ra, back)
            g.xb = g.xb - m.wb * back
            g.tb = g.tb - m.ib * wp.cross(rb, back)
            g.changed = 1
    bound_guess(s, c, m, e, dt)
    keep_places(s, m, g)
    if deep == 1 and g.changed == 1:
        note_parted(s, m.i, m.wa)
        note_parted(s, m.j, m.wb)
