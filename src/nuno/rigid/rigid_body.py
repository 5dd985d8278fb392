"""The state of rigid bodies on the device, and what moves one: prediction, correction at a point, velocities.

After Müller, Macklin, Chentanez, Jeschke, Kim: "Detailed rigid body simulation with extended position based dynamics"
(SCA 2020). Body k of world w stands at ``w * capacity + k``. A body's frame has its origin at the centre of mass.

A body that is not part of the run (static, kinematic, or left out) has zero `weight` and `give`: whatever is applied
to it moves nothing.
"""

import warp as wp


@wp.struct
class RigidState:
    """All rigid bodies of all worlds; quaternions are Warp's (x, y, z, w)."""

    capacity: int
    worlds: int
    active: wp.array(dtype=int)  # (capacity,) 0: left out, 1: dynamic, 2: moved at its velocity
    position: wp.array(dtype=wp.vec3)  # of the centre of mass, relative to the world's origin [m]
    rotation: wp.array(dtype=wp.quat)  # body to world
    position_before: wp.array(dtype=wp.vec3)  # where the substep began
    rotation_before: wp.array(dtype=wp.quat)
    position_free: wp.array(dtype=wp.vec3)  # where the substep would end without contacts
    rotation_free: wp.array(dtype=wp.quat)
    lost: wp.array(dtype=wp.vec3)  # what rounding took of the substep's corrections by ties and joints [m]
    left: wp.array(dtype=wp.vec3)  # what it left over of those by rows, for the next of them [m]
    left_turn: wp.array(dtype=wp.vec3)  # and of their turns, as `rotation_between` has them
    velocity: wp.array(dtype=wp.vec3)  # of the centre of mass [m/s]
    spin: wp.array(dtype=wp.vec3)  # angular velocity, world frame [rad/s]
    force: wp.array(dtype=wp.vec3)  # [N]
    torque: wp.array(dtype=wp.vec3)  # [N m]
    drag: wp.array(dtype=float)  # rate at which the air takes velocity and spin [1/s]
    inverse_mass: wp.array(dtype=float)  # [1/kg], 0: not dynamic
    inertia: wp.array(dtype=wp.mat33)  # about the centre of mass, body frame [kg m2]
    inverse_inertia: wp.array(dtype=wp.mat33)
    weight: wp.array(dtype=float)  # the inverse mass in this run [1/kg], negative once a hold says where it is
    give: wp.array(dtype=wp.mat33)  # the inverse inertia in this run, world frame, of where the substep began
    pressed: wp.array(dtype=wp.vec3)  # sum of the normals of what touches it and cannot go: see `note_pressed`
    caught: wp.array(dtype=int)  # 1 where two of them, or those of two joined bodies, oppose each other
    joined: wp.array(dtype=int)  # 1 once joints say where it is in this substep, 2: see `note_parted`


@wp.func
def rotated_by(angle: wp.vec3, q: wp.quat):
    """``q`` turned by a rotation vector [rad] in the world frame."""
    size = wp.length(angle)
    half = 0.5 * size
    scale = float(0.5)
    if size > 1.0e-6:
        scale = wp.sin(half) / size
    turn = wp.quat(scale * angle[0], scale * angle[1], scale * angle[2], wp.cos(half))
    return wp.normalize(turn * q)


@wp.func
def rotation_between(start: wp.quat, end: wp.quat):
    """The rotation from start to end, world frame, as twice the tangent of half its angle, along its axis."""
    d = end * wp.quat_inverse(start)
    scale = 2.0 / d[3]
    return wp.vec3(scale * d[0], scale * d[1], scale * d[2])


@wp.func
def fine_turn(start: wp.quat, end: wp.quat):
    """`rotation_between` of rotations that are close, true to all its digits.

    Floats hold the difference of two such quaternions exactly; of their product, 1 and a little, they round the little.
    """
    d = (end - start) * wp.quat_inverse(start)
    scale = 2.0 / (1.0 + d[3])
    return wp.vec3(scale * d[0], scale * d[1], scale * d[2])


@wp.func
def turned(start: wp.quat, turn: wp.vec3):
    """The inverse of `rotation_between`: exact, and without trigonometry."""
    return wp.normalize(wp.quat(0.5 * turn[0], 0.5 * turn[1], 0.5 * turn[2], 1.0) * start)


@wp.func
def in_world(q: wp.quat, body: wp.mat33):
    """A tensor in the body's frame as a tensor in the world's."""
    r = wp.quat_to_matrix(q)
    return r * body * wp.transpose(r)


@wp.func
def inverse_mass_at(s: RigidState, i: int, arm: wp.vec3, direction: wp.vec3):
    """Return the inverse mass of a point, ``arm`` from the centre of mass, along ``direction`` [1/kg].

    The generalised inverse mass of Müller et al., equation 2.
    """
    lever = wp.cross(arm, direction)
    return s.weight[i] * wp.dot(direction, direction) + wp.dot(lever, s.give[i] * lever)


@wp.func
def shift_body(s: RigidState, i: int, d: wp.vec3):
    """Move a body by d; what is lost where the coordinate is rounded still counts in its velocity."""
    x = s.position[i]
    y = x + d
    s.lost[i] = s.lost[i] + (d - (y - x))
    s.position[i] = y


@wp.func
def turn_body(s: RigidState, i: int, turn: wp.vec3):
    """Turn a body; one that corrections do not move keeps every bit, which rounding would not leave it."""
    if s.weight[i] > 0.0:
        s.rotation[i] = turned(s.rotation[i], turn)


@wp.func
def shift_whole(s: RigidState, i: int, d: wp.vec3):
    """Move a body by d; what is left over where the coordinate is rounded comes with the next such move.

    For what reads off how far the body has come, with all that is left over; what reads off where it is, as joints do,
    would ask for it again and again.
    """
    x = s.position[i]
    d = d + s.left[i]
    y = x + d
    s.left[i] = d - (y - x)
    s.position[i] = y


