"""SimulatedGripper: a hand that opens and closes in its own time, and takes hold of what is in it."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.finger_dynamics import OPENS
from nuno.robot.goal import Goal, GoalStatus, ResultCode, standing_for
from nuno.robot.hands import Hand, pressed_by, width_at
from nuno.robot.simulated_joints import SimulatedJoints
from nuno.robot.trajectory import JointTrajectory

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nuno.joints.grip import Grip
    from nuno.robot.finger_dynamics import FingerDynamics
    from nuno.robot.robot_state import Contacts

logger = logging.getLogger(__name__)

PEAK = 1.5
"""Of the mean, the highest velocity on a cubic between two points of rest."""
STILL = 1e-4
"""[m] By which fingers that press move in a frame at most when they have come to rest,"""
PATIENCE = 120
"""and frames after which they count as resting all the same."""
NEAR = 2e-3
"""[m] How far from where they were to go fingers are that something stopped."""
LOOSE = 2.0 * OPENS
"""[m] By how much further apart than they hold something fingers are wanted that are to let go of it."""


class SimulatedGripper:
    """A hand, and the goal that it has.

    The fingers move at up to their greatest velocity; what is between them when they are to close is held from
    when they have, and let go when they begin to open. A hand without joints does either at the end of the next frame.
    A hand that presses holds by friction what stops its fingers. Where a vector of joint angles opens fingers that hold
    something, they let go of it, and a warning says so.

    Args:
        hand: The hand.
        joints: The robot's joints, of which the fingers' are some.
        fingers: The robot's fingers where they may have dynamics, or None.
        world: Of a copy in imagined worlds, in which of them; it tells nothing in the log. None for the robot's own.

    Attributes:
        effort: How hard the fingers are to press at most [N]; infinite before anybody said.
        closed: Whether it was told to close; see ``FingerDynamics``.
    """

    def __init__(
        self, hand: Hand, joints: SimulatedJoints, fingers: FingerDynamics | None = None, world: int | None = None
    ) -> None:  # fmt: skip
        self.hand, self._joints, self._fingers, self._copy = hand, joints, fingers, world
        self.goal: Goal | None = None
        self.effort, self.closed = np.inf, False
        self._motion: Goal | None = None
        self._closes, self._width = False, hand.description.width
        self._aim, self._last, self._waited = hand.description.width, hand.description.width, 0
        self._hold: tuple[tuple[Grip, ...], float] = ((), 0.0)  # grips, and how far apart the fingers were with them
        joint = hand.description.joint
        self.controller = next((name for name, own in joints.controllers.items() if joint in own.names), None)

    @property
    def will_hold(self) -> bool:
        """Return True while a hand closes that is to grip what is between its fingers when they have."""
        return self._closes and self.goal is not None and not self.goal.is_done and not self.hand.presses

    @property
    def is_at_rest(self) -> bool:
        """Return True if a frame in which the fingers do not move changes nothing."""
        grips = self.hand.grips
        ended = self.goal is None or self.goal.is_done or not (self._motion is None or self._motion.is_done)
        return ended and (not grips or self.hand.description.joint is None or grips == self._hold[0])

    @property
    def loose(self) -> float:
        """The width [m] beyond which the fingers let go of what they grip; infinite where they grip nothing."""
        return self._hold[1] + LOOSE if self.hand.grips and self.hand.description.joint is not None else np.inf

    def send(self, position: float, effort: float = np.inf, among_others: bool = False) -> Goal:
        """Let the hand open to ``position``, from 0 (closed) to 1, in place of what it does now.

        Args:
            position: From 0 (closed) to 1.
            effort: How hard the fingers press at most [N]; 0 is as hard as they can, as drivers take it that are told
                nothing.
            among_others: Whether what the fingers' controller was sent for later comes all the same.
        """
        if self.goal is not None:
            self.goal.finish(GoalStatus.PREEMPTED, text="another goal took its place")
        self.goal = Goal(position)
        self.goal.status = GoalStatus.ACTIVE
        self.effort = effort = effort if effort > 0.0 else np.inf
        self._command_fingers(position == 0.0)
        width = position * self.hand.description.width
        self._closes = width < self.hand.width or position == 0.0
        # one that is closed already closes on what it closed on before
        if self.hand.width > 0.0 and not (self._closes and self.hand.grips):
            self._width = self.hand.width
        self._aim, self._last, self._waited = width, self.hand.width, 0
        if not self._closes:
            self.hand.open()
        if self._closes and not self.hand.presses:  # nothing would stop the fingers but what is known of it
            width = max(width, min(self.hand.gap(effort), self.hand.width))
        self._motion = self._move(self.hand.joint_angles(width), among_others)
        return self.goal

    def end_frame(self, contacts: Contacts, wanted: np.ndarray) -> None:
        """Take hold where the fingers have closed, and end the goal where they have come to rest.

        Args:
            contacts: What touched the robot's links in the frame.
            wanted: Where its joints are wanted now, (n,) [rad; m for slides].
        """
        if self._fingers is not None:
            self.hand.pressed = pressed_by(self.hand, contacts)
        self._let_go_where_opened(wanted)
        goal = self.goal
        if goal is None or goal.is_done or (self._motion is not None and not self._motion.is_done):
            return
        if self._motion is not None and not self._motion.succeeded:
            goal.finish(GoalStatus.ABORTED, text=f"the fingers were stopped: {self._motion.text}")
            return
        if self.hand.presses and self._is_moving():
            return
        held = self.hand.close(width=self._width) if self._closes else ()
        names = tuple(body.name for body in held)
        goal.feedback, goal.holds = names, bool(held)
        if self.hand.width > self._aim + NEAR:
            goal.finish(GoalStatus.ABORTED, text=f"the fingers were stopped: {' and '.join(names) or 'too weak'}")
            return
        goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)

    def close_again(self) -> None:
        """Close anew on what the hand held before its robot was given dynamics: its fingers press on it now."""
        if self.hand.presses and self.hand.grips:
            self.hand.open()
            self.send(0.0, self.effort)

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        status = None if self.goal is None else (self.goal.status, self.goal.text)
        motion = (
            self._motion, self._closes, self._width, self._aim, self._last, self._waited, self.effort, self.closed,
            self._hold,
        )  # fmt: skip
        return self.goal, status, motion, self.hand.grips, self.hand.pressed

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was; a goal that came since is given up."""
        if self.goal is not None and self.goal is not saved[0]:
            self.goal.finish(GoalStatus.PREEMPTED, text="the world was restored, or a future adopted")
        self.goal, status, motion, grips, self.hand.pressed = saved
        self._motion, self._closes, self._width, self._aim, self._last, self._waited, self.effort = motion[:7]
        closed, self._hold = motion[7:]
        self._command_fingers(closed)
        if self.goal is not None:
            self.goal.status, self.goal.text = status
        self.hand.take_grips(grips)

    @staticmethod
    def was_busy(saved: tuple[Any, ...]) -> bool:
        """Return True if a goal was under way when ``save`` returned that."""
        return saved[0] is not None and saved[1][0] == GoalStatus.ACTIVE

    def go_on(self, saved: tuple[Any, ...], goes_on: bool) -> None:
        """Do what was under way when ``save`` returned that, in place of what came since.

        Args:
            saved: What it was then.
            goes_on: Whether the joints are as they were then, and follow what they followed.
        """
        goal = saved[0]
        if self.goal is not None and self.goal is not goal and not self.goal.is_done:
            self.goal.finish(GoalStatus.PREEMPTED, text="another goal took its place")
            self._command_fingers(self.closed and bool(self.hand.held))  # what met nothing yet stays where it is
        if goes_on and self.goal is not goal:
            self.load(saved)
        elif not goes_on and self.was_busy(saved):
            self.send(goal.asked, saved[2][6], among_others=True)

    def take_over(self, saved: tuple[Any, ...], goals: Mapping[int, Goal], grips: Mapping[str, Grip]) -> None:
        """Become what another gripper of this hand was, in another world.

        Args:
            saved: What it was, as ``save`` tells it.
            goals: Of the goals of its joints those that stand for them here, by ``id``; others are copied.
            grips: Those of this world, by key.
        """
        goal, status, motion, held, pressed = saved
        own_goal = None if goal is None else goal.copy()
        here = tuple(grips[grip.key] for grip in held if grip.key in grips)
        before, width = motion[8]
        known = tuple(grips[grip.key] for grip in before if grip.key in grips)
        own_motion = standing_for(motion[0], goals), *motion[1:8], (known, width)
        self.load((own_goal, status, own_motion, here, pressed))

    def _command_fingers(self, closed: bool) -> None:
        """Let fingers with dynamics press on what stops them, or no longer."""
        self.closed = closed
        if self._fingers is not None:
            self._fingers.command(self.hand.name, self.effort, closed, self._copy or 0)

    def _let_go_where_opened(self, wanted_angles: np.ndarray) -> None:
        """Let go of what is held where a vector of joint angles, and no gripper's goal, opens the fingers."""
        hand = self.hand
        joint = hand.description.joint
        presses = hand.presses and self._fingers is not None and self.closed
        held, grips = (hand.held, ()) if presses else ((), hand.grips)
        if joint is None or not (held or grips):
            return
        if self._motion is not None and not self._motion.is_done:
            return  # a gripper's goal moves the fingers
        if presses:
            row = hand.links.robot.joint_index(joint)
            wanted, width = float(width_at(hand.description, wanted_angles[row])), hand.width
        else:
            wanted = hand.width
            if grips != self._hold[0]:
                self._hold = grips, wanted
            width, held = self._hold[1], tuple(grip.body for grip in grips)
        if wanted <= width + LOOSE:
            return
        names = " and ".join(sorted({body.name for body in held}))
        tell = logger.warning if self._copy is None else logger.debug
        tell(
            "the %s of %r lets go of %s: %r was sent along and opens the fingers from %.3f m; send vectors in which "
            "that joint stays as it is (update_robot_state() and angle_vector() tell), or to one group of joints: "
            "angle_vector(angles, seconds, controller_type)", hand.name, hand.links.robot.name, names, joint, width,
        )  # fmt: skip
        if presses:
            self._command_fingers(False)
        hand.open()

    def _is_moving(self) -> bool:
        """Return True as long as the fingers move, up to a while."""
        width, self._last = self._last, self.hand.width
        self._waited += 1
        return self._waited < 2 or (abs(width - self._last) > STILL and self._waited < PATIENCE)

    def _move(self, angles: dict[str, float], among_others: bool) -> Goal | None:
        if self.controller is None or not angles:
            return None
        own = self._joints.controllers[self.controller]
        rows = self._joints.rows[self.controller]
        wanted = self._joints.positions[rows].copy()
        for joint, angle in angles.items():
            wanted[own.names.index(joint)] = angle
        change = np.abs(wanted - self._joints.positions[rows])
        span = PEAK * float((change / self._joints.velocity_limits[rows]).max())
        trajectory = JointTrajectory(own.names, np.array([span]), wanted[None], np.zeros((1, len(wanted))))
        return self._joints.send(self.controller, trajectory, among_others=among_others)
