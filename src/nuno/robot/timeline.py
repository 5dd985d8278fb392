"""Timeline: from footsteps to which foot stands when, where the feet are, and where the zero moment point is to be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nuno.robot.footsteps import Footstep, middle_of
from nuno.robot.preview_control import TICK
from nuno.robot.stride import Stride
from nuno.shapes.path import minimum_jerk

BOTH, LEFT_STANDS, RIGHT_STANDS = 0, 1, 2
"""Phases of support: the feet that bear the robot."""
UPRIGHT = 0.08
"""Share of a swing in which the foot goes only up, and again only down: a sole does not scrape along the floor."""


@dataclass(frozen=True, eq=False)
class Schedule:
    """Footsteps, and what was before the first.

    Attributes:
        steps: The footsteps.
        feet: (2, 4) float, where the feet stand before them: x, y, z [m], yaw [rad].
        floor: Height that feet are put down at [m].
        point: (2,) float, the zero moment point before them [m].
        begin: When it begins [tick].
        lead: How long both feet stand before the first step [tick].
        stride: How the robot walks.
    """

    steps: tuple[Footstep, ...]
    feet: np.ndarray
    floor: float
    point: np.ndarray
    begin: int
    lead: int
    stride: Stride

    @property
    def single(self) -> int:
        """Return how long a foot is in the air [tick]."""
        return _ticks(self.stride.single_support)

    @property
    def double(self) -> int:
        """Return how long both stand between two steps [tick]."""
        return _ticks(self.stride.double_support)

    @property
    def move(self) -> int:
        """Return how long the point takes from a foot to the other before a step, at most [tick]."""
        return _ticks(0.5 * self.stride.shift)

    def lift_off(self, k: int) -> int:
        """Return when step k leaves the ground [tick]."""
        return self.begin + self.lead + k * (self.single + self.double)

    def landing(self, k: int) -> int:
        """Return when step k stands [tick]."""
        return self.lift_off(k) + self.single

    @property
    def end(self) -> int:
        """Return when the robot has come to rest [tick]."""
        last = self.landing(len(self.steps) - 1) if self.steps else self.begin
        return last + _ticks(self.stride.shift) + _ticks(self.stride.settle)

    def at(self, k: int) -> Schedule:
        """Return the schedule from just before step k: what was earlier is forgotten."""
        if k == 0:
            return self
        feet, point = self.feet.copy(), self.point
        for step in self.steps[:k]:
            point = feet[1 - step.foot][:2].copy()
            yaw = feet[step.foot][3]
            feet[step.foot] = [step.x, step.y, self.floor, yaw + _turn(yaw, step.yaw)]
        return Schedule(self.steps[k:], feet, self.floor, point, self.landing(k - 1), self.double, self.stride)

    def with_steps(self, steps: Sequence[Footstep]) -> Schedule:
        """Return the same beginning with other steps."""
        return Schedule(tuple(steps), self.feet, self.floor, self.point, self.begin, self.lead, self.stride)


@dataclass(frozen=True, eq=False)
class Timeline:
    """Targets of a walk at every tick, from ``begin`` on.

    Attributes:
        begin: The first tick.
        support: (n,) int, 0 both feet stand, 1 the left one, 2 the right one. A foot that lifts off or lands at a tick
            stands then.
        feet: (n, 2, 4) float, x, y, z [m] and yaw [rad] of left and right.
        point: (n, 2) float, the wanted zero moment point [m].
    """

    begin: int
    support: np.ndarray
    feet: np.ndarray
    point: np.ndarray

    def after(self, tick: int) -> Timeline:
        """Return the rest from a tick on."""
        k = tick - self.begin
        return Timeline(tick, self.support[k:], self.feet[k:], self.point[k:])


def timeline(schedule: Schedule) -> Timeline:
    """Return what a schedule wants at every tick."""
    own = schedule
    n = own.end - own.begin + 1
    support = np.zeros(n, dtype=np.int8)
    feet = np.empty((n, 2, 4))
    point = np.empty((n, 2))
    now, where, at = own.feet.copy(), own.point, 0
    for k, step in enumerate(own.steps):
        start, stop = own.lift_off(k) - own.begin, own.landing(k) - own.begin
        other = 1 - step.foot
        stance = now[other][:2].copy()
        feet[at : start + 1] = now
        move = min(start - at, own.move)
        point[at : start + 1 - move] = where
        point[start - move : start + 1] = _between(where, stance, move)
        support[start + 1 : stop] = LEFT_STANDS if other == 0 else RIGHT_STANDS
        goal = np.array([step.x, step.y, own.floor, now[step.foot][3] + _turn(now[step.foot][3], step.yaw)])
        feet[start : stop + 1, other] = now[other]
        feet[start : stop + 1, step.foot] = _swing(now[step.foot], goal, own.stride.lift, stop - start)
        point[start : stop + 1] = stance
        now[step.foot], where, at = goal, stance, stop
    rest = _ticks(own.stride.shift)
    middle = middle_of(now[:, [0, 1, 3]])[:2]
    feet[at:] = now
    point[at : at + rest + 1] = _between(where, middle, rest)
    point[at + rest :] = middle
    return Timeline(own.begin, support, feet, point)


def smooth(share: np.ndarray) -> np.ndarray:
    """Return ``minimum_jerk`` of a share, at rest before 0 and after 1."""
    return minimum_jerk(np.clip(share, 0.0, 1.0))


def _between(a: np.ndarray, b: np.ndarray, ticks: int) -> np.ndarray:
    return a + smooth(np.arange(ticks + 1) / max(ticks, 1))[:, None] * (b - a)


def _swing(start: np.ndarray, goal: np.ndarray, lift: float, ticks: int) -> np.ndarray:
    """Return the way (ticks + 1, 4) of a foot through the air."""
    share = np.arange(ticks + 1) / ticks
    way = start + smooth((share - UPRIGHT) / (1.0 - 2.0 * UPRIGHT))[:, None] * (goal - start)
    # at rest at both ends to the second order, so that the foot neither pushes off nor stamps
    way[:, 2] += lift * (4.0 * share * (1.0 - share)) ** 3
    return way


def _turn(a: float, b: float) -> float:
    return math.remainder(b - a, math.tau)


def _ticks(seconds: float) -> int:
    return max(1, round(seconds / TICK))
