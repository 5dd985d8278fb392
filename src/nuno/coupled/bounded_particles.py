"""The particles of coupled bodies, and how static and moving shapes bound those that rows press on.

A shape has no mass of its own, so that a particle's bound is met exactly and at once: it goes back to the surface, with
Coulomb friction on the way. Rows ask beforehand how far a particle would give way (`give_along`), and solve friction on
both of its sides together where it lies between a body and a shape (`rub_between`).
"""

import warp as wp

MOST = wp.constant(2)
"""Shapes that bound a particle while rows are solved: a floor and a wall."""
OPPOSED = wp.constant(0.9)
"""Cosine of the angle between two normals from which on a particle is between what pushes along them."""


@wp.struct
class Particles:
    """The particles of all coupled bodies, ``count`` a world, one world after the other.

    Kept are where they were when the substep began, and how far they have come since: what sticks has not come an
    ulp, however far from the origin it is.
    """

    count: int
    p: wp.array(dtype=wp.vec3)
    u: wp.array(dtype=wp.vec3)
    w: wp.array(dtype=float)
    # where all rows are solved at once: how many press on a particle or a rigid body, how many more will from the next
    # pass on, and moves in fixed point
    sharers: wp.array(dtype=int)
    joining: wp.array(dtype=int)
    moved: wp.array(dtype=wp.int64)
    body_sharers: wp.array(dtype=int)
    body_joining: wp.array(dtype=int)
    body_moved: wp.array(dtype=wp.int64)
    # one after the other: of those in active rows, the first row with a rigid body, -1: none
    first_row: wp.array(dtype=int)
    held: wp.array(dtype=int)  # (worlds * rigid slots), whether a grip or joint holds it, in part or entirely
    # those in active rows, their contacts with shapes, `MOST` a particle (see `nuno.coupled.shape_bounds`), and those
    # that have any
    pressed: wp.array(dtype=int)
    shape: wp.array(dtype=int)  # -1: none
    shape_normal: wp.array(dtype=wp.vec3)
    shape_room: wp.array(dtype=float)  # how far it may go against the normal, the shape's own motion included [m]
    shape_motion: wp.array(dtype=wp.vec3)  # of the shape's surface there, in the substep [m]
    shape_friction: wp.array(dtype=float)
    shape_push: wp.array(dtype=float)  # how far the shape has pushed it out [m]
    shape_drag: wp.array(dtype=wp.vec3)  # and how far friction took it along [m]
    bounded: wp.array(dtype=int)
    bounded_count: wp.array(dtype=int)


@wp.func
def give_along(particles: Particles, i: int, n: wp.vec3, push: float):
    """Return how a particle goes along n where shapes bound it: times what it would go freely, and how far besides [m].

    Args:
        particles: All.
        i: Which.
        n: Direction.
        push: How far along n a push would take it freely [m].
    """
    share = float(1.0)
    besides = float(0.0)
    for k in range(MOST):
        c = MOST * i + k
        if particles.shape[c] >= 0:
            m = particles.shape_normal[c]
            cosine = wp.dot(n, m)
            room = wp.dot(particles.u[i], m) + particles.shape_room[c]
            pushed = particles.shape_push[c]
            if pushed - room > push * cosine:
                # it ends on the surface, wherever it would go
                share -= cosine * cosine
                besides -= cosine * room
            else:
                # it leaves, and what the shape pushed it is taken back
                besides -= cosine * pushed
    return wp.max(share, 0.0), besides


@wp.func
def bound(particles: Particles, i: int, dragged: int):
    """Put a particle back to the surfaces of the shapes that bound it, with their friction where it is ``dragged``."""
    for k in range(MOST):
        c = MOST * i + k
        if particles.shape[c] >= 0:
            m = particles.shape_normal[c]
            old = particles.shape_push[c]
            push = wp.max(old - wp.dot(particles.u[i], m) - particles.shape_room[c], 0.0)
            if push != old:
                particles.u[i] = particles.u[i] + m * (push - old)
                particles.shape_push[c] = push
            before = particles.shape_drag[c]
            if dragged != 0 and (push > 0.0 or wp.length_sq(before) > 0.0):
                drag = before - (particles.u[i] - particles.shape_motion[c])
                drag = drag - m * wp.dot(drag, m)
                most = particles.shape_friction[c] * push
                size = wp.length(drag)
                if size > most:
                    drag = drag * (most / size)
                particles.shape_drag[c] = drag
                particles.u[i] = particles.u[i] + (drag - before)


@wp.func
def bound_corners(particles: Particles, first: int, corners: wp.vec4i, dragged: int):
    """`bound` the particles of a row."""
    for k in range(4):
        if corners[k] >= 0:
            bound(particles, first + corners[k], dragged)


@wp.func
def is_bounded(particles: Particles, first: int, corners: wp.vec4i):
    """Return True if a shape bounds any of a row's particles."""
    found = bool(False)
    for k in range(4):
        if corners[k] >= 0:
            found = found or particles.shape[MOST * (first + corners[k])] >= 0
    return found


@wp.func
def against(v: wp.vec3, size: float):
    """A vector of a length against ``v``, or zero."""
    return v * (-size / wp.max(wp.length(v), 1.0e-20))


@wp.func
def rub_between(free: wp.vec3, w: float, shape_moved: wp.vec3, limit_shape: float, body_free: wp.vec3, body_w: float,
                most: float):  # fmt: skip
    """Friction on a particle that a body presses on a shape, both at once.

    The particle sticks to the body, to the shape, to both or to neither. One of the four satisfies Coulomb's law on
    both sides.

    Args:
        free: Where the particle would come to without friction [m].
        w: Its inverse mass.
        shape_moved: What the shape's surface moves [m].
        limit_shape: The most that the shape's friction may move the particle [m].
        body_free: Where the body's point would come to without this friction [m].
        body_w: The body's inverse mass there.
        most: The largest multiplier between particle and body.

    Returns:
        How far the shape's friction moves the particle [m], and the multiplier between particle and body.
    """
    # it sticks to the body, and with it slides on the shape or stands
    part = body_w / (w + body_w)
    slip = body_free * (1.0 - part) + free * part - shape_moved
    length = wp.length(slip)
    drag = against(slip, limit_shape)
    if length < part * limit_shape:
        drag = -slip / wp.max(part, 1.0e-12)
    multiplier = (body_free - free - drag) / (w + body_w)
    if wp.length(multiplier) > most:
        # the body slides over it, and it stands on the shape
        slip = shape_moved - body_free
        multiplier = against(slip, wp.min(most, wp.length(slip) / (body_w + 1.0e-12)))
        drag = shape_moved - free - multiplier * w
        if wp.length(drag) > limit_shape:
            # it slides on both
            place = free
            tries = int(3)
            for _again in range(tries):
                drag = against(place - shape_moved, limit_shape)
                multiplier = against(place - body_free, most)
                place = free + drag + multiplier * w
    return drag, multiplier


@wp.func
def is_between(particles: Particles, i: int, n: wp.vec3):
    """The contact of particle i with the shape that a push against n presses it on; -1: none."""
    found = int(-1)
    for k in range(MOST):
        c = MOST * i + k
        if particles.shape[c] >= 0 and particles.shape_push[c] > 0.0:
            if wp.dot(particles.shape_normal[c], n) < -OPPOSED:
                found = c
    return found


@wp.func
def bound_all(particles: Particles, world: int, rank: int, size: int):
    """`bound` all particles that shapes bound, with friction."""
    for k in range(rank, particles.bounded_count[world], size):
        bound(particles, particles.bounded[world * particles.count + k], 1)
