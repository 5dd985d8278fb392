"""Contacts between bodies that move: rows of up to four particles, or of particles and a rigid body.

A row says that a weighted sum of particles, less a point of a rigid body where there is one, keeps a distance along
a normal. Its multipliers add up over the passes of a substep, so that the friction of all passes together stays in
Coulomb's cone of the push of all passes together: what sticks does not creep, however many passes the push takes.
(The projections themselves are in `nuno.coupled.row_projections`.)

Where all are solved at once, by many threads, each row sees its particles' and bodies' masses split evenly among the
rows that press on them (Tonge, Benevolenski and Voroshilov, "Mass splitting for jitter-free parallel rigid body
simulation", 2012), and the moves are summed in fixed point: the sums, and so the bits, are the same in any order. From
pass to pass a multiplier goes on as it went (Polyak 1964), until it turns round (O'Donoghue and Candès, "Adaptive
restart for accelerated gradient schemes", 2015): without that, 2,000 passes are as good as 96 with it.
"""

import warp as wp

from nuno.coupled.bounded_particles import Particles
from nuno.rigid.rigid_body import RigidState, inverse_mass_at, point_motion, point_of, shift_whole, turn_whole

LEAVE_SPEED = wp.constant(0.5)
"""[m/s] What is found too close parts no faster than this."""
MOMENTUM = wp.constant(0.8)
"""Share of a multiplier's last change that comes on top of the next, where that has its direction. With 0.5 a cube
that bounced on a towel is three times as far from where endless passes bring it, with 0 four times, with 0.9 as far."""
UNIT = wp.constant(1.0e-14)
"""[m], [rad] Step of the fixed-point sums, whose numbers have 64 bits. A push that moves a vertex by 1 um moves a body
a thousand times as heavy by 1 nm: with steps of 10 nm that was lost, and pushes grew by up to four fifths until what
was left of them bore the body."""


@wp.struct
class Rows:
    """Contacts, room for ``room`` a world, ``count`` of them used."""

    room: int
    count: wp.array(dtype=int)
    corners: wp.array(dtype=wp.vec4i)  # -1: none; in a vertex-triangle row the vertex is first
    kind: wp.array(dtype=int)
    slot: wp.array(dtype=int)  # of the rigid body, -1: none
    part: wp.array(dtype=int)  # of the rigid body
    bodies: wp.array(dtype=wp.vec2i)
    point: wp.array(dtype=wp.vec3)  # in the rigid body's frame
    weights: wp.array(dtype=wp.vec4)
    normal: wp.array(dtype=wp.vec3)
    distance: wp.array(dtype=float)
    friction: wp.array(dtype=float)
    compliance: wp.array(dtype=float)  # how far a unit of its multiplier presses the cloth in it together [1/kg]
    squeeze: wp.array(dtype=float)  # and how far that goes at most [m]
    push: wp.array(dtype=float)
    drag: wp.array(dtype=wp.vec3)
    # of an active row with a rigid body, the next one of the same particle, -1: none
    next: wp.array(dtype=int)
    mate: wp.array(dtype=int)  # the row of the body on the particle's other side, -1: none; see `link_supports`
    # where all are solved at once: whether it has a share of the masses, and what its multipliers last changed by
    sharing: wp.array(dtype=int)
    push_change: wp.array(dtype=float)
    drag_change: wp.array(dtype=wp.vec3)
    # those that may touch in this substep
    active: wp.array(dtype=int)
    active_count: wp.array(dtype=int)


VERTEX_TRIANGLE, EDGE_EDGE, VERTEX_RIGID, TRIANGLE_RIGID, EDGE_RIGID = 0, 1, 2, 3, 4


def row_room(worlds: int, room: int, device: str) -> Rows:
    """Return room for ``room`` rows a world, of which none is used."""
    made = Rows()
    made.room = room
    made.count = wp.zeros(worlds, dtype=int, device=device)
    made.active_count = wp.zeros(worlds, dtype=int, device=device)
    kinds = {
        "corners": wp.vec4i, "kind": int, "slot": int, "part": int, "bodies": wp.vec2i, "point": wp.vec3,
        "weights": wp.vec4, "normal": wp.vec3, "distance": float, "friction": float, "compliance": float,
        "squeeze": float, "push": float, "drag": wp.vec3, "next": int, "mate": int, "sharing": int,
        "push_change": float, "drag_change": wp.vec3, "active": int,
    }  # fmt: skip
    for name, dtype in kinds.items():
        setattr(made, name, wp.zeros(worlds * room, dtype=dtype, device=device))
    return made


@wp.func
def blend(x: wp.array(dtype=wp.vec3), first: int, corners: wp.vec4i, weights: wp.vec4):
    """The weighted sum of a row's particles."""
    total = wp.vec3(0.0, 0.0, 0.0)
    for k in range(4):
        if corners[k] >= 0:
            total += x[first + corners[k]] * weights[k]
    return total


@wp.func
def row_gap(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int):
    """Return where a row's particles are, from the rigid body's point if there is one."""
    at = blend(particles.p, first, rows.corners[r], rows.weights[r])
    at = at + blend(particles.u, first, rows.corners[r], rows.weights[r])
    if rows.slot[r] >= 0:
        at = at - point_of(rigid, start + rows.slot[r], rows.point[r])
    return at


