"""MotionBatch: how a robot's copies are to move, worked out together wherever nothing new happens to one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.joint_batch import JointBatch
from nuno.robot.robot_state import RobotState

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.motion_guard import MotionGuard
    from nuno.robot.wanted_motion import Servo, WantedMotion


class MotionBatch:
    """The wanted motions of copies of a robot without dynamics.

    Joints of copies in which only polynomials are followed go as arrays. A copy is asked itself, as if it were alone,
    where a controller takes up something else, a goal may end, a leg moves, the robot walks, or its guard is to look.
    What comes of it is the same to the bit.

    Args:
        robot: The robot.
        motions: Of the copies, which are brought up to date where they are asked, and by ``bring``.
        guards: Of the copies.
    """

    def __init__(self, robot: Humanoid, motions: Sequence[WantedMotion], guards: Sequence[MotionGuard]) -> None:
        self._robot, self._motions, self._guards = robot, motions, guards
        self._joints: JointBatch | None = None  # which has what the joints are, while nobody asks the copies
        self._aims: list[RobotState] = []
        self._asked: list[int] = []
        self._pending: tuple[Any, ...] = ()

    def begin(self, end: float, span: float, servo: Servo | None) -> tuple[list[RobotState], np.ndarray]:
        """Return how the copies are to move at a time ``end`` [s], ``span`` [s] from now, and their joints (n, m).

        ``end`` of this class takes that, ``cancel`` does not.
        """
        self._asked, self._pending = list(range(len(self._motions))), ()
        if span <= 0.0:
            self.bring()
            return [own.begin(end, span) for own in self._motions], self._angles()
        if self._joints is None:
            self._joints = JointBatch([own.joints for own in self._motions])
            self._aims = [own.aim for own in self._motions]
        joints, legs = self._joints, self._motions[0].leg_rows
        motion, desired, rests = joints.step(span)
        alone = joints.due(span) | np.array([servo is not None or own.gait.is_walking for own in self._motions])
        alone |= (motion[0] != joints.motion[0])[:, legs].any(axis=1) | motion[1:, :, legs].any(axis=(0, 2))
        for w, (guard, own) in enumerate(zip(self._guards, self._motions, strict=True)):
            alone[w] = alone[w] or guard.is_due(own, float(joints.clock[w]), span)
        self._asked, aims, angles = np.flatnonzero(alone).tolist(), list(self._aims), motion[0].copy()
        for w in self._asked:
            self._bring(w)
            self._guards[w].before_frame(self._motions[w], span)
            aims[w] = self._motions[w].begin(end, span, servo)
            angles[w] = self._motions[w].robot._angles
        for w in np.flatnonzero(rests & ~alone).tolist():
            before = self._aims[w]
            aims[w] = RobotState(end, before.q, before.v, before.a)
        moves = np.flatnonzero(~rests & ~alone)
        if len(moves):
            bases = np.array([self._aims[w].q[:7] for w in moves.tolist()])
            found = np.zeros((2, len(moves), self._robot.model.nv))
            found[:, :, 6:] = motion[1:, moves]
            for w, q, v, a in zip(
                moves.tolist(), self._robot.configuration_of(motion[0, moves], bases), *found, strict=True
            ):
                aims[w] = RobotState(end, q, v, a)
        self._pending = aims, ~alone, span, motion, desired
        return aims, angles

    def end(self) -> None:
        """Take the step that was worked out last."""
        for w in self._asked:
            own = self._motions[w]
            own.joints.take_step()
            own.gait.end_frame()
            if self._joints is not None:
                self._joints.gather(w)
        if self._joints is not None and self._pending:
            self._aims = self._pending[0]
            self._joints.take(*self._pending[1:])
        self._asked, self._pending = [], ()

    def cancel(self) -> None:
        """Go back to where all was when the step began."""
        for w in self._asked:
            self._motions[w].cancel()
        self._asked, self._pending = [], ()

    def bring(self) -> None:
        """Bring all copies up to date, for whoever reads or changes them."""
        if self._joints is not None:
            for w in range(len(self._motions)):
                self._bring(w)
        self.forget()

    def forget(self) -> None:
        """Begin anew with the copies as they are."""
        self._joints, self._pending = None, ()

    def _bring(self, world: int) -> None:
        assert self._joints is not None
        self._joints.scatter(world)
        self._motions[world].take(self._aims[world])

    def _angles(self) -> np.ndarray:
        return np.array([own.robot._angles for own in self._motions])
