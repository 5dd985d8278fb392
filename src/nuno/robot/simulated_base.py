"""SimulatedBase: the base of a simulated robot: where it is, and how it walks elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.goal import Goal, GoalStatus
from nuno.robot.simulated_body import SimulatedBody
from nuno.shapes.coordinates import Coordinates
from nuno.validation import number

if TYPE_CHECKING:
    from nuno.robot.robot_state import RobotState


class SimulatedBase(SimulatedBody):
    """The base of ``SimulatedRobot``."""

    _state: RobotState

    def read_base(self) -> Coordinates:
        """Return where the base link is in the world."""
        with self.world.lock:
            return self.actual.copy_coords()

    def send_base(self, x: float, y: float, yaw: float, seconds: float | None, stop: bool) -> Goal:
        """Let the robot walk to a place seen from where it stands; see ``RobotInterface``.

        A walk always ends standing, whatever ``stop`` says; another velocity that is sent before goes on from it.
        """
        goal = Goal((x, y, yaw))
        with self.world.lock:
            self._check_there()
            self.gait.forget()
            if self.gait.is_walking:
                self.gait.change(goal, x, y, yaw, seconds)
                return goal
            standing, load, gravity = self.wanted.copy(), self._carried(), self.world.gravity
        walk = self.gait.plans.plan(standing, x, y, yaw, seconds, load, gravity)  # the world goes on meanwhile
        with self.world.lock:
            if self.gait.is_walking:
                goal.finish(GoalStatus.REJECTED, text="another walk was begun meanwhile")
            else:
                self.gait.begin(walk, goal)
        return goal

    def _carried(self) -> tuple[float, np.ndarray] | None:
        """Return what the robot carries as ``plan_walk`` takes it, None without dynamics."""
        if self.balance is None or not self.is_dynamic:
            return None
        carried = self.balance.load(self._state)
        return None if carried is None else carried.seen_from(self.actual)

    def send_velocity(self, x: float, y: float, yaw: float, hold: float = 1.0) -> Goal:
        """Let the robot keep a velocity, the newest from each landing of a foot; see ``RobotInterface``."""
        with self.world.lock:
            self._check_there()
            x, y, yaw = (number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
            span = number("hold", hold, above=0.0)
            self.gait.forget()
            return self.gait.drive(x, y, yaw, span)

    def cancel_base(self) -> None:
        """Let the robot come to rest as soon as that is safe."""
        with self.world.lock:
            self.gait.forget()
            self.gait.cancel()