@wp.func
def row_slip(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int):
    """Return how far a row's particles moved in the substep, over what the rigid body's point did."""
    slip = blend(particles.u, first, rows.corners[r], rows.weights[r])
    if rows.slot[r] >= 0:
        i = start + rows.slot[r]
        slip = slip - point_motion(rigid, i, rows.point[r])
    return slip


@wp.func
def body_weight(particles: Particles, rigid: RigidState, start: int, rows: Rows, r: int, n: wp.vec3, at_once: int):
    """Return how far a row's rigid body gives way along n for a unit of its multiplier, if it has one."""
    w = float(0.0)
    if rows.slot[r] >= 0:
        i = start + rows.slot[r]
        w = inverse_mass_at(rigid, i, wp.quat_rotate(rigid.rotation[i], rows.point[r]), n)
        if at_once != 0:
            w = w * float(particles.body_sharers[i])
    return w


@wp.func
def corner_weight(particles: Particles, i: int, at_once: int):
    """A particle's inverse mass, or its part of it where all rows are solved at once."""
    w = particles.w[i]
    if at_once != 0:
        w = w * float(particles.sharers[i])
    return w


@wp.func
def corners_weight(particles: Particles, first: int, rows: Rows, r: int, at_once: int):
    """Return how far a row's particles give way for a unit of its multiplier, where nothing bounds them."""
    corners = rows.corners[r]
    weights = rows.weights[r]
    total = float(1.0e-9)
    for k in range(4):
        if corners[k] >= 0:
            total += weights[k] * weights[k] * corner_weight(particles, first + corners[k], at_once)
    return total


@wp.func
def row_weight(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, n: wp.vec3,
               at_once: int):  # fmt: skip
    """Return how far a row gives way along n for a unit of its multiplier."""
    weight = corners_weight(particles, first, rows, r, at_once)
    return weight + body_weight(particles, rigid, start, rows, r, n, at_once)


@wp.func
def fix(moved: wp.array(dtype=wp.int64), k: int, d: wp.vec3):
    """Add a vector to a fixed-point sum."""
    for c in range(3):
        wp.atomic_add(moved, 3 * k + c, wp.int64(wp.rint(d[c] / UNIT)))


@wp.func
def apply_row(particles: Particles, rigid: RigidState, first: int, start: int, rows: Rows, r: int, impulse: wp.vec3,
              at_once: int):  # fmt: skip
    """Move what is in a row by the multiplier ``impulse`` [kg m]; the rigid body by as much the other way."""
    corners = rows.corners[r]
    weights = rows.weights[r]
    for k in range(4):
        if corners[k] >= 0:
            i = first + corners[k]
            d = impulse * (weights[k] * particles.w[i])
            if at_once != 0:
                fix(particles.moved, i, d)
            else:
                particles.u[i] = particles.u[i] + d
    if rows.slot[r] >= 0:
        i = start + rows.slot[r]
        arm = wp.quat_rotate(rigid.rotation[i], rows.point[r])
        if at_once != 0:
            fix(particles.body_moved, 2 * i, -impulse * rigid.weight[i])
            fix(particles.body_moved, 2 * i + 1, rigid.give[i] * wp.cross(arm, -impulse))
        else:
            shift_whole(rigid, i, rigid.weight[i] * -impulse)
            turn_whole(rigid, i, rigid.give[i] * wp.cross(arm, -impulse))


@wp.func
def summed(moved: wp.array(dtype=wp.int64), k: int):
    """A fixed-point sum as a vector; it starts anew."""
    total = wp.vec3(float(moved[3 * k]), float(moved[3 * k + 1]), float(moved[3 * k + 2])) * UNIT
    for c in range(3):
        moved[3 * k + c] = wp.int64(0)
    return total


@wp.func
def take_sums(particles: Particles, rigid: RigidState, first: int, start: int, rank: int, size: int):
    """Apply the summed moves of all rows, and count those that joined."""
    for k in range(rank, particles.count, size):
        i = first + k
        if particles.sharers[i] > 0:
            particles.u[i] = particles.u[i] + summed(particles.moved, i)
        particles.sharers[i] = particles.sharers[i] + particles.joining[i]
        particles.joining[i] = 0
    for k in range(rank, rigid.capacity, size):
        i = start + k
        if particles.body_sharers[i] > 0:
            shift_whole(rigid, i, summed(particles.body_moved, 2 * i))
            turn = summed(particles.body_moved, 2 * i + 1)
            # passes over others' contacts must not round it
            if wp.length_sq(turn) > 0.0:
                turn_whole(rigid, i, turn)
        particles.body_sharers[i] = particles.body_sharers[i] + particles.body_joining[i]
        particles.body_joining[i] = 0


@wp.func
def forget_sharers(particles: Particles, rigid: RigidState, first: int, start: int, rank: int, size: int):
    """No row has a share of anything."""
    for k in range(rank, particles.count, size):
        particles.sharers[first + k] = 0
    for k in range(rank, rigid.capacity, size):
        particles.body_sharers[start + k] = 0
