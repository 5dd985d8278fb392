"""Drives along a joint's free direction: friction, spring, motor and stops, in closed form."""

import warp as wp

from nuno.coupled.joint_response import (
    DAMPING,
    DRIVES,
    EFFORT,
    FRICTION,
    HINGE,
    LOWER,
    POSITION,
    REST,
    SPRING,
    SPRING_DAMPING,
    STIFFNESS,
    UPPER,
    VELOCITY,
    Block,
    Joints,
    apply_joint,
    inverted,
    other_frame,
    respond,
)
from nuno.coupled.tie_constraints import CATCH_UP, within
from nuno.rigid.rigid_body import RigidState, point_before, point_of, rotation_between


@wp.func
def rotation_angle(turn: wp.vec3):
    """The rotation vector [rad] of a `rotation_between`."""
    half = 0.5 * wp.length(turn)
    scale = float(1.0)
    if half > 1.0e-4:
        scale = wp.atan(half) / half
    return scale * turn


@wp.func
def angle_about(start: wp.quat, end: wp.quat):
    """The angle [rad] of the turn from start to end about the z axis of start, from -pi to pi."""
    d = wp.quat_inverse(start) * end
    sign = float(1.0)
    if d[3] < 0.0:
        sign = -1.0
    return 2.0 * wp.atan2(sign * d[2], sign * d[3])


@wp.func
def wrapped(angle: float):
    """An angle, or what is left of it beyond whole turns, from -pi to pi."""
    return angle - 2.0 * wp.pi * wp.round(angle / (2.0 * wp.pi))


MUCH = wp.constant(0.5)
"""Share of what a joint bears at most, from which on its motor without a limit gives no more than before."""
HOLDS, UNDECIDED = wp.constant(0), wp.constant(2)
"""Friction that holds, and a state of friction that is asked for. Where it slides the state is 1 or -1."""


@wp.func
def driven(
    drive: wp.array(dtype=float), first: int, w: float, start: float, free: float, dt: float, state: int, may: int,
    bound: float,
):  # fmt: skip
    """Return how far the free direction comes from ``free``, and the slope there of what acts along it.

    The slope is what a unit more of way takes of the multiplier; it is infinite where a stop, friction or a motor that
    keeps its velocity hold it.

    Args:
        drive: What acts along it.
        first: Where its numbers begin.
        w: How far a unit of multiplier moves it.
        start: Where the substep began.
        free: Where it ends without what acts along it.
        dt: Of the substep [s].
        state: Whether friction held or slid, up to now; `UNDECIDED` before it is known.
        may: 0 where friction stays in that state.
        bound: The most that a motor gives, a multiplier: see `motor_bound`.

    Returns:
        The two, and the state of friction.
    """
    h2 = dt * dt
    back = start - free
    # spring: at the start's stretch, which keeps energy, as far as that is stable
    k = drive[first + SPRING] * h2
    late = float(0.0)
    if k * w > 1.0:
        late = 1.0 - 1.0 / (k * w)
    damp = drive[first + SPRING_DAMPING] * dt
    passive = k * late + damp
    force = k * (drive[first + REST] - start) + k * late * back + damp * back
    stiff = 1.0 / w + passive
    # motor
    most = wp.min(drive[first + EFFORT] * h2, bound)
    kd = drive[first + DAMPING]
    exact = wp.isinf(kd)
    a = drive[first + STIFFNESS] * h2
    b = a * (drive[first + POSITION] - free)
    aim = back + drive[first + VELOCITY] * dt
    if not exact:
        a = a + kd * dt
        b = b + kd * dt * aim
    # friction: whether it holds where the substep began
    held = wp.clamp(b - a * back, -most, most)
    if exact:
        held = wp.clamp(stiff * back - force, -most, most)
        if aim > back:
            held = most
        if aim < back:
            held = -most
    needed = stiff * back - force - held
    rub = drive[first + FRICTION] * h2
    went = back
    slope = float(passive + a)
    if rub > 0.0 or exact:
        slope = wp.inf
    slides = int(HOLDS)
    if wp.abs(needed) > rub:
        slides = wp.where(needed > 0.0, 1, -1)
    if state != UNDECIDED and slides != state and rub > 0.0:
        if may == 0:
            slides = state
        elif state != HOLDS:
            # it stops before it goes the other way: what carries the joint gives way, too, which is not in w
            slides = HOLDS
    if slides != HOLDS:
        sum = force + float(slides) * rub
        effort = b - a * ((sum + b) / (stiff + a))
        slope = passive + a
        if exact:
            effort = stiff * aim - sum
            slope = wp.inf
        if wp.abs(effort) > most:
            effort = wp.sign(effort) * most
            slope = passive
        went = (sum + effort) / stiff
    # stops; what starts beyond one comes back no faster than other joints mend
    low = wp.min(drive[first + LOWER] - free, back + CATCH_UP * dt)
    high = wp.max(drive[first + UPPER] - free, back - CATCH_UP * dt)
    if went < low or went > high:
        slope = wp.inf
    if rub <= 0.0:
        slides = HOLDS  # without friction it is no state at all, and must not say that it changed
    return wp.clamp(went, low, high), slope, slides


