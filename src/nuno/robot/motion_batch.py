"""MotionBatch: how a robot's copies are to move, worked out together wherever nothing new happens to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.joint_batch import JointBatch
from nuno.robot.robot_state import RobotState
from nuno.robot.trajectory import Motion

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.motion_guard import MotionGuard
    from nuno.robot.wanted_motion import WantedMotion


AT_ONCE = 8192
"""Frames of all worlds that are worked out at once: some 25 MB of poses."""


@dataclass(frozen=True, eq=False)
class FramesAhead:
    """Frames that were worked out ahead.

    Attributes:
        start: When the first begins [s].
        ends: When each ends [s].
        configurations: (n, nq) of the copies, at the end of each.
        motions: Velocities and accelerations (2, n, nv), likewise.
        joints: What is to become of the joints' clock, motion and desired motion, likewise.
    """

    start: float
    ends: list[float] = field(default_factory=list)
    configurations: list[np.ndarray] = field(default_factory=list)
    motions: list[np.ndarray] = field(default_factory=list)
    joints: list[tuple[np.ndarray, ...]] = field(default_factory=list)


class MotionBatch:
    """The wanted motions of copies of a robot.

    Joints of copies in which only polynomials are followed go as arrays. A copy is asked itself, as if it were alone,
    where a controller takes up something else, a goal may end, a leg moves, the robot walks, makes a step to catch
    itself, or its guard is to look. What comes of it is the same to the bit.

    Args:
        robot: The robot.
        motions: Of the copies, which are brought up to date where they are asked, and by ``bring``.
        guards: Of the copies; none where they have dynamics.

    Attributes:
        aims: How the copies are to move, as ``begin`` returned it last.
    """

    def __init__(self, robot: Humanoid, motions: Sequence[WantedMotion], guards: Sequence[MotionGuard]) -> None:
        self._robot, self._motions, self._guards = robot, motions, guards
        self._joints: JointBatch | None = None  # which has what the joints are, while nobody asks the copies
        self._aims: list[RobotState] = []
        self.aims: list[RobotState] = []
        self._asked: list[int] = []
        self._pending: tuple[Any, ...] = ()  # aims, and what `JointBatch.take` is told of them
        self._worked_out: tuple[Any, ...] = ()  # aims, and what joints are after frames that were worked out ahead
        self._ahead = FramesAhead(0.0)

    def look_ahead(self, start: float, ends: Sequence[float]) -> int:
        """Return how many frames can be begun at once, the first at ``start`` and each up to its end [s]; one at least.

        Those are worked out in which no copy must be asked.
        """
        self._ahead = ahead = FramesAhead(start)
        if any(own.gait.awaits for own in self._motions):
            return 1
        ends = ends[: max(1, AT_ONCE // len(self._motions))]
        joints, everyone = self._prepared(), np.ones(len(self._motions), dtype=bool)
        kept = joints.clock.copy(), joints.motion, joints.desired
        configurations = np.array([aim.q for aim in self._aims])
        motions = np.array([[aim.v for aim in self._aims], [aim.a for aim in self._aims]])
        pairs = list(zip(self._guards, self._motions, joints.clock.tolist(), strict=True))
        if any(guard.is_due(own, clock, ends[0] - start) for guard, own, clock in pairs):
            return 1
        quiet = np.array([guard.quiet_until(own) for guard, own, _ in pairs])
        for before, end in pairwise((start, *ends)):
            span = end - before
            motion, desired, rests = joints.step(span)
            due = self._are_due(span) | self._legs_move(motion) | (joints.clock + span > quiet)
            if due.any():
                break
            moves, before_it = ~rests, configurations
            configurations, motions = before_it.copy(), motions.copy()
            configurations[moves] = self._robot.configuration_of(motion[0, moves], before_it[moves, :7])
            motions[:, moves, :6], motions[:, moves, 6:] = 0.0, motion[1:, moves]
            joints.take(everyone, span, motion, desired)
            ahead.ends.append(end)
            ahead.configurations.append(configurations)
            ahead.motions.append(motions)
            ahead.joints.append((joints.clock.copy(), joints.motion, joints.desired))
        joints.clock, joints.motion, joints.desired = kept
        return max(len(ahead.ends), 1)

    def angles_ahead(self, count: int) -> np.ndarray:
        """Return where the joints are (count, n, m) in frames that were just looked ahead to; zeros where in none."""
        if not self._ahead.joints:
            return np.zeros((count, len(self._motions), len(self._robot.joint_names)))
        return np.stack([motion[0] for _, motion, _ in self._ahead.joints[:count]])

    def begin_ahead(
        self, start: float, end: float
    ) -> tuple[list[RobotState], np.ndarray, np.ndarray, np.ndarray] | None:
        """Return what was worked out ahead up to a time ``end`` [s], if it was: ``end`` of this class takes it.

        Returns:
            How the copies are to move then, the frames' ends (k,) [s], and the copies' configurations (k, n, nq) and
            joints (k, n, m) at those.
        """
        ahead = self._ahead
        self._ahead = FramesAhead(0.0)
        if ahead.start != start or end not in ahead.ends:
            return None
        count = ahead.ends.index(end) + 1
        configurations = np.stack(ahead.configurations[:count])
        aims = [RobotState(end, *own) for own in zip(configurations[-1], *ahead.motions[count - 1], strict=True)]
        self._asked, self._pending, self._worked_out = [], (), (aims, *ahead.joints[count - 1])
        angles = np.stack([motion[0] for _, motion, _ in ahead.joints[:count]])
        return aims, np.array(ahead.ends[:count]), configurations, angles

    def begin(
        self, end: float, span: float, servo: Callable[..., Any] | None = None, states: Sequence[RobotState] = ()
    ) -> tuple[list[RobotState], np.ndarray]:
        """Return how the copies are to move at a time ``end`` [s], ``span`` [s] from now, and their joints (n, m).

        ``end`` of this class takes that, ``cancel`` does not.

        Args:
            end: [s].
            span: [s].
            servo: Moves some joints of a world's copy, which it is told first, or None.
            states: How copies with dynamics move now.
        """
        self._asked, self._pending, self._worked_out = list(range(len(self._motions))), (), ()
        if any(own.gait.awaits for own in self._motions):
            self.bring()
            for own in self._motions:
                own.gait.take_up()
        if span <= 0.0:
            self.bring()
            self.aims = [own.begin(end, span) for own in self._motions]
            return self.aims, self._angles()
        joints = self._prepared()
        motion, desired, rests = joints.step(span)
        legs = self._legs_move(motion)
        alone = self._are_due(span) | (servo is not None) | (legs & bool(self._guards))
        for w, (guard, own) in enumerate(zip(self._guards, self._motions, strict=bool(self._guards))):
            alone[w] = alone[w] or guard.is_due(own, float(joints.clock[w]), span)
        for w, state in enumerate(states):
            alone[w] = alone[w] or (state.footing is not None and state.footing.step is not None)
        self._asked, aims, angles = np.flatnonzero(alone).tolist(), list(self._aims), motion[0].copy()
        for w in self._asked:
            self._bring(w)
            if self._guards:
                self._guards[w].before_frame(self._motions[w], span)
            aims[w] = self._motions[w].begin(end, span, None if servo is None else partial(servo, w))
            angles[w] = self._motions[w].robot._angles
        for w in np.flatnonzero(rests & ~alone).tolist():
            before = self._aims[w]
            aims[w] = RobotState(end, before.q, before.v, before.a)
        moves = np.flatnonzero(~rests & ~alone)
        if len(moves):
            bases = np.array([self._aims[w].q[:7] for w in moves.tolist()])
            found = np.zeros((2, len(moves), self._robot.model.nv))
            found[:, :, 6:] = motion[1:, moves]
            for k in np.flatnonzero(legs[moves]).tolist():
                self._tread(int(moves[k]), motion, bases[k], found[:, k, :6])
            for w, q, v, a in zip(
                moves.tolist(), self._robot.configuration_of(motion[0, moves], bases), *found, strict=True
            ):
                aims[w] = RobotState(end, q, v, a)
        self._pending, self.aims = (aims, ~alone, span, motion, desired), aims
        return aims, angles

    def end(self, states: Sequence[RobotState] = ()) -> None:
        """Take the step that was worked out last; copies with dynamics are in states."""
        for w in self._asked:
            own = self._motions[w]
            if states:
                own.take_footing(states[w])
            own.joints.take_step(self._actual(states[w]) if states else None)
            own.gait.end_frame()
            if self._joints is not None:
                self._joints.gather(w)
        if self._joints is not None and self._worked_out:
            self._aims, self._joints.clock, self._joints.motion, self._joints.desired = self._worked_out
        elif self._joints is not None and self._pending:
            self._aims, *found = self._pending
            self._joints.take(*found)
            for w in self._asked if states else ():
                self._aims[w] = self._motions[w].aim  # a step that ends puts it elsewhere
        self._drop_step()

    @property
    def wanted(self) -> np.ndarray:
        """Places (n, m) where the joints are wanted."""
        if self._joints is not None:
            return np.asarray(self._joints.desired[0])
        return np.array([own.joints.desired[0] for own in self._motions])

    def _actual(self, state: RobotState) -> Motion:
        """Return where the joints are in a state, and how they move, (m,) each."""
        return self._robot.angles_of(state.q), state.v[6:], state.a[6:]

    def cancel(self) -> None:
        """Go back to where all was when the step began."""
        for w in self._asked:
            self._motions[w].cancel()
        self._drop_step()

    def _drop_step(self) -> None:
        self._asked, self._pending, self._worked_out = [], (), ()

    def bring(self) -> None:
        """Bring all copies up to date, for whoever reads or changes them."""
        if self._joints is not None:
            for w in range(len(self._motions)):
                self._bring(w)
        self.forget()

    def forget(self) -> None:
        """Begin anew with the copies as they are."""
        self._joints, self._pending, self._worked_out, self._ahead = None, (), (), FramesAhead(0.0)

    def _prepared(self) -> JointBatch:
        """Return the joints of all copies as arrays."""
        if self._joints is None:
            self._joints = JointBatch([own.joints for own in self._motions])
            self._aims = [own.aim for own in self._motions]
        return self._joints

    def _are_due(self, span: float) -> np.ndarray:
        """Return whose controllers or walk must be asked in a frame of ``span`` [s], (n,) bool."""
        assert self._joints is not None
        return self._joints.due(span) | np.array([own.gait.is_walking for own in self._motions])

    def _legs_move(self, motion: np.ndarray) -> np.ndarray:
        """Return whose legs move in a frame with a motion (3, n, m), (n,) bool."""
        assert self._joints is not None
        legs = self._motions[0].leg_rows
        moved = (motion[0] != self._joints.motion[0])[:, legs].any(axis=1)
        return np.asarray(moved | motion[1:, :, legs].any(axis=(0, 2)))

    def _tread(self, world: int, motion: np.ndarray, base: np.ndarray, base_motion: np.ndarray) -> None:
        """Let the base (7,) of a copy, and its velocity and acceleration (2, 6), go as its feet stay."""
        assert self._joints is not None
        a, b, c = motion[:, world]
        stood = self._motions[0].stance.base_from(self._aims[world].q, self._joints.motion[0, world], (a, b, c))
        if stood is not None:
            base[:], base_motion[:] = stood

    def _bring(self, world: int) -> None:
        assert self._joints is not None
        self._joints.scatter(world)
        self._motions[world].take(self._aims[world])

    def _angles(self) -> np.ndarray:
        return np.array([own.robot._angles for own in self._motions])
