"""WalkPlans: walks that were planned, each of them once: robots that stand alike and are to go alike share one."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np

from nuno.errors import NunoError
from nuno.robot.gravity import EARTH
from nuno.robot.running_walk import RunningWalk, run_on, set_off
from nuno.robot.walk import TimedMotion, Walk
from nuno.robot.walk_planner import MARGIN, WalkPlanner
from nuno.robot.walking import continue_walk, plan_walk, plan_walk_velocity, stop_walk

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

REFUSALS = 256
"""So many reasons why there is no walk are remembered."""


class WalkPlans:
    """The walks of a robot and of all its copies.

    Planning takes from the same start to the same place the same bits, and a third of a second to a second. What was
    planned is known for as long as somebody holds the walk.
    """

    def __init__(self) -> None:
        self._walks: WeakValueDictionary[tuple[Any, ...], Walk] = WeakValueDictionary()
        self._running: WeakValueDictionary[tuple[Any, ...], RunningWalk] = WeakValueDictionary()
        self._refused: dict[tuple[Any, ...], str] = {}
        self._changed: WeakKeyDictionary[Any, WeakValueDictionary[tuple[Any, ...], Any]] = WeakKeyDictionary()
        self._changing = threading.Lock()  # a planner has one place to work in, and worlds may have threads

    def plan(
        self, robot: Humanoid, x: float, y: float, yaw: float, seconds: float | None,
        load: tuple[float, np.ndarray] | None = None, gravity: Sequence[float] = EARTH,
    ) -> Walk | str:  # fmt: skip
        """Return a walk from where a robot stands, or why there is none; nothing changes.

        Args:
            robot: The robot, as it stands.
            x: Ahead [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            seconds: In which it covers that [s]; None as it walks by itself.
            load: What it carries, as ``plan_walk`` takes it.
            gravity: (3,) [m/s2].
        """
        bears = None if load is None else (load[0], load[1].tobytes())
        stands = robot.configuration().tobytes(), robot.angle_vector().tobytes()
        key = (*stands, x, y, yaw, seconds, bears, *gravity)
        found = self._walks.get(key) or self._refused.get(key)
        if found is not None:
            return found
        try:
            if seconds is None:
                walk = plan_walk(robot, x, y, yaw, load=load, gravity=gravity)
            else:
                velocity = x / seconds, y / seconds, yaw / seconds
                walk = plan_walk_velocity(robot, *velocity, seconds, load=load, gravity=gravity)
        except NunoError as error:
            if len(self._refused) >= REFUSALS:
                self._refused.clear()
            self._refused[key] = str(error)
            return str(error)
        self._walks[key] = walk
        return walk

    def stop(self, walk: Walk, time: float) -> Walk:
        """Return how a walk ends as soon as it safely can, from a time [s] of it on; see ``stop_walk``."""
        with self._changing:
            known = self._changed.setdefault(walk, WeakValueDictionary())
            found = known.get((time,))
            if found is None:
                found = known[time,] = stop_walk(walk, time)
            return found  # type: ignore[no-any-return]

    def go_on(self, walk: Walk, time: float, x: float, y: float, yaw: float, seconds: float) -> Walk:
        """Return how a walk goes on otherwise from a time [s] of it on, covering a way [m, rad] in ``seconds`` [s].

        Raises:
            NunoError: as ``continue_walk``.
        """
        key = (time, x, y, yaw, seconds)
        with self._changing:
            known = self._changed.setdefault(walk, WeakValueDictionary())
            found = known.get(key)
            if found is None:
                found = known[key] = continue_walk(walk, time, x / seconds, y / seconds, yaw / seconds, seconds)
            return found  # type: ignore[no-any-return]

    def set_off(
        self, robot: Humanoid, velocity: np.ndarray, gravity: Sequence[float] = EARTH
    ) -> RunningWalk | str:  # fmt: skip
        """Return the walk at a velocity (3,) [m/s, m/s, rad/s] from where a robot stands, or why there is none."""
        key = (robot.configuration().tobytes(), robot.angle_vector().tobytes(), velocity.tobytes(), *gravity)
        with self._changing:
            found = self._running.get(key)
            if found is None:
                try:
                    found = set_off(WalkPlanner(robot, None, None, None, MARGIN, True, gravity), velocity)
                except NunoError as error:
                    return str(error)
                self._running[key] = found
            return found

    def run_on(self, walk: TimedMotion, at: int, velocity: np.ndarray) -> RunningWalk:
        """Return the walk that goes on at a velocity (3,) from a landing (tick) of another; see `run_on`.

        Raises:
            NunoError: as `run_on`.
        """
        key = (at, velocity.tobytes())
        with self._changing:
            known = self._changed.setdefault(walk, WeakValueDictionary())
            found = known.get(key)
            if found is None:
                found = known[key] = run_on(walk, at, velocity)
            return found  # type: ignore[no-any-return]