@wp.func
def turn_whole(s: RigidState, i: int, turn: wp.vec3):
    """Turn a body as `shift_whole` moves it; one that corrections do not move keeps every bit."""
    if s.weight[i] > 0.0:
        q = s.rotation[i]
        turn = turn + s.left_turn[i]
        after = turned(q, turn)
        s.left_turn[i] = turn - fine_turn(q, after)
        s.rotation[i] = after


@wp.func
def apply_rigid_correction(s: RigidState, i: int, arm: wp.vec3, correction: wp.vec3):
    """Move a body by a positional impulse [kg m] at ``arm`` from its centre of mass (equations 6 to 9).

    With a multiplier of dlambda along n, which moves a particle of inverse mass w by w dlambda n, the correction of
    the body on the other side is -dlambda n.
    """
    shift_body(s, i, s.weight[i] * correction)
    turn_body(s, i, s.give[i] * wp.cross(arm, correction))


@wp.func
def point_of(s: RigidState, i: int, local: wp.vec3):
    """Return where a point of the body's frame is now, in the world."""
    return s.position[i] + wp.quat_rotate(s.rotation[i], local)


@wp.func
def point_before(s: RigidState, i: int, local: wp.vec3):
    """Return where a point of the body's frame was when the substep began."""
    return s.position_before[i] + wp.quat_rotate(s.rotation_before[i], local)


@wp.func
def point_motion(s: RigidState, i: int, local: wp.vec3):
    """Return how far a point of the body's frame has come in the substep, with what rounding left over.

    The difference of its two places has an error of their last digit, 2 to 4 nm at 5 cm. Friction would take that for a
    slip in every substep, and what stands would creep by micrometres a second.
    """
    arm = wp.quat_rotate(s.rotation_before[i], local)
    turn = fine_turn(s.rotation_before[i], s.rotation[i]) + s.left_turn[i]
    swept = wp.cross(turn, arm)
    swept = (swept + 0.5 * wp.cross(turn, swept)) / (1.0 + 0.25 * wp.dot(turn, turn))
    return s.position[i] - s.position_before[i] + s.left[i] + swept


@wp.func
def begin_body(s: RigidState, i: int, role: int):
    """Keep where a body is, and take its weight in this substep."""
    q = s.rotation[i]
    s.position_before[i] = s.position[i]
    s.rotation_before[i] = q
    s.joined[i] = 0
    s.caught[i] = 0
    s.pressed[i] = wp.vec3(0.0)
    w = s.inverse_mass[i]
    if role == 1 and w > 0.0:
        s.weight[i] = w
        s.give[i] = in_world(q, s.inverse_inertia[i])
    else:
        s.weight[i] = 0.0
        s.give[i] = wp.mat33(0.0)


@wp.func
def push_body(s: RigidState, i: int, gravity: wp.vec3, dt: float):
    """Add to a body's velocity what gravity, force and torque give in the substep, and take what the air takes."""
    if s.weight[i] > 0.0:
        slow = 1.0 / (1.0 + s.drag[i] * dt)
        s.velocity[i] = (s.velocity[i] + dt * (gravity + s.weight[i] * s.force[i])) * slow
        s.spin[i] = (s.spin[i] + dt * (s.give[i] * s.torque[i])) * slow


@wp.func
def move_body(s: RigidState, i: int, role: int, dt: float):
    """Move a body at its velocity; a free one keeps its angular momentum, to rounding.

    The rotation is an explicit midpoint step: the spin in the middle is what the angular momentum makes with the
    inertia as it is turned there.
    """
    x = s.position_before[i]
    q = s.rotation_before[i]
    v = s.velocity[i]
    spin = s.spin[i]
    if role == 1 and s.inverse_mass[i] > 0.0:
        x = x + dt * v
        # differences of the inverse inertia: its products with the inertia are 1 but for rounding, always alike
        momentum = in_world(q, s.inertia[i]) * spin
        there = s.give[i] * momentum
        half = in_world(rotated_by(0.5 * dt * spin, q), s.inverse_inertia[i]) * momentum
        q = rotated_by(dt * (spin + (half - there)), q)
        s.spin[i] = spin + (in_world(q, s.inverse_inertia[i]) * momentum - there)
    elif role == 2 and wp.length_sq(v) + wp.length_sq(spin) > 0.0:
        # what stands in this world and is led in others keeps its rotation, which would be rounded
        x = x + dt * v
        q = rotated_by(dt * spin, q)
    s.position[i] = x
    s.rotation[i] = q
    s.position_free[i] = x
    s.rotation_free[i] = q
    s.lost[i] = wp.vec3(0.0)
    s.left[i] = wp.vec3(0.0)
    s.left_turn[i] = wp.vec3(0.0)


@wp.func
def read_velocity(s: RigidState, i: int, role: int, dt: float):
    """Add to the free velocities what corrections moved in the substep.

    A body that nothing touched so keeps its velocity to the bit, and rounding of coordinates stays out of it. Turns are
    subtracted as contacts add to them: an impulse gives the spin then that it gave the turn, and no energy is made of
    the difference between an angle and twice the tangent of its half.
    """
    if role == 1 and s.inverse_mass[i] > 0.0:
        s.velocity[i] = s.velocity[i] + (s.position[i] - s.position_free[i] + (s.lost[i] + s.left[i])) / dt
        start = s.rotation_before[i]
        free = rotation_between(start, s.rotation_free[i])
        now = rotation_between(start, s.rotation[i])
        s.spin[i] = s.spin[i] + (now - free + s.left_turn[i]) / dt
