"""Gait: the walk that a simulated robot is on, and what it was asked for."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import NunoError, WalkError
from nuno.robot.footsteps import middle_of, steps_of_velocity
from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.gravity import EARTH
from nuno.robot.preview_control import TICK
from nuno.robot.robot_model import standing_place
from nuno.robot.robot_state import RobotState
from nuno.robot.running_walk import RunningWalk, landing_after
from nuno.robot.simulated_joints import SimulatedJoints
from nuno.robot.walk import TimedMotion, Walk
from nuno.robot.walk_order import SOON, Place, WalkOrder, queued
from nuno.robot.walk_plans import WalkPlans

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

logger = logging.getLogger(__name__)

WALKING = ("lleg_controller", "rleg_controller")
"""The controllers whose joints a walk moves; the others go on as they are asked."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A velocity that a robot is to keep, as from a joystick.

    Attributes:
        velocity: (3,) ahead, to the left [m/s], counterclockwise [rad/s].
        until: When it has been kept for long enough [s].
        at: The next landing (tick), at which it is taken; None after the last.
    """

    velocity: np.ndarray
    until: float
    at: int | None = None

    def now(self, clock: float) -> np.ndarray:
        """Return the velocity (3,) at a time [s]."""
        return self.velocity if clock < self.until - SOON else np.zeros(3)


Load = Callable[[], "tuple[float, np.ndarray] | None"]
"""Tells what a robot carries, as ``plan_walk`` takes it."""
Looks = Callable[[RunningWalk, float], object]
"""Tells what a robot would run into on a walk from a time [s] of it on, None for nothing."""


class Gait:
    """A walk, its goal, and how far it is. Times are of the joints' clock.

    A velocity that comes while the robot walks changes the walk under way; a place lets it come to rest first, and go
    from there. Of velocities that come again and again (``drive``) the newest is taken at each landing. A walk always
    ends with both feet on the floor.

    Args:
        robot: The robot that walks.
        joints: Its joints, of which those of ``WALKING`` are the walk's.

    Attributes:
        looks: Asked before a velocity is taken, where not None.
        bears: Asked before a walk to a place is planned, where not None.
        gravity: Returns the gravity (3,) [m/s2] that walks are planned for.
        plans: Walks that were planned for the robot and its copies.
    """

    def __init__(self, robot: Humanoid, joints: SimulatedJoints) -> None:
        self._robot, self._joints = robot, joints
        self.names = tuple(name for name in WALKING if name in joints.rows)
        self.rows = np.concatenate([np.zeros(0, dtype=int), *(joints.rows[name] for name in self.names)])
        self.goal: Goal | None = None
        self.walk: Walk | RunningWalk | None = None
        self._before: Walk | RunningWalk | None = None  # what holds until a changed walk begins
        self._drive: Drive | None = None
        self._start = 0.0  # when the walk's own time was 0
        self._waiting: tuple[Goal, Place] | None = None  # the next goal, for when the robot stands
        self._cut = ""  # why the walk ends before its goal
        self._later: tuple[WalkOrder, ...] = ()  # what comes after that, each as if it were told then
        self.looks: Looks | None = None
        self.bears: Load | None = None
        self.gravity: Callable[[], Sequence[float]] = lambda: EARTH
        self.plans = WalkPlans()

    @property
    def awaits(self) -> bool:
        """Return True if it is to do something later that it was told already."""
        return bool(self._later)

    @property
    def is_walking(self) -> bool:
        """Return True if the robot is under way."""
        return self.walk is not None

    @property
    def newest_goal(self) -> Goal | None:
        """The goal that it was given last, of a walk that is under way, waits or has ended; None before the first."""
        return self.goal if self._waiting is None else self._waiting[0]

    @property
    def end(self) -> float:
        """The time when the walk is over [s], of the joints' clock; of a velocity the time that is worked out."""
        walk = self.walk
        if walk is None:
            return -math.inf
        return self._start + (walk.computed_until if isinstance(walk, RunningWalk) else float(walk.times[-1]))

    def ahead(self, clock: np.ndarray) -> np.ndarray:
        """Return the configurations (k, nq) of the walk under way at times (k,) [s]; nothing changes."""
        assert self.walk is not None
        t = clock - self._start
        found = self.walk.sampled(np.minimum(t, self.end - self._start))
        if self._before is not None and (first := t < self.walk.times[0]).any():
            found[first] = self._before.sampled(t[first])
        return found

    def turn_back(self, hit: float, why: str, meets: Callable[[TimedMotion, float], object]) -> bool:
        """Let the walk end before a time [s], as late as it safely can; return whether it does.

        Args:
            hit: The time, of the joints' clock.
            why: What would happen then.
            meets: What a robot on a walk would run into, from a time of it on; None for nothing.
        """
        walk, now = self.walk, self._next_tick()
        if not isinstance(walk, Walk):
            return False
        landings = {walk.schedule.landing(k) * TICK for k in range(len(walk.schedule.steps))}
        for time in (*sorted((t for t in landings if now < t < hit - self._start), reverse=True), now):
            shorter = self.plans.stop(walk, time)
            if meets(shorter, now) is None:
                missed = float(np.linalg.norm(walk.configurations[-1][:2] - shorter.configurations[-1][:2]))
                self._cut = f"{why}; the walk ends {missed:.2f} m before its goal"
                self._before, self.walk = walk, shorter
                return True
        return False

    def moves(self, controller: str) -> bool:
        """Return True if the walk has the joints of a controller."""
        return self.walk is not None and controller in self.names

    def go(self, goal: Goal, x: float, y: float, yaw: float, seconds: float | None) -> None:
        """Set off at once to a place seen from here, or go on otherwise where the robot walks already.

        Args:
            goal: Its goal, which ends as rejected where there is no such walk.
            x: Ahead [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            seconds: In which it covers that [s]; None as it walks by itself.
        """
        if self.is_walking:
            self.change(goal, x, y, yaw, seconds)
        else:
            self.begin(self.planned(x, y, yaw, seconds), goal)

    def planned(self, x: float, y: float, yaw: float, seconds: float | None) -> Walk | str:
        """Return the walk on which ``go`` sets off from standing, or why there is none; nothing changes."""
        load = self.bears() if self.bears else None
        return self.plans.plan(self._robot, x, y, yaw, seconds, load, self.gravity())

    def begin(self, walk: Walk | RunningWalk | str, goal: Goal) -> None:
        """Set off on a walk that was planned, or reject the goal where there is none."""
        if isinstance(walk, str):
            goal.finish(GoalStatus.REJECTED, text=walk)
            return
        for name in self.names:
            self._joints.take_over(name, self._joints.clock + SOON)
        self.walk, self._before, self.goal, self._drive, self._cut = walk, None, goal, None, ""
        self._start = self._joints.clock - float(walk.times[0])
        goal.status = GoalStatus.ACTIVE

    def follow(self, waiting: Sequence[WalkOrder], given: Sequence[WalkOrder], later: float) -> None:
        """Carry out from now on what another gait of this robot was told, each order ``later`` [s] after it was.

        Args:
            waiting: What it was to do when it was left alone.
            given: What it was told from then on.
            later: [s].
        """
        self._later = queued(waiting, given, later)

    def forget(self) -> None:
        """Give up what is to come later: the robot is told something else."""
        self._later = ()
        for name in self.names:
            self._joints.controllers[name].forget_later()

    def take_up(self) -> None:
        """Begin what is to be begun by now of what was told for later."""
        while self._later and self._later[0].clock <= self._joints.clock + SOON:
            order, self._later = self._later[0], self._later[1:]
            if order.place is None:
                self.cancel()
                continue
            goal = Goal(order.place)
            if order.hold is None:
                self.go(goal, *order.place, order.seconds)
            else:
                goal = self.drive(*order.place, order.hold)
            if goal.status == GoalStatus.REJECTED:
                logger.warning("%r did not go where it went in a future: %s", self._robot.name, goal.text)

    def change(self, goal: Goal, x: float, y: float, yaw: float, seconds: float | None) -> None:
        """Go on otherwise from here, while the robot walks; see ``plan``."""
        if seconds is None or not isinstance(self.walk, Walk):
            place = self._seen_from_here(x, y, yaw)
            self.cancel()
            self._waiting = (goal, place)
            return
        try:
            changed = self.plans.go_on(self.walk, self._next_tick(), x, y, yaw, seconds)
        except NunoError as error:
            goal.finish(GoalStatus.REJECTED, text=str(error))
            return
        self._drop("another goal took its place")
        self._before, self.walk, self.goal, self._cut = self.walk, changed, goal, ""
        goal.status = GoalStatus.ACTIVE

    def drive(self, x: float, y: float, yaw: float, hold: float) -> Goal:
        """Keep a velocity [m/s, rad/s] for ``hold`` [s], in place of what the robot does, and return the goal.

        A robot that stands sets off at once. One that walks takes the velocity at its next landing, or, where it has
        made its last step, when it stands.
        """
        velocity, goal = np.array([x, y, yaw]), Goal((x, y, yaw))
        until = self._joints.clock + hold
        if self.walk is None:
            if not velocity.any():
                goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
                return goal
            self._set_off(goal, velocity, until)
            return goal
        try:
            steps_of_velocity(velocity, self.walk.planner.stride.step_time, self.walk.planner.stride)
        except NunoError as error:
            goal.finish(GoalStatus.REJECTED, text=str(error))
            return goal
        if self._drive is not None and self.goal is not None and self.goal.status == GoalStatus.ACTIVE:
            self._drive = replace(self._drive, velocity=velocity, until=until)
            return self.goal
        self._drop("another goal took its place")
        self._drive = Drive(velocity, until, landing_after(self.walk, self._next_tick() / TICK - 0.5))
        self.goal = goal
        goal.status = GoalStatus.ACTIVE
        return goal

    def _set_off(self, goal: Goal, velocity: np.ndarray, until: float) -> None:
        walk = self.plans.set_off(self._robot, velocity, self.gravity())
        if self.looks is not None and not isinstance(walk, str) and (met := self.looks(walk, 0.0)) is not None:
            walk = str(met)
        self.begin(walk, goal)
        if isinstance(walk, RunningWalk):
            self._drive = Drive(velocity, until, landing_after(walk, 0))

    def _decide(self, t: float) -> None:
        """Take the newest velocity at every landing that is passed by a time [s] of the walk."""
        while self._drive is not None and self._drive.at is not None and t >= self._drive.at * TICK - SOON:
            walk, at = self.walk, self._drive.at
            assert walk is not None and self.goal is not None
            velocity = self._drive.now(self._start + at * TICK)
            try:
                if velocity.any() or not (isinstance(walk, RunningWalk) and walk.is_closing):
                    changed = self.plans.run_on(walk, at, velocity)
                    if velocity.any() and self.looks is not None:
                        met = self.looks(changed, at * TICK)
                        if met is not None:  # as it is, the walk was found to be free
                            raise WalkError(str(met))
                    walk = changed
            except NunoError as error:  # the walk as it is has its end in it, too
                if velocity.any():
                    logger.warning("the robot comes to rest, as it cannot walk on so: %s", error)
                    self.goal.finish(GoalStatus.ABORTED, text=str(error))
                    self._drive = replace(self._drive, velocity=np.zeros(3))
            self.walk, self._before = walk, None
            self._drive = replace(self._drive, at=landing_after(walk, at))

    def cancel(self) -> None:
        """Come to rest as soon as that is safe."""
        if self._waiting is not None:
            self._waiting[0].finish(GoalStatus.PREEMPTED, text="it was cancelled")
            self._waiting = None
        if self.walk is None or self.goal is None or self.goal.status == GoalStatus.PREEMPTING:
            return
        if not self.goal.is_done:  # as that of a velocity is that the robot could not keep
            self.goal.status = GoalStatus.PREEMPTING
        if isinstance(self.walk, RunningWalk):
            if self._drive is not None:
                self._drive = replace(self._drive, velocity=np.zeros(3))
            return
        self._drive = None
        self._before, self.walk = self.walk, self.plans.stop(self.walk, self._next_tick())

    def at(self, clock: float) -> RobotState:
        """Return configuration, velocity and acceleration at a time [s]."""
        assert self.walk is not None
        t = clock - self._start
        self._decide(t)
        if self._before is not None and t < self.walk.times[0]:
            return self._before.state_at(t)
        return self.walk.state_at(t)

    def end_frame(self) -> None:
        """End the goal where the walk is over; the joints hold then."""
        if self.walk is None or self._joints.clock - self._start < float(self.walk.times[-1]) - SOON:
            return
        drive, self.walk = self._drive, None
        self._before = self._drive = None
        for name in self.names:
            self._joints.take_over(name, -math.inf)
        assert self.goal is not None
        if drive is not None and self.goal.status == GoalStatus.ACTIVE and drive.now(self._joints.clock).any():
            self._set_off(self.goal, drive.velocity, drive.until)
            return
        if self.goal.status == GoalStatus.PREEMPTING:
            self.goal.finish(GoalStatus.PREEMPTED, text="it was cancelled")
        if self._cut:
            self.goal.finish(GoalStatus.ABORTED, text=self._cut)
        self.goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
        self.resume()

    def interrupt(self) -> None:
        """Stop at once, wherever the feet are: the robot was pushed. A walk to a place waits for ``resume``."""
        goal, walk = self.goal, self.walk
        if goal is not None and isinstance(walk, Walk) and self._waiting is None and goal.status == GoalStatus.ACTIVE:
            x, y, yaw = middle_of(walk.feet[-1][:, [0, 1, 3]]).tolist()
            self._waiting, self.goal = (goal, (x, y, yaw)), None
        elif goal is not None:
            goal.finish(GoalStatus.ABORTED, text="the robot was pushed off its walk")
        self.walk = self._before = self._drive = None

    def resume(self) -> None:
        """Go to the place that waits, from where the robot stands."""
        if self._waiting is None:
            return
        (goal, place), self._waiting = self._waiting, None
        x, y, yaw = standing_place(self._robot)
        forward, left, c, s = place[0] - x, place[1] - y, math.cos(yaw), math.sin(yaw)
        ahead = (c * forward + s * left, c * left - s * forward, place[2] - yaw)
        self.begin(self.plans.plan(self._robot, *ahead, None, gravity=self.gravity()), goal)

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        status = None if self.goal is None else (self.goal.status, self.goal.text)
        walk = (self.walk, self._before, self._start)
        return self.goal, status, *walk, self._waiting, self._drive, self._cut, self._later

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was; a goal that came since is given up."""
        goal, status, self.walk, self._before, self._start, waiting, self._drive, self._cut, self._later = saved
        if self.goal is not goal:
            self._drop("the world was restored")
        self.goal, self._waiting = goal, waiting
        if goal is not None:
            goal.status, goal.text = status

    def disown(self) -> None:
        """Take copies in place of the goals."""
        self.goal = None if self.goal is None else self.goal.copy()
        if self._waiting is not None:
            self._waiting = (self._waiting[0].copy(), self._waiting[1])

    def give_up(self, why: str, aborted: bool = False) -> None:
        """Stop at once, wherever the feet are: the robot was put elsewhere, or (``aborted``) met something."""
        if aborted and self.goal is not None:
            self.goal.finish(GoalStatus.ABORTED, text=why)
            for name in self.names:
                self._joints.take_over(name, -math.inf)
        else:
            self._later = ()
        self._drop(why)
        self.walk = self._before = self._drive = None

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