@wp.func
def motor_bound(joints: Joints, r: int, dt: float):
    """Return the most that a joint's motor without a limit gives in this pass: no more than before if it bears much.

    What drives a body against one that cannot go finds no rest: pass after pass motor and contact grow, until
    the joint bears no more and opens.
    """
    bound = float(wp.inf)
    if wp.isinf(joints.drive[r * DRIVES + EFFORT]):
        much = MUCH * joints.limit[r] * dt * dt
        if wp.length_sq(joints.pull[r]) > much * much or wp.length_sq(joints.twist[r]) > much * much:
            bound = wp.abs(joints.axial[r])
    return bound


@wp.func
def project_axis(
    rigid: RigidState, joints: Joints, block: Block, world: int, k: int, dt: float, axis: wp.vec3, arm: wp.vec3,
    other_arm: wp.vec3,
):  # fmt: skip
    """Along the free direction of a hinge or slider: one projection of all that acts there."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    turn = rigid.rotation[i] * joints.turn[r]
    before = rigid.rotation_before[i] * joints.turn[r]
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
    place, other_turn, place_before, other_before = other_frame(rigid, joints, world, k)
    pull = wp.vec3(0.0, 0.0, 0.0)
    twist = wp.vec3(0.0, 0.0, 0.0)
    if joints.kind[k] == HINGE:
        start = angle_about(other_before, before)
        now = start + wrapped(angle_about(other_turn, turn) - start)
        pull, twist = respond(block, block.lever * axis, block.spin * axis)
        w = wp.dot(axis, block.spin * axis) + wp.dot(block.lever * axis, pull) + wp.dot(block.spin * axis, twist)
        twist = twist + axis
    else:
        now_axis = wp.quat_rotate(other_turn, wp.vec3(0.0, 0.0, 1.0))
        start = wp.dot(axis, point_before(rigid, i, joints.place[r]) - place_before)
        now = wp.dot(now_axis, point_of(rigid, i, joints.place[r]) - place)
        turns = wp.transpose(block.lever) * axis
        pull, twist = respond(block, block.push * axis, turns)
        w = wp.dot(axis, block.push * axis) + wp.dot(block.push * axis, pull) + wp.dot(turns, twist)
        pull = pull + axis
    old = joints.axial[r]
    bound = motor_bound(joints, r, dt)
    went, _slope, _state = driven(joints.drive, r * DRIVES, w, start, now - w * old, dt, UNDECIDED, 1, bound)
    change = went / w - old
    joints.axial[r] = old + change
    joints.pull[r] = joints.pull[r] + pull * change
    joints.twist[r] = joints.twist[r] + twist * change
    apply_joint(rigid, i, j, arm, other_arm, pull * change, twist * change)


@wp.func
def project_ball(
    rigid: RigidState, joints: Joints, block: Block, world: int, k: int, dt: float, arm: wp.vec3, other_arm: wp.vec3
):
    """A ball joint's friction and spring in all directions, then the cone that its axis stays in."""
    r = world * joints.count + k
    i = world * rigid.capacity + joints.slot[k]
    j = int(-1)
    first = r * DRIVES
    own = joints.turn[r]
    others = joints.other_turn[r]
    went = rotation_between(rigid.rotation_before[i], rigid.rotation[i])
    before = others
    if joints.other[k] >= 0:
        j = world * rigid.capacity + joints.other[k]
        went = went - rotation_between(rigid.rotation_before[j], rigid.rotation[j])
        before = rigid.rotation_before[j] * others
    # how far a torque turns the two where their places are kept
    gives = block.spin - wp.transpose(block.lever) * block.push_inverse * block.lever
    k_spring = drive_of(joints, first, SPRING) * dt * dt
    rub = drive_of(joints, first, FRICTION) * dt * dt
    damp = drive_of(joints, first, SPRING_DAMPING) * dt
    old = joints.free[r]
    torque = wp.vec3(0.0, 0.0, 0.0)
    if k_spring > 0.0 or rub > 0.0 or damp > 0.0:
        late = wp.max(0.0, 1.0 - 1.0 / wp.max(k_spring * wp.trace(gives), 1.0))
        slope = k_spring * late + damp
        start = rigid.rotation_before[i] * own
        aside = rotation_angle(rotation_between(before, start))
        free = went - gives * old
        stiff = block.spin_inverse + wp.identity(n=3, dtype=float) * slope
        pushed = block.spin_inverse * free - aside * k_spring
        # with no turn at all in the substep, friction would have to bear this
        needed = -pushed
        if wp.length(needed) > rub:
            pushed = pushed + within(needed, rub)
            turn = inverted(stiff) * pushed
            torque = block.spin_inverse * (turn - free)
        else:
            torque = block.spin_inverse * (-free)
        change = torque - old
        joints.free[r] = torque
        pull, _twist = respond(block, block.lever * change, block.spin * change)
        joints.pull[r] = joints.pull[r] + pull
        joints.twist[r] = joints.twist[r] + change
        apply_joint(rigid, i, j, arm, other_arm, pull, change)
    most = drive_of(joints, first, UPPER)
    if most < 3.0:
        z = wp.vec3(0.0, 0.0, 1.0)
        now = others
        if j >= 0:
            now = rigid.rotation[j] * others
        a = wp.quat_rotate(rigid.rotation[i] * own, z)
        b = wp.quat_rotate(now, z)
        n = wp.cross(b, a)
        sine = wp.length(n)
        if sine > 1.0e-6:
            n = n / sine
            angle = wp.atan2(sine, wp.dot(a, b))
            a = wp.quat_rotate(rigid.rotation_before[i] * own, z)
            b = wp.quat_rotate(before, z)
            most = wp.max(most, wp.atan2(wp.length(wp.cross(b, a)), wp.dot(a, b)) - CATCH_UP * dt)
            w = wp.dot(n, gives * n)
            old_push = joints.axial[r]
            push = wp.min(old_push - (angle - most) / w, 0.0)
            change = n * (push - old_push)
            joints.axial[r] = push
            pull, _twist = respond(block, block.lever * change, block.spin * change)
            joints.pull[r] = joints.pull[r] + pull
            joints.twist[r] = joints.twist[r] + change
            apply_joint(rigid, i, j, arm, other_arm, pull, change)


@wp.func
def drive_of(joints: Joints, first: int, which: int):
    """One of the numbers of what acts along a joint's free direction."""
    return joints.drive[first + which]
