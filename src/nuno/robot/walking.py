"""Walking: from a place, footsteps or a velocity to a walk that the robot can do.

Footsteps give the wanted zero moment point; preview control the motion of the centre of mass for a cart on a table;
the legs follow it. What the zero moment point of all links then misses goes through the same controller once more, and
corrects the centre of mass (Kajita et al. 2003, section V). Inverse dynamics checks the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, WalkError
from nuno.robot.footsteps import Footstep, footsteps_along, footsteps_to, middle_of, moved, steps_of_velocity
from nuno.robot.gravity import EARTH
from nuno.robot.preview_control import TICK
from nuno.robot.stride import Stride
from nuno.robot.walk import Walk
from nuno.robot.walk_planner import MARGIN, Arms, WalkPlanner, rest_of
from nuno.validation import checked, number

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid


@checked
def plan_walk(
    robot: Humanoid, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, *, stride: Stride | None = None,
    arms: Arms = None, load: tuple[float, ArrayLike] | None = None, margin: float = MARGIN,
    check_collisions: bool = True, gravity: Sequence[float] = EARTH,
) -> Walk:  # fmt: skip
    """Plan a walk to a place seen from where the robot stands; the robot itself stays as it is.

    Args:
        robot: The robot, with both soles on the floor.
        x: Ahead of the middle between its feet [m].
        y: To the left [m].
        yaw: Turn, counterclockwise [rad]; the shorter way round is taken.
        stride: How it walks; None is ``Stride.of(robot)``.
        arms: What the joints that are not of the legs do: None keeps them as they are; angles by name [rad] are held
            all the while; a ``JointTrajectory`` begins with the walk, from where the joints are (give velocities with
            it: where joints start and stop at once, the zero moment point jumps).
        load: What it carries beside its own links: mass [kg], and where (3,) in the frame of the base link [m].
        margin: By which the zero moment point must stay inside the soles that stand [m].
        check_collisions: Whether links must not run into each other (looked at every 0.1 s).
        gravity: (3,) [m/s2], along -z.

    Raises:
        WalkError: it cannot walk so; the message says why, and what helps.
        RobotModelError: it has not two legs of six joints, or its feet have no size.
        InvalidInputError: not finite, arms beyond their limits, or joints of the legs among them.
        UnknownNameError: no joint of a name among ``arms``.
    """
    planner = WalkPlanner(robot, stride, arms, load, margin, check_collisions, gravity)
    ahead = np.array([number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw))])
    feet = planner.feet[:, [0, 1, 3]]
    return planner.first(footsteps_to(moved(middle_of(feet), ahead), feet, planner.stride, planner.soles))


@checked
def plan_walk_velocity(
    robot: Humanoid, vx: float = 0.0, vy: float = 0.0, vyaw: float = 0.0, seconds: float = 1.0, *,
    stride: Stride | None = None, arms: Arms = None, load: tuple[float, ArrayLike] | None = None,
    margin: float = MARGIN, check_collisions: bool = True, gravity: Sequence[float] = EARTH,
) -> Walk:  # fmt: skip
    """Plan a walk at a velocity, which is kept for some seconds, from standing to standing.

    The robot covers the velocity times the seconds; shifting its weight before and coming to rest after take longer.

    Args:
        robot: The robot.
        vx: Ahead [m/s].
        vy: To the left [m/s].
        vyaw: Counterclockwise [rad/s].
        seconds: For how long [s].
        stride: As in ``plan_walk``, likewise what follows.
        arms: What the other joints do.
        load: What the robot carries.
        margin: Of the zero moment point [m].
        check_collisions: Whether links must not run into each other.
        gravity: (3,) [m/s2], along -z.

    Raises:
        InvalidInputError: it is faster than the stride allows; else as ``plan_walk``.
        WalkError: as ``plan_walk``.
    """
    planner = WalkPlanner(robot, stride, arms, load, margin, check_collisions, gravity)
    twist, count = _twist(vx, vy, vyaw, seconds, planner.stride)
    feet = planner.feet[:, [0, 1, 3]]
    steps = footsteps_along(twist, feet, planner.stride, count, None, planner.soles) if count else []
    return planner.first(tuple(steps))


@checked
def plan_walk_footsteps(
    robot: Humanoid, footsteps: Sequence[Footstep], *, stride: Stride | None = None, arms: Arms = None,
    load: tuple[float, ArrayLike] | None = None, margin: float = MARGIN, check_collisions: bool = True,
    gravity: Sequence[float] = EARTH,
) -> Walk:  # fmt: skip
    """Plan a walk over given footsteps, in the world.

    The feet may end in any stance.

    Args:
        robot: Left as it was.
        footsteps: In the order in which they are taken.
        stride: Of which only the times and the lift count.
        arms: As for ``plan_walk``, as is all that follows.
        load: Likewise.
        margin: Likewise [m].
        check_collisions: Likewise.
        gravity: Likewise (3,) [m/s2].

    Raises:
        InvalidInputError: something else than footsteps; and as ``plan_walk``.
        WalkError: as ``plan_walk``.
    """
    steps = tuple(footsteps)
    if any(not isinstance(step, Footstep) for step in steps):
        raise InvalidInputError(f"footsteps must be a sequence of Footstep, got {footsteps!r}")
    return WalkPlanner(robot, stride, arms, load, margin, check_collisions, gravity).first(steps)


@checked
def continue_walk(
    walk: Walk, time: float, vx: float = 0.0, vy: float = 0.0, vyaw: float = 0.0, seconds: float = 1.0
) -> Walk:
    """Plan how a walk goes on otherwise, at a velocity, from a time on while it is under way.

    The foot that is in the air lands where it was to land. To walk until told otherwise, call it again before the walk
    ends. A walk that has made its last step ends as planned, and the next begins from there.

    Args:
        walk: The walk.
        time: From which the result holds [s]; the motion is continuous there.
        vx: Ahead [m/s].
        vy: To the left [m/s].
        vyaw: Counterclockwise [rad/s].
        seconds: For how long that is kept [s].

    Raises:
        InvalidInputError: a time that is not in the walk, or faster than the stride allows.
        WalkError: the robot cannot walk so.
    """
    planner = walk.plan.planner
    twist, count = _twist(vx, vy, vyaw, seconds, planner.stride)
    if not count:
        return stop_walk(walk, time)

    def steps(feet: np.ndarray, first: int | None) -> list[Footstep]:
        return footsteps_along(twist, feet, planner.stride, count, first, planner.soles)

    return planner.changed(walk, time, steps, True)


@checked
def stop_walk(walk: Walk, time: float) -> Walk:
    """Plan how a walk that is under way ends as soon as it safely can.

    The foot that is in the air lands where it was to land, the other is put down beside it, and the robot comes to
    rest. Before the first step it stays, where the weight is not yet on one foot. Where no earlier end is safe, it ends
    as planned.

    Args:
        walk: The walk.
        time: From which the result holds [s].

    Raises:
        InvalidInputError: a time that is not in the walk.
    """
    planner = walk.plan.planner

    def steps(feet: np.ndarray, first: int | None) -> list[Footstep]:
        if first is None:
            return []
        offset = planner.stride.stance * (1.0 if first == 0 else -1.0)
        place = moved(feet[1 - first], np.array([0.0, offset, 0.0]))
        return [Footstep(first, *(float(part) for part in place))]

    try:
        return planner.changed(walk, time, steps, False)
    except WalkError:  # as planned it ends too
        return rest_of(walk, round(time / TICK))


def _twist(vx: float, vy: float, vyaw: float, seconds: float, stride: Stride) -> tuple[np.ndarray, int]:
    """Return a velocity times time (3,) [m, m, rad] and the number of steps for it, 0 of no motion."""
    velocity = np.array([number(name, value) for name, value in (("vx", vx), ("vy", vy), ("vyaw", vyaw))])
    span = number("seconds", seconds, above=0.0)
    return velocity * span, steps_of_velocity(velocity, span, stride) if np.any(velocity) else 0
