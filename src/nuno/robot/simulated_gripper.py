"""SimulatedGripper: a hand that opens and closes in its own time, and takes hold of what is in it."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.robot.goal import Goal, GoalStatus, ResultCode
from nuno.robot.hands import Hand
from nuno.robot.simulated_joints import SimulatedJoints
from nuno.robot.trajectory import JointTrajectory

PEAK = 1.5
"""Of the mean, the highest velocity on a cubic between two points of rest."""


class SimulatedGripper:
    """A hand, and the goal that it has.

    The fingers move at up to their greatest velocity; what is between them when they are to close is held from
    when they have, and let go when they begin to open. A hand without joints does either at the end of the next frame.

    Args:
        hand: The hand.
        joints: The robot's joints, of which the fingers' are some.
    """

    def __init__(self, hand: Hand, joints: SimulatedJoints) -> None:
        self.hand, self._joints = hand, joints
        self.goal: Goal | None = None
        self._motion: Goal | None = None
        self._closes, self._width = False, hand.description.width
        joint = hand.description.joint
        self._controller = next((name for name, own in joints.controllers.items() if joint in own.names), None)

    def send(self, position: float) -> Goal:
        """Let the hand open to ``position``, from 0 (closed) to 1, in place of what it does now."""
        if self.goal is not None:
            self.goal.finish(GoalStatus.PREEMPTED, text="another goal took its place")
        self.goal = Goal(position)
        self.goal.status = GoalStatus.ACTIVE
        width = position * self.hand.description.width
        if self.hand.width > 0.0:  # one that is closed already closes on what it closed on before
            self._width = self.hand.width
        self._closes = width < self.hand.width or position == 0.0
        if not self._closes:
            self.hand.open()
        self._motion = self._move(self.hand.joint_angles(width))
        return self.goal

    def end_frame(self) -> None:
        """Take hold where the fingers have closed, and end the goal where they have come to rest."""
        goal = self.goal
        if goal is None or goal.is_done or (self._motion is not None and not self._motion.is_done):
            return
        if self._motion is not None and not self._motion.succeeded:
            goal.finish(GoalStatus.ABORTED, text=f"the fingers were stopped: {self._motion.text}")
            return
        held = self.hand.close(width=self._width) if self._closes else ()
        goal.feedback = tuple(body.name for body in held)
        goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        status = None if self.goal is None else (self.goal.status, self.goal.text)
        return self.goal, status, self._motion, self._closes, self._width, self.hand.grips

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was."""
        self.goal, status, self._motion, self._closes, self._width, grips = saved
        if self.goal is not None:
            self.goal.status, self.goal.text = status
        self.hand._grips = list(grips)

    def _move(self, angles: dict[str, float]) -> Goal | None:
        if self._controller is None or not angles:
            return None
        own = self._joints.controllers[self._controller]
        rows = self._joints.rows[self._controller]
        wanted = self._joints.positions[rows].copy()
        for joint, angle in angles.items():
            wanted[own.names.index(joint)] = angle
        change = np.abs(wanted - self._joints.positions[rows])
        span = PEAK * float((change / self._joints.velocity_limits[rows]).max())
        trajectory = JointTrajectory(own.names, np.array([span]), wanted[None], np.zeros((1, len(wanted))))
        return self._joints.send(self._controller, trajectory)
