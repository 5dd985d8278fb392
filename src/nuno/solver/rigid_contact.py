"""Contact between rigid bodies: the passes of a substep over the manifolds.

Forces start from those of the last substep, so that what rests is solved before it is begun: a stack of any height
needs one pass a substep. Positions come first: nothing passes through and nothing slips that friction holds. Then
velocities: what hit bounces, and friction slows what slides. Then positions alone: what still overlaps goes apart,
and what stuck goes back where it stuck, which gives nothing a velocity.
"""

import warp as wp

from nuno.contact.convex import Parts
from nuno.contact.manifold import POINTS
from nuno.contact.rigid_manifolds import FAR, Contacts, is_slipping, moves
from nuno.solver.rigid_body import RigidState, inverse_mass_at, turn_between, turned

MEND = wp.constant(0.2)
"""Share of an overlap, and of a slip that should not be, that a substep takes back."""
REST = wp.constant(2.0e-5)
"""[m] Overlap that is left alone: mending the last of it would open gaps beside it, and nothing would rest."""
PART_SPEED = wp.constant(0.5)
"""[m/s] What overlaps parts no faster, so that a bad start is no explosion."""


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
    """Apply the last substep's forces to the velocities."""
    p = (e - world * c.parts * c.row) / c.row
    i = world * s.capacity + parts.slot[p]
    j = world * s.capacity + parts.slot[c.partner[e]]
    n = c.normal_now[e]
    t = c.tangent_now[e]
    u = wp.cross(n, t)
    total = wp.vec3(0.0)
    turn_a = wp.vec3(0.0)
    turn_b = wp.vec3(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        f = limited(c.force[o], c.friction[e])
        c.force[o] = f
        push = dt * (f[0] * n + f[1] * t + f[2] * u)
        total = total + push
        turn_a = turn_a + wp.cross(c.arm_a[o], push)
        turn_b = turn_b + wp.cross(c.arm_b[o], push)
    if s.weight[i] > 0.0:
        s.velocity[i] = s.velocity[i] + s.weight[i] * total
        s.spin[i] = s.spin[i] + s.give[i] * turn_a
    if s.weight[j] > 0.0:
        s.velocity[j] = s.velocity[j] - s.weight[j] * total
        s.spin[j] = s.spin[j] - s.give[j] * turn_b


@wp.func
def part_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float):
    """Positions: nothing comes nearer than touching, and nothing slips that friction holds."""
    p = (e - world * c.parts * c.row) / c.row
    i = world * s.capacity + parts.slot[p]
    j = world * s.capacity + parts.slot[c.partner[e]]
    wa = s.weight[i]
    wb = s.weight[j]
    ia = s.give[i]
    ib = s.give[j]
    n = c.normal_now[e]
    t = c.tangent_now[e]
    u = wp.cross(n, t)
    # what the bodies have moved in this substep
    xa = s.position[i] - s.position_before[i]
    xb = s.position[j] - s.position_before[j]
    ta = turn_between(s.rotation_before[i], s.rotation[i])
    tb = turn_between(s.rotation_before[j], s.rotation[j])
    changed = int(0)
    rate = 1.0 / (dt * dt)
    # all points alike first: what lands flat is not set spinning by the order of its corners
    counted = int(0)
    count = float(0.0)
    least = float(1.0e30)
    mean = float(0.0)
    arm = wp.vec3(0.0)
    brm = wp.vec3(0.0)
    each = float(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        gap = c.start[o][0]
        over = gap + wp.dot(n, xa + wp.cross(ta, ra) - xb - wp.cross(tb, rb)) - wp.min(gap, 0.0)
        f = c.force[o]
        if gap < FAR and (over < 0.0 or f[0] > 0.0):
            count = count + 1.0
            least = wp.min(least, f[0])
            mean = mean + over
            arm = arm + ra
            brm = brm + rb
            counted = counted | (1 << k)
    if count > 1.0:
        arm = arm / count
        brm = brm / count
        each = -mean / count * rate / (count * (inverse_mass_at(s, i, arm, n) + inverse_mass_at(s, j, brm, n)))
        each = wp.max(each, -least)
        push = (dt * dt * count * each) * n
        xa = xa + wa * push
        ta = ta + ia * wp.cross(arm, push)
        xb = xb - wb * push
        tb = tb - ib * wp.cross(brm, push)
        changed = 1
    for k in range(c.count[e]):
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        start = c.start[o]
        mass = c.mass[o]
        f = c.force[o]
        if (counted & (1 << k)) != 0:
            f = wp.vec3(f[0] + each, f[1], f[2])
            c.force[o] = f
        went = xa + wp.cross(ta, ra) - xb - wp.cross(tb, rb)
        over = start[0] + wp.dot(n, went) - wp.min(start[0], 0.0)
        g = wp.vec3(wp.max(0.0, f[0] - over * mass[0] * rate), f[1], f[2])
        if start[0] < FAR and (g[0] > 0.0 or f[0] > 0.0):
            g = wp.vec3(g[0], g[1] - wp.dot(t, went) * mass[1] * rate, g[2] - wp.dot(u, went) * mass[2] * rate)
            g = limited(g, c.friction[e])
            c.force[o] = g
            d = g - f
            push = dt * dt * (d[0] * n + d[1] * t + d[2] * u)
            xa = xa + wa * push
            ta = ta + ia * wp.cross(ra, push)
            xb = xb - wb * push
            tb = tb - ib * wp.cross(rb, push)
            changed = 1
    if changed == 1:
        if wa > 0.0:
            s.position[i] = s.position_before[i] + xa
            s.rotation[i] = turned(s.rotation_before[i], ta)
        if wb > 0.0:
            s.position[j] = s.position_before[j] + xb
            s.rotation[j] = turned(s.rotation_before[j], tb)


@wp.func
def aim_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, still: float):
    """The speed at which each point is to part at least, in place of its speed of approach.

    What touches is to part at the speed of its bounce; what does not yet is left alone.
    """
    p = (e - world * c.parts * c.row) / c.row
    i = world * s.capacity + parts.slot[p]
    j = world * s.capacity + parts.slot[c.partner[e]]
    n = c.normal_now[e]
    xa = s.position[i] - s.position_before[i]
    xb = s.position[j] - s.position_before[j]
    ta = turn_between(s.rotation_before[i], s.rotation[i])
    tb = turn_between(s.rotation_before[j], s.rotation[j])
    for k in range(c.count[e]):
        o = e * POINTS + k
        start = c.start[o]
        if start[0] < FAR:
            gap = start[0] + wp.dot(n, xa + wp.cross(ta, c.arm_a[o]) - xb - wp.cross(tb, c.arm_b[o]))
            wanted = -FAR
            if c.force[o][0] > 0.0 or gap < REST:
                wanted = 0.0
                if start[3] < -still:
                    wanted = -c.bounce[e] * start[3]
            c.aim[o] = wanted


