"""Footsteps: where the feet are put down, one after the other, to reach a place or to keep a velocity.

Poses on the floor are arrays (x, y, yaw) [m, m, rad]. Ahead the feet alternate, each going past the other; aside and in
turns one foot opens the stance and the other closes it, so that neither comes near the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nuno.errors import InvalidInputError, WalkError
from nuno.robot.stride import Stride
from nuno.validation import count, number

LEFT, RIGHT = 0, 1
NEAR = 1e-4
"""[m, rad] Feet so near to their places make no step."""
SOLE_GAP = 0.01
"""[m] Least distance between soles."""
MAX_STEPS = 100
"""Of one walk: each takes some 50 ms to plan, and much can happen in the minutes that it takes."""
SLACK = 1e-9
"""By which rounding may make a step longer than its limit."""


@dataclass(frozen=True)
class Footstep:
    """A pose at which a foot is put down.

    Attributes:
        foot: 0 left, 1 right.
        x: Of the middle of the sole in the world [m].
        y: Likewise [m].
        yaw: Of the foot in the world [rad].

    Raises:
        InvalidInputError: another foot, or not finite.
    """

    foot: int
    x: float
    y: float
    yaw: float

    def __post_init__(self) -> None:
        if count("foot", self.foot, low=LEFT, high=RIGHT) not in (LEFT, RIGHT):
            raise InvalidInputError(f"foot must be 0 (left) or 1 (right), got {self.foot!r}")
        for name in ("x", "y", "yaw"):
            object.__setattr__(self, name, number(name, getattr(self, name)))

    @property
    def pose(self) -> np.ndarray:
        """(3,) float, x, y [m] and yaw [rad]."""
        return np.array([self.x, self.y, self.yaw])


def footsteps_to(
    goal: np.ndarray, feet: np.ndarray, stride: Stride, soles: Sequence[np.ndarray] | None = None
) -> tuple[Footstep, ...]:
    """Return the steps to a place: of several ways there, the one of fewest steps.

    The ways are: at one velocity, which bends the path; straight, then turning; turning, straight ahead or backwards,
    turning.

    Args:
        goal: (3,) where the middle between the feet comes to, in the world.
        feet: (2, 3) where the feet stand, left and right.
        stride: How the robot walks.
        soles: Sizes (2,) of left and right [m]; steps are made shorter where soles would come near each other.

    Raises:
        WalkError: it is too far for one walk.
    """
    x, y, yaw = relative(middle_of(feet), goal)
    yaw = math.remainder(yaw, math.tau)
    heading = math.atan2(y, x)
    back = math.remainder(heading + math.pi, math.tau)
    distance = math.hypot(x, y)
    ways = [
        [screw_to(np.array([x, y, yaw]))],
        [np.array([x, y, 0.0]), _turn(yaw)],
        [_turn(heading), np.array([distance, 0.0, 0.0]), _turn(yaw - heading)],
        [_turn(back), np.array([-distance, 0.0, 0.0]), _turn(yaw - back)],
    ]
    plans = [plan for way in ways if (plan := _steps_of(way, feet, stride, soles)) is not None]
    if not plans:
        far = f"{distance:.1f} m take more"
        raise WalkError(f"a walk has at most {MAX_STEPS} steps, and {far}: go there in several walks")
    fewest = min(plans, key=lambda plan: len(plan))
    return tuple(fewest)


def _steps_of(
    way: Sequence[np.ndarray], feet: np.ndarray, stride: Stride, soles: Sequence[np.ndarray] | None
) -> list[Footstep] | None:
    """Return the steps of a way of several velocities, one after the other; None where that does not lead there."""
    steps: list[Footstep] = []
    now = feet.copy()
    for twist in way:
        if np.abs(twist).max() > NEAR or (len(way) == 1 and _not_in_stance(now, stride)):
            # after a leg of the way, the foot that stood longer goes first
            own = None if not steps else 1 - steps[-1].foot
            try:
                steps += footsteps_along(twist, now, stride, first=own, soles=soles)
            except WalkError:
                return None
            for step in steps:
                now[step.foot] = step.pose
    if not steps and _not_in_stance(now, stride):
        return None
    return steps if len(steps) <= MAX_STEPS else None


def footsteps_along(
    twist: np.ndarray, feet: np.ndarray, stride: Stride, count: int = 1, first: int | None = None,
    soles: Sequence[np.ndarray] | None = None,
) -> list[Footstep]:  # fmt: skip
    """Return the steps of a way at one velocity, which ends with the feet side by side.

    Args:
        twist: (3,) the velocity times the time it is kept: ahead, to the left [m], counterclockwise [rad].
        feet: (2, 3) where the feet stand.
        stride: How the robot walks.
        count: At least so many steps, without the last, which closes the stance.
        first: The foot of the first step; None is the one that opens the stance.
        soles: As in ``footsteps_to``.

    Raises:
        WalkError: more than ``MAX_STEPS`` steps.
    """
    opening = twist[1] / stride.side_step + twist[2] / stride.turn_step
    leading = LEFT if opening >= 0.0 else RIGHT
    first = leading if first is None else first
    count = max(count, _fewest(twist, stride, first == leading))
    if count > MAX_STEPS:
        raise WalkError(f"a walk has at most {MAX_STEPS} steps, and that takes more: go there in several walks")
    most = 3 * count + 3  # soles that are near each other from the start do not come apart by shorter steps
    while True:
        steps = _steps(twist, feet, stride, count, first, leading)
        if soles is None or count >= most or min_gap(steps, feet, soles) >= SOLE_GAP:
            return steps
        count += 1


def steps_of_velocity(velocity: np.ndarray, seconds: float, stride: Stride) -> int:
    """Return how many steps, without the closing one, a velocity (3,) [m/s, m/s, rad/s] is kept for some time with.

    Raises:
        InvalidInputError: it is faster than the stride allows.
    """
    count = max(1, round(seconds / stride.step_time))
    # of a long walk at that velocity, so that the limit does not depend on how long it takes
    share = _share(velocity * stride.step_time, stride, 1.0, 0.5)
    if share > 1.0 + SLACK:
        fastest = (np.trunc(1000.0 * velocity / share) / 1000.0).tolist()
        raise InvalidInputError(
            f"the velocity {velocity.tolist()} [m/s, m/s, rad/s] is faster than the stride allows; that way at most "
            f"{fastest}"
        )
    return max(count, _fewest(velocity * seconds, stride, True))


def screw(twist: np.ndarray) -> np.ndarray:
    """Return the pose (3,) that a body comes to that keeps a velocity, seen from where it began."""
    x, y, yaw = twist
    a, b = _sinc(yaw), _versinc(yaw)
    return np.array([a * x - b * y, b * x + a * y, yaw])


def screw_to(pose: np.ndarray) -> np.ndarray:
    """Return the velocity times time (3,) that brings a body to a pose: the inverse of ``screw``, |yaw| < 2 pi."""
    x, y, yaw = pose
    a, b = _sinc(yaw), _versinc(yaw)
    return np.array([(a * x + b * y) / (a * a + b * b), (a * y - b * x) / (a * a + b * b), yaw])


def moved(pose: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Return a pose (3,) after a move (3,) that is seen from it."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([pose[0] + c * by[0] - s * by[1], pose[1] + s * by[0] + c * by[1], pose[2] + by[2]])


def relative(origin: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return a pose (3,) as seen from another: the inverse of ``moved``."""
    c, s = math.cos(origin[2]), math.sin(origin[2])
    x, y = pose[:2] - origin[:2]
    return np.array([c * x + s * y, c * y - s * x, pose[2] - origin[2]])


