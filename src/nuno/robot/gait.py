"""Gait: the walk that a simulated robot is on, and what it was asked for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import NunoError
from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.robot_state import RobotState
from nuno.robot.simulated_joints import SimulatedJoints
from nuno.robot.support import standing_place

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.walk import Walk

WALKING = ("lleg_controller", "rleg_controller")
"""The controllers whose joints a walk moves; the others go on as they are asked."""
SOON = 1e-9
"""[s] Rounding of sums of frames."""

Place = tuple[float, float, float]
"""x, y [m] and yaw [rad] in the world."""


class Gait:
    """A walk, its goal, and how far it is. Times are of the joints' clock.

    A velocity that comes while the robot walks changes the walk under way; a place lets it come to rest first, and go
    from there. A walk always ends with both feet on the floor.

    Args:
        robot: The robot that walks.
        joints: Its joints, of which those of ``WALKING`` are the walk's.
    """

    def __init__(self, robot: Humanoid, joints: SimulatedJoints) -> None:
        self._robot, self._joints = robot, joints
        self._names = tuple(name for name in WALKING if name in joints.rows)
        self.rows = np.concatenate([np.zeros(0, dtype=int), *(joints.rows[name] for name in self._names)])
        self.goal: Goal | None = None
        self.walk: Walk | None = None
        self._before: Walk | None = None  # what holds until a changed walk begins
        self._start = 0.0  # when the walk's own time was 0
        self._waiting: tuple[Goal, Place] | None = None  # the next goal, for when the robot stands

    @property
    def is_walking(self) -> bool:
        """Return whether the robot is under way."""
        return self.walk is not None

    def moves(self, controller: str) -> bool:
        """Return whether the walk has the joints of a controller."""
        return self.walk is not None and controller in self._names

    def plan(self, robot: Humanoid, x: float, y: float, yaw: float, seconds: float | None) -> Walk | str:
        """Return a walk from where a robot stands, or why there is none; nothing changes.

        Args:
            robot: The robot, as it stands.
            x: Ahead [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            seconds: In which it covers that [s]; None as it walks by itself.
        """
        from nuno.robot.walking import plan_walk, plan_walk_velocity

        try:
            if seconds is None:
                return plan_walk(robot, x, y, yaw)
            return plan_walk_velocity(robot, x / seconds, y / seconds, yaw / seconds, seconds)
        except NunoError as error:
            return str(error)

    def begin(self, walk: Walk | str, goal: Goal) -> None:
        """Set off on a walk that was planned, or reject the goal where there is none."""
        if isinstance(walk, str):
            goal.finish(GoalStatus.REJECTED, text=walk)
            return
        for name in self._names:
            self._joints.take_over(name)
        self.walk, self._before, self.goal = walk, None, goal
        self._start = self._joints.clock - float(walk.times[0])
        goal.status = GoalStatus.ACTIVE

    def change(self, goal: Goal, x: float, y: float, yaw: float, seconds: float | None) -> None:
        """Go on otherwise from here, while the robot walks; see ``plan``."""
        from nuno.robot.walking import continue_walk

        assert self.walk is not None
        if seconds is None:
            place = self._seen_from_here(x, y, yaw)
            self.cancel()
            self._waiting = (goal, place)
            return
        try:
            changed = continue_walk(self.walk, self._next_tick(), x / seconds, y / seconds, yaw / seconds, seconds)
        except NunoError as error:
            goal.finish(GoalStatus.REJECTED, text=str(error))
            return
        self._drop("another goal took its place")
        self._before, self.walk, self.goal = self.walk, changed, goal
        goal.status = GoalStatus.ACTIVE

    def cancel(self) -> None:
        """Come to rest as soon as that is safe."""
        if self._waiting is not None:
            self._waiting[0].finish(GoalStatus.PREEMPTED, text="it was cancelled")
            self._waiting = None
        if self.walk is None or self.goal is None or self.goal.status == GoalStatus.PREEMPTING:
            return
        from nuno.robot.walking import stop_walk

        self._before, self.walk = self.walk, stop_walk(self.walk, self._next_tick())
        self.goal.status = GoalStatus.PREEMPTING

    def at(self, clock: float) -> RobotState:
        """Return configuration, velocity and acceleration at a time [s]."""
        assert self.walk is not None
        t = clock - self._start
        if self._before is not None and t < self.walk.times[0]:
            return self._before.state_at(t)
        return self.walk.state_at(t)

    def end_frame(self) -> None:
        """End the goal where the walk is over; the joints hold then."""
        if self.walk is None or self._joints.clock - self._start < float(self.walk.times[-1]) - SOON:
            return
        self.walk = self._before = None
        for name in self._names:
            self._joints.take_over(name)
        assert self.goal is not None
        if self.goal.status == GoalStatus.PREEMPTING:
            self.goal.finish(GoalStatus.PREEMPTED, text="it was cancelled")
        self.goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
        if self._waiting is not None:
            (goal, place), self._waiting = self._waiting, None
            x, y, yaw = standing_place(self._robot)
            forward, left = place[0] - x, place[1] - y
            c, s = math.cos(yaw), math.sin(yaw)
            self.begin(
                self.plan(self._robot, c * forward + s * left, c * left - s * forward, place[2] - yaw, None), goal
            )

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        status = None if self.goal is None else (self.goal.status, self.goal.text)
        return self.goal, status, self.walk, self._before, self._start, self._waiting

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was; a goal that came since is given up."""
        goal, status, self.walk, self._before, self._start, waiting = saved
        if self.goal is not goal:
            self._drop("the world was restored")
        self.goal, self._waiting = goal, waiting
        if goal is not None:
            goal.status, goal.text = status

    def _drop(self, why: str) -> None:
        for goal in (self.goal, None if self._waiting is None else self._waiting[0]):
            if goal is not None:
                goal.finish(GoalStatus.PREEMPTED, text=why)
        self._waiting = None

    def _next_tick(self) -> float:
        """The first tick of the walk that is not over [s], of the walk's time."""
        assert self.walk is not None
        t = self._joints.clock - self._start
        ticks = math.ceil((t - float(self.walk.times[0])) / self.walk.dt - SOON)
        return float(self.walk.times[min(max(ticks, 0), len(self.walk.times) - 1)])

    def _seen_from_here(self, ahead: float, left: float, turn: float) -> Place:
        x, y, yaw = standing_place(self._robot)
        c, s = math.cos(yaw), math.sin(yaw)
        return x + c * ahead - s * left, y + s * ahead + c * left, yaw + turn