@wp.func
def slow_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, back: int):
    """Velocities: what touches parts at the speed of its bounce, and does not slip while friction holds it.

    ``back`` takes the points in reverse. They stand in a round, and pass after pass the one way would drive what rests
    to wobble the same way round: a stack of boxes on its corners, or a heavy box on a light one.
    """
    p = (e - world * c.parts * c.row) / c.row
    a = parts.slot[p]
    b = parts.slot[c.partner[e]]
    i = world * s.capacity + a
    j = world * s.capacity + b
    wa = s.weight[i]
    wb = s.weight[j]
    ia = s.give[i]
    ib = s.give[j]
    n = c.normal_now[e]
    t = c.tangent_now[e]
    u = wp.cross(n, t)
    va = moves(s, i, a) * s.velocity[i]
    vb = moves(s, j, b) * s.velocity[j]
    oa = moves(s, i, a) * s.spin[i]
    ob = moves(s, j, b) * s.spin[j]
    changed = int(0)
    rate = 1.0 / dt
    counted = int(0)
    count = float(0.0)
    least = float(1.0e30)
    mean = float(0.0)
    arm = wp.vec3(0.0)
    brm = wp.vec3(0.0)
    each = float(0.0)
    for k in range(c.count[e]):
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        f = c.force[o]
        short = wp.dot(n, va + wp.cross(oa, ra) - vb - wp.cross(ob, rb)) - c.aim[o]
        if c.start[o][0] < FAR and (short < 0.0 or f[0] > 0.0):
            count = count + 1.0
            least = wp.min(least, f[0])
            mean = mean + short
            arm = arm + ra
            brm = brm + rb
            counted = counted | (1 << k)
    if count > 1.0:
        arm = arm / count
        brm = brm / count
        each = -mean / count * rate / (count * (inverse_mass_at(s, i, arm, n) + inverse_mass_at(s, j, brm, n)))
        each = wp.max(each, -least)
        push = (dt * count * each) * n
        va = va + wa * push
        oa = oa + ia * wp.cross(arm, push)
        vb = vb - wb * push
        ob = ob - ib * wp.cross(brm, push)
        changed = 1
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
        speed = va + wp.cross(oa, ra) - vb - wp.cross(ob, rb)
        g = wp.vec3(wp.max(0.0, f[0] - (wp.dot(n, speed) - c.aim[o]) * mass[0] * rate), f[1], f[2])
        if c.start[o][0] < FAR and (g[0] > 0.0 or f[0] > 0.0):
            g = wp.vec3(g[0], g[1] - wp.dot(t, speed) * mass[1] * rate, g[2] - wp.dot(u, speed) * mass[2] * rate)
            g = limited(g, c.friction[e])
            c.force[o] = g
            d = g - f
            push = dt * (d[0] * n + d[1] * t + d[2] * u)
            va = va + wa * push
            oa = oa + ia * wp.cross(ra, push)
            vb = vb - wb * push
            ob = ob - ib * wp.cross(rb, push)
            changed = 1
    if changed == 1:
        if wa > 0.0:
            s.velocity[i] = va
            s.spin[i] = oa
        if wb > 0.0:
            s.velocity[j] = vb
            s.spin[j] = ob


