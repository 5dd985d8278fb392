"""Walk: a planned and checked walk, tick by tick."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.robot.footsteps import Footstep
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.validation import number

if TYPE_CHECKING:
    from nuno.robot.stride import Stride
    from nuno.robot.timeline import Schedule
    from nuno.robot.walk_check import WalkMeasures


States = tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Of both passes of preview control: the state (3, 2) at a tick, and the sum of errors (2,) before it."""


class WalkSettings(Protocol):
    """The settings that a motion is planned by; `nuno.robot.walk_planner.WalkPlanner` has them."""

    model: Any
    stride: Stride


class TimedMotion(ABC):
    """A motion of a whole robot, tick by tick.

    Attributes:
        dt: Between two ticks [s].
        times: (n,) float [s].
        configurations: (n, nq) float, Pinocchio's, the base with it, in the world.
        velocities: (n, nv) float, of the base in its own frame [m/s, rad/s], then the joints' [rad/s].
        accelerations: (n, nv) float, likewise.
    """

    dt: float
    times: np.ndarray
    configurations: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray

    @property
    @abstractmethod
    def planner(self) -> WalkSettings:
        """The settings that it was planned by."""

    @property
    @abstractmethod
    def schedule(self) -> Schedule:
        """The footsteps and their times."""

    @abstractmethod
    def states_at(self, tick: int) -> States:
        """Return the states of both passes of preview control at a tick, counted from the first."""

    @property
    def model(self) -> Any:
        """Pinocchio's model of the robot, with what it carries."""
        return self.planner.model

    def ensure(self, tick: int) -> None:
        """Make sure that a tick and the next one are known; here all are."""
        return

    def configuration_at(self, time: float) -> np.ndarray:
        """Return the configuration (nq,) at a time [s]; before and after the walk that of its ends."""
        k, share = self._tick(time)
        self.ensure(k)
        return self._configuration(k, share)

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """Return the configurations (k, nq) at times (k,) [s], between ticks by straight lines."""
        at = np.clip((times - float(self.times[0])) / self.dt, 0.0, len(self.times) - 1.0)
        tick = np.minimum(np.floor(at + 1e-9).astype(int), max(len(self.times) - 2, 0))
        share = np.clip(at - tick, 0.0, 1.0)[:, None]
        self.ensure(int(tick.max()))
        after = self.configurations[np.minimum(tick + 1, len(self.times) - 1)]
        found = (1.0 - share) * self.configurations[tick] + share * after
        found[:, 3:7] /= np.linalg.norm(found[:, 3:7], axis=1, keepdims=True)
        return np.asarray(found)

    def state_at(self, time: float) -> RobotState:
        """Return configuration, velocity and acceleration at a time [s]; before and after the walk at rest."""
        k, share = self._tick(time)
        self.ensure(k)
        parts = []
        for part in (self.velocities, self.accelerations):
            parts.append(part[k].copy() if share == 0.0 else (1.0 - share) * part[k] + share * part[k + 1])
        return RobotState.moving(float(time), self._configuration(k, share), *parts)

    def _configuration(self, k: int, share: float) -> np.ndarray:
        if share == 0.0:
            return self.configurations[k].copy()
        return np.array(pin.interpolate(self.model, self.configurations[k], self.configurations[k + 1], share))

    def _tick(self, time: float) -> tuple[int, float]:
        at = (number("time", time) - float(self.times[0])) / self.dt
        k = min(max(math.floor(at + 1e-9), 0), len(self.times) - 1)
        if k == len(self.times) - 1 or at <= k + 1e-9:
            return k, 0.0
        return k, float(at - k)


@dataclass(frozen=True, eq=False)
class Walk(TimedMotion):
    """A walk that begins and ends with both feet on the floor, at rest; see ``plan_walk``.

    One that continues another begins where that was left (``continue_walk``, ``stop_walk``): its times go on from
    there.

    Attributes:
        dt: Between two ticks [s].
        times: (n,) float [s].
        configurations: (n, nq) float, Pinocchio's, the base with it, in the world.
        velocities: (n, nv) float, of the base in its own frame [m/s, rad/s], then the joints' [rad/s].
        accelerations: (n, nv) float, likewise.
        footsteps: Those that are made in it, in order; of one that continues another, from the step under way.
        support: (n,) int, 0 both feet stand, 1 the left one, 2 the right one.
        feet: (n, 2, 4) float, x, y, z [m] and yaw [rad] of the left and right sole.
        centre: (n, 3) float, of mass [m].
        zmp: (n, 2) float, the zero moment point of all links [m].
        zmp_wanted: (n, 2) float, where it was to be [m].
        measures: How far it is from what the robot cannot do.
    """

    dt: float
    times: np.ndarray
    configurations: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    footsteps: tuple[Footstep, ...]
    support: np.ndarray
    feet: np.ndarray
    centre: np.ndarray
    zmp: np.ndarray
    zmp_wanted: np.ndarray
    measures: WalkMeasures
    plan: Any = field(repr=False)  # what continue_walk goes on from

    def __repr__(self) -> str:
        return f"<Walk of {len(self.footsteps)} steps, {self.times[0]:.2f} to {self.times[-1]:.2f} s>"

    @property
    def duration(self) -> float:
        """Return how long it takes [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def planner(self) -> WalkSettings:
        """The settings that it was planned by."""
        settings: WalkSettings = self.plan.planner
        return settings

    @property
    def schedule(self) -> Schedule:
        """The footsteps and their times."""
        schedule: Schedule = self.plan.schedule
        return schedule

    def states_at(self, tick: int) -> States:
        """Return the states of both passes of preview control at a tick, counted from the first."""
        (first, sums), (second, more) = self.plan.states
        return (first[tick], sums[tick]), (second[tick], more[tick])