def middle_of(feet: np.ndarray) -> np.ndarray:
    """Return the pose (3,) between two feet (2, 3): its x axis is the mean of theirs."""
    left, right = feet
    turn = math.remainder(right[2] - left[2], math.tau)
    return np.array([*(0.5 * (left[:2] + right[:2])), left[2] + 0.5 * turn])


def min_gap(steps: Sequence[Footstep], feet: np.ndarray, soles: Sequence[np.ndarray]) -> float:
    """Return how near the soles come to each other [m], of all stances after a step."""
    now, gap = feet.copy(), np.inf
    for step in steps:
        now[step.foot] = step.pose
        gap = min(gap, sole_gap(now, soles))
    return gap


def sole_gap(feet: np.ndarray, sizes: Sequence[np.ndarray]) -> float:
    """Return how far apart two soles (2, 3) of sizes (2,) [m] are [m]; negative where they overlap.

    It is the distance along the best separating axis of the two rectangles, which is the distance itself where an edge
    is the nearest.
    """
    corners = []
    for pose, size in zip(feet, sizes, strict=True):
        half = 0.5 * size
        corners.append(np.array([moved(pose, np.array([i * half[0], j * half[1], 0.0]))[:2]
                                 for i in (-1, 1) for j in (-1, 1)]))  # fmt: skip
    gap = -np.inf
    for yaw in (pose[2] + quarter for pose in feet for quarter in (0.0, 0.5 * math.pi)):
        axis = np.array([math.cos(yaw), math.sin(yaw)])
        a, b = (part @ axis for part in corners)
        gap = max(gap, a.min() - b.max(), b.min() - a.max())
    return float(gap)