@wp.func
def mend_entry(s: RigidState, parts: Parts, c: Contacts, world: int, e: int, dt: float, still: float):
    """Positions alone: take back a share of what overlaps, and of what slipped though friction held it.

    The force of an impact is forgotten: the next substep begins with forces that last.
    """
    p = (e - world * c.parts * c.row) / c.row
    i = world * s.capacity + parts.slot[p]
    j = world * s.capacity + parts.slot[c.partner[e]]
    wa = s.weight[i]
    wb = s.weight[j]
    ia = s.give[i]
    ib = s.give[j]
    n = c.normal_now[e]
    t = c.tangent_now[e]
    u = wp.cross(n, t)
    xa = s.position[i] - s.position_before[i]
    xb = s.position[j] - s.position_before[j]
    ta = turn_between(s.rotation_before[i], s.rotation[i])
    tb = turn_between(s.rotation_before[j], s.rotation[j])
    changed = int(0)
    for h in range(c.count[e]):
        k = c.count[e] - 1 - h
        o = e * POINTS + k
        ra = c.arm_a[o]
        rb = c.arm_b[o]
        start = c.start[o]
        mass = c.mass[o]
        f = c.force[o]
        went = xa + wp.cross(ta, ra) - xb - wp.cross(tb, rb)
        gap = start[0] + wp.dot(n, went)
        back = wp.vec3(0.0)
        if gap < -REST:
            back = wp.min(-MEND * (gap + REST), PART_SPEED * dt) * mass[0] * n
        if f[0] > 0.0 and not is_slipping(f, c.friction[e]):
            back = back - MEND * (start[1] + wp.dot(t, went)) * mass[1] * t
            back = back - MEND * (start[2] + wp.dot(u, went)) * mass[2] * u
        if start[3] < -still:
            c.force[o] = wp.vec3(0.0)
        if wp.length_sq(back) > 0.0:
            xa = xa + wa * back
            ta = ta + ia * wp.cross(ra, back)
            xb = xb - wb * back
            tb = tb - ib * wp.cross(rb, back)
            changed = 1
    if changed == 1:
        if wa > 0.0:
            s.position[i] = s.position_before[i] + xa
            s.rotation[i] = turned(s.rotation_before[i], ta)
        if wb > 0.0:
            s.position[j] = s.position_before[j] + xb
            s.rotation[j] = turned(s.rotation_before[j], tb)
