"""CaptureStep: a step to where a robot that was pushed comes to rest.

The capture point (Pratt et al. 2006), the unstable part of an inverted pendulum's motion, is ``c + dc / w`` with
``w = sqrt(g / h)``. While the zero moment point p is kept it goes away from p as ``exp(w t)``. Where it lies in the
soles' outline, ankles bring the robot to rest; where it lies outside, a foot has to go there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from nuno.robot.footsteps import moved, relative
from nuno.robot.support import distance_inside, edges_of

AIR = 1.0
"""Time of such a step in the air, in units of 1 / w: longer ones have farther to go, shorter ones take faster legs."""
LANDS = 0.5
"""Share of that time after which the foot may meet the ground."""
SETTLED = 0.7
"""Share after which the place is no longer changed."""
BEYOND = 0.01
"""[m] How far outside the outline the capture point may be: trunk and arms swing that much back."""
LIFT = 0.05
"""How high the foot goes, in units of the centre of mass' height,"""
FARTHEST = 0.6
"""how far ahead or back of the other foot at most,"""
WIDEST = 0.5
"""and how far beside it."""
PAST = 0.015
"""[m] How far past the capture point the middle of the sole goes, so that the robot comes back from there."""
INNER = 0.8
"""Share of the stance foot's sole that the zero moment point goes to."""
MISSES = 0.15
"""[m] By which a step may fail to reach it; another one follows."""
ASIDE = 3.0
"""Weight of what is missing aside, where the other foot is in the way of the next step."""
STILL = 0.04
"""[m/s] Slower than this a robot stands again,"""
RESTS = 0.4
"""[s] this long after its landing."""


@dataclass(frozen=True, eq=False)
class CaptureStep:
    """A step of a robot that was pushed, until it stands again.

    Attributes:
        foot: Which foot goes.
        time: When it was lifted [s].
        air: How long it is in the air [s].
        start: (4,) from where: x, y, z [m], yaw [rad].
        goal: (3,) to where: x, y [m], yaw [rad].
        height: Of the centre of mass above the soles [m], before.
        landed: When it met the ground [s], or None.
        is_finished: Whether the robot stands again.
        count: How many steps were made for the same push.
    """

    foot: int
    time: float
    air: float
    start: np.ndarray
    goal: np.ndarray
    height: float
    landed: float | None = None
    is_finished: bool = False
    count: int = 1

    def share(self, time: float) -> float:
        """Return how much of the time in the air is over."""
        return (time - self.time) / self.air

    def pose(self, time: float, ground: float) -> np.ndarray:
        """Return where the foot is to be (4,) at a time [s], above a ground at a height [m]."""
        share = min(max(self.share(time), 0.0), 1.0)
        # fast legs throw the robot back: this takes a sixth less than jerks
        way = 0.5 - 0.5 * math.cos(math.pi * share)
        turn = math.remainder(self.goal[2] - self.start[3], math.tau)
        x, y = self.start[:2] + way * (self.goal[:2] - self.start[:2])
        lift = LIFT * self.height * (4.0 * share * (1.0 - share)) ** 2
        return np.array([x, y, (1.0 - way) * self.start[2] + way * ground + lift, self.start[3] + way * turn])


@dataclass(frozen=True, eq=False)
class Pendulum:
    """A robot as an inverted pendulum on its feet.

    Attributes:
        point: (2,) capture point [m].
        speed: (2,) of the centre of mass [m/s].
        rate: w [1/s].
        height: Of the centre of mass above the soles [m].
        feet: (2, 4) x, y, z [m] and yaw [rad] of the soles.
        outlines: Corners (4, 2) of each sole [m].
        stance: Distance of the soles when it stands [m].
    """

    point: np.ndarray
    speed: np.ndarray
    rate: float
    height: float
    feet: np.ndarray
    outlines: tuple[np.ndarray, np.ndarray]
    stance: float

    def inner(self, foot: int) -> np.ndarray:
        """Return the part of a sole (4, 2) [m] that the robot counts on."""
        middle = self.outlines[foot].mean(axis=0)
        return np.asarray(middle + INNER * (self.outlines[foot] - middle))

    def after(self, seconds: float, zero_moment_point: np.ndarray) -> np.ndarray:
        """Return the capture point (2,) after some time over a zero moment point (2,)."""
        return zero_moment_point + math.exp(self.rate * seconds) * (self.point - zero_moment_point)

    def landing(self, foot: int, seconds: float) -> tuple[np.ndarray, float]:
        """Return where a foot is put down (3,) after some time, and what is missing there [m]."""
        other = 1 - foot
        stance = self.feet[other, [0, 1, 3]]
        point = self.after(seconds, nearest_in(self.inner(other), self.point))
        x, y, _ = relative(stance, np.array([*point, stance[2]]))
        side = 1.0 if foot == 0 else -1.0
        far = math.hypot(x, y)
        x *= 1.0 + PAST / max(far, PAST)
        lateral = side * y * (1.0 + PAST / max(far, PAST))
        reach, least, most = FARTHEST * self.height, self.stance, WIDEST * self.height
        ahead, aside = min(max(x, -reach), reach), min(max(lateral, least), most)
        # nearer than the usual stance is no loss: the capture point lies between the feet then
        missing = math.hypot(x - ahead, ASIDE * (max(lateral - aside, 0.0) + max(-lateral, 0.0)))
        return moved(stance, np.array([ahead, side * aside, 0.0])), missing


def nearest_in(outline: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the point (2,) of a convex, counterclockwise outline (k, 2) that is nearest to another (2,) [m]."""
    normals, offsets = edges_of(outline)
    if ((normals @ point) <= offsets).all():
        return point
    along = np.roll(outline, -1, axis=0) - outline
    share = np.clip(((point - outline) * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    on = outline + share[:, None] * along
    return np.asarray(on[((on - point) ** 2).sum(axis=1).argmin()])


def outside(outline: np.ndarray, point: np.ndarray, beyond: float = BEYOND) -> bool:
    """Return True if a zero moment point (2,) that balance asks for is too far outside an outline (k, 2)."""
    return distance_inside(outline, point) < -beyond


def lifted(pendulum: Pendulum, bears: tuple[bool, ...], time: float, count: int = 1) -> CaptureStep | None:
    """Return the step to make now: of the foot that is in the air, else of the one that comes nearer to the point.

    None where neither comes near it: trunk and arms do more then.
    """
    air = AIR / pendulum.rate
    feet = [k for k in (0, 1) if not bears[k]] if any(bears) and not all(bears) else [0, 1]
    found = [(pendulum.landing(foot, air), foot) for foot in feet]
    (goal, missing), foot = min(
        found, key=lambda own: (own[0][1], np.linalg.norm(own[0][0][:2] - pendulum.feet[own[1], :2]))
    )
    if missing > MISSES:
        return None
    return CaptureStep(foot, time, air, pendulum.feet[foot].copy(), goal, pendulum.height, count=count)


def carried_on(step: CaptureStep, pendulum: Pendulum, touches: bool, time: float) -> CaptureStep:
    """Return a step at the end of a frame: where it goes now, whether it has landed, whether the robot stands again."""
    if step.landed is None:
        share = step.share(time)
        if touches and share > LANDS:
            return replace(step, landed=time)
        if share < SETTLED:
            goal, _ = pendulum.landing(step.foot, step.time + step.air - time)
            return replace(step, goal=goal)
        return step
    if time - step.landed > RESTS and float(np.linalg.norm(pendulum.speed)) < STILL:
        return replace(step, is_finished=True)
    return step