def _steps(twist: np.ndarray, feet: np.ndarray, stride: Stride, count: int, first: int, leading: int) -> list[Footstep]:
    start = middle_of(feet)
    leads = _leads(count, first == leading)
    aside = np.array([0.0, twist[1], twist[2]])
    steps, foot, done = [], first, 0
    for k in range(1, count + 2):
        along = min(k / count, 1.0)
        done += foot == leading
        opened = min(done / leads, 1.0) if leads else 1.0
        body = moved(moved(start, screw(twist * along)), aside * (opened - along))
        offset = 0.5 * stride.stance * (1 if foot == LEFT else -1)
        place = moved(body, np.array([0.0, offset, 0.0]))
        steps.append(Footstep(foot, *(float(part) for part in place)))
        foot = 1 - foot
    return steps


def _leads(count: int, starts: bool) -> int:
    """Return how many of so many steps the leading foot makes, where it starts, or not."""
    return (count + 1) // 2 if starts else count // 2


def _fewest(twist: np.ndarray, stride: Stride, starts: bool) -> int:
    count = 1 if starts or not np.any(twist[1:]) else 2
    while count <= MAX_STEPS and _share(twist, stride, count, max(_leads(count, starts), 1)) > 1.0 + SLACK:
        count += 1
    return count


def _share(twist: np.ndarray, stride: Stride, count: float, leads: float) -> float:
    """Return how large the steps of a way are, relative to the largest; only the leading foot goes aside and turns."""
    ahead, aside = twist[0] / (count * stride.step_length), twist[1] / (leads * stride.side_step)
    return max(math.hypot(ahead, aside), abs(twist[2]) / (leads * stride.turn_step))


def _not_in_stance(feet: np.ndarray, stride: Stride) -> bool:
    wanted = np.array([[0.0, 0.5 * stride.stance, 0.0], [0.0, -0.5 * stride.stance, 0.0]])
    own = np.array([relative(middle_of(feet), foot) for foot in feet])
    return bool(np.abs(own - wanted).max() > 10.0 * NEAR)


def _turn(angle: float) -> np.ndarray:
    return np.array([0.0, 0.0, math.remainder(angle, math.tau)])


def _sinc(angle: float) -> float:
    return math.sin(angle) / angle if abs(angle) > 1e-6 else 1.0


def _versinc(angle: float) -> float:
    return (1.0 - math.cos(angle)) / angle if abs(angle) > 1e-6 else 0.5 * angle
