"""TrajectoryController: what a controller of ros2_control's kind does with the trajectories that it is sent."""

from __future__ import annotations

import copy
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from nuno.robot.goal import Goal, GoalStatus, ResultCode, Tolerances
from nuno.robot.trajectory import JointTrajectory, Motion, Piece, Spline, resting_at

logger = logging.getLogger(__name__)

ARRIVED = 1e-3
"""[rad; m] How near the joints must come to the last point, where a goal says nothing of it."""
SOON = 1e-9
"""[s] Rounding of sums of frames."""
OTHERS = "the commands of a future took its place"


class Feedback(NamedTuple):
    """Feedback of a trajectory that is being followed.

    Attributes:
        time: [s] of the controller's clock.
        names: Of the joints, m of them.
        rows: Where they are among others, (m,).
        all_desired: Positions, velocities and accelerations of all those as trajectories have them, (n,) each.
        all_actual: As they are.
    """

    time: float
    names: tuple[str, ...]
    rows: np.ndarray
    all_desired: Motion
    all_actual: Motion

    @property
    def desired(self) -> Motion:
        """Positions, velocities and accelerations as the trajectory has them, (m,) each."""
        a, b, c = self.all_desired
        return a[self.rows], b[self.rows], c[self.rows]

    @property
    def actual(self) -> Motion:
        """Positions, velocities and accelerations as they are, (m,) each."""
        a, b, c = self.all_actual
        return a[self.rows], b[self.rows], c[self.rows]

    @property
    def error(self) -> np.ndarray:
        """(m,) float [rad; m], desired less actual positions."""
        return np.array(self.desired[0] - self.actual[0])


@dataclass(frozen=True, eq=False)
class Later:
    """A trajectory that a controller is to be sent at a time to come.

    Attributes:
        start: When [s] of the controller's clock.
        trajectory: What; None only while it is put among others, where something else takes their place then.
    """

    start: float
    trajectory: JointTrajectory


class TrajectoryController:
    """Some joints, and the trajectory that they follow.

    A goal takes the place of the one before and starts from where that wants the joints, as they would move then.
    One that starts later lets the motion under way go on until then. All times are of one clock that its owner keeps.

    Args:
        names: Of the joints, m of them.
        positions: (m,) where they are [rad; m for slides].
        limits: Lower and upper limits (m,); goals beyond them are taken to them.

    Attributes:
        goal: The last one, which may have ended.
        piece: The polynomial that the joints follow.
        near: How far joints may be from the end of a goal without tolerances when it succeeds [rad; m for slides].
    """

    def __init__(
        self, names: Sequence[str], positions: np.ndarray, limits: tuple[np.ndarray, np.ndarray] | None = None
    ) -> None:
        self.names = tuple(names)
        self.limits = limits
        self.near = ARRIVED
        self.goal: Goal | None = None
        self.tolerances = Tolerances()
        self._spline: Spline | None = None
        self._next: tuple[float, float, JointTrajectory] | None = None  # its start, when it is joined, and it
        self._later: tuple[Later, ...] = ()  # what comes after that, each as if it were sent then
        self.piece = Piece(0.0, np.inf, resting_at(positions))

    @property
    def is_busy(self) -> bool:
        """Return True if a goal is under way, or one is to come."""
        return bool(self._later) or (self.goal is not None and not self.goal.is_done)

    @property
    def next_event(self) -> float:
        """Until when [s] no other polynomial is due and no goal can end, so that nobody need ask at every frame."""
        if self.is_busy and self.tolerances.path:
            return -np.inf
        earliest = np.inf if self._next is None else self._next[1]
        if self._later:
            earliest = min(earliest, self._later[0].start)
        if self._spline is not None:
            earliest = min(earliest, self.piece.end, self._spline.end if self.is_busy else np.inf)
        return float(earliest - 2.0 * SOON)

    def accept(
        self, trajectory: JointTrajectory, now: float, start_time: float = 0.0, tolerances: Tolerances | None = None,
        among_others: bool = False,
    ) -> Goal:  # fmt: skip
        """Take a trajectory that starts ``start_time`` [s] from ``now`` [s]; what cannot be followed is rejected.

        What was sent for later is given up, but where it is one ``among_others``.
        """
        goal = Goal(trajectory)
        strangers = set(trajectory.names) ^ set(self.names)
        wanted = tolerances or Tolerances()
        if strangers:
            what = f"a trajectory for this controller has the joints {', '.join(self.names)}"
            goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_JOINTS, f"{what}; {sorted(strangers)[0]!r} differs")
        elif strangers := (set(wanted.path) | set(wanted.goal)) - set(self.names):
            what = f"there are tolerances for {sorted(strangers)[0]!r}, which this controller does not move"
            goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_JOINTS, what)
        elif start_time + trajectory.duration < -SOON:
            what = f"the trajectory ended {-start_time - trajectory.duration:.3f} s ago"
            goal.finish(GoalStatus.REJECTED, ResultCode.INVALID_GOAL, what)
        if goal.is_done:
            logger.warning("a goal was rejected: %s", goal.text)
            return goal
        self._take_goal(goal, wanted)
        self._later = self._later if among_others else ()
        start = now + start_time
        self._next = (start, max(start, now), self._within_limits(trajectory.of(self.names)))
        self.advance(now)
        return goal

    def _take_goal(self, goal: Goal, tolerances: Tolerances) -> None:
        if self.goal is not None:
            self.goal.finish(GoalStatus.PREEMPTED, ResultCode.INVALID_GOAL, "another goal took its place")
        self.goal, self.tolerances = goal, tolerances
        goal.status = GoalStatus.ACTIVE

    def go_on(self, under_way: tuple[Any, ...], sent: Sequence[Later]) -> None:
        """Become what the controller was, and take later what another one was sent from then on.

        Args:
            under_way: What it was, as ``save`` tells it, at the present time of its clock.
            sent: What it is sent.
        """
        if self.goal is not None and self.goal is not under_way[4]:
            self.goal.finish(GoalStatus.PREEMPTED, ResultCode.INVALID_GOAL, OTHERS)
        self.load(under_way)
        if self._next is not None and sent and sent[0].start < self._next[1] - SOON:
            self._next = None  # what was sent earlier takes its place
        self._later = _queued(self._later, sent)

    def begin_anew(
        self, under_way: tuple[Any, ...], sent: Sequence[Later], then: float, now: float, positions: np.ndarray
    ) -> None:  # fmt: skip
        """Do from now on what another controller of these joints did from a time on, wherever they are.

        Args:
            under_way: What it did at that time, as ``save`` tells it.
            sent: What it was sent from then on.
            then: That time [s] of its clock.
            now: The time [s] of this one's.
            positions: Where the joints are now (m,).
        """
        _, spline, after, _, _, _, later = under_way
        waiting = [] if after is None else [Later(after[0], after[2])]
        if spline is not None and (rest := _rest_of(spline, then)) is not None:
            waiting.insert(0, Later(then, rest))
        queue = _queued((*waiting, *later), sent)
        if queue and queue[0].start <= then + SOON:  # from how the joints move now
            if self.goal is not None:
                self.goal.finish(GoalStatus.PREEMPTED, ResultCode.INVALID_GOAL, OTHERS)
        else:
            self.hold(positions, GoalStatus.PREEMPTED, ResultCode.INVALID_GOAL, OTHERS)
        self._next, self._later = None, tuple(Later(now + (own.start - then), own.trajectory) for own in queue)

    def cancel(self, positions: np.ndarray) -> None:
        """Give the goal up, and hold the joints at positions (m,)."""
        self._later = ()
        self.hold(positions, GoalStatus.PREEMPTED, None, "it was cancelled")

    def hold(self, positions: np.ndarray, status: GoalStatus, code: int | None, text: str) -> None:
        """End the goal, and hold the joints at positions (m,) until something comes that was sent for later."""
        if self.goal is not None:
            self.goal.finish(status, code, text)
        self._spline, self._next = None, None
        self.piece = Piece(0.0, np.inf, resting_at(np.array(positions)))

    def forget_later(self) -> None:
        """Give up what was sent for later."""
        self._later = ()

    def move_rest(self, positions: np.ndarray, after: float = np.inf) -> None:
        """Hold the joints at positions (m,) that something else has brought them to; a goal under way is aborted.

        Args:
            positions: (m,).
            after: Of what was sent for later, all that is to begin after that time [s] is kept.
        """
        self._later = tuple(own for own in self._later if own.start > after)
        self.hold(positions, GoalStatus.ABORTED, ResultCode.INVALID_GOAL, "the joints are moved by something else")

    def advance(self, time: float, tells: bool = True) -> bool:
        """Take up the polynomial for a time [s] that does not lie before those asked for so far.

        Args:
            time: [s].
            tells: Whether goals are told.

        Returns:
            Whether ``piece`` is another one now.
        """
        renewed = False
        if self._next is not None and time >= self._next[1] - SOON:
            start, joined, trajectory = self._next
            first = (self.piece if self._spline is None else self._spline).at(joined)
            self._spline, self._next = Spline(start, joined, first, trajectory), None
            renewed = True
        while self._later and time > self._later[0].start + SOON:  # in the frame after it, as what is sent between two
            own, self._later = self._later[0], self._later[1:]
            first = (self.piece if self._spline is None else self._spline).at(own.start)
            self._spline, self._next = Spline(own.start, own.start, first, own.trajectory), None
            if tells:
                self._take_goal(Goal(own.trajectory), Tolerances())
            renewed = True
        if self._spline is not None and (renewed or time >= self.piece.end):
            self.piece = self._spline.piece(time)
            renewed = True
        return renewed

    @property
    def end(self) -> float:
        """The time when the joints come to rest [s], as far as is known now; -inf where nothing is asked of them."""
        if self._later:
            return self._later[-1].start + self._later[-1].trajectory.duration
        if self._next is not None:
            return self._next[0] + self._next[2].duration
        return -np.inf if self._spline is None else self._spline.end

    def ahead(self, times: np.ndarray) -> np.ndarray:
        """Return where the joints are wanted (k, m) at times (k,) [s] to come, increasing; nothing changes."""
        found, own, k = np.empty((len(times), len(self.names))), copy.copy(self), 0
        while k < len(times):
            own.advance(float(times[k]), tells=False)
            end = own.piece.end if own._next is None else min(own.piece.end, own._next[1] - SOON)
            end = min(end, own._later[0].start + SOON) if own._later else end
            last = max(k + 1, int(np.searchsorted(times, end)))
            spans = (times[k:last] - own.piece.start)[:, None]
            part = np.zeros((last - k, len(self.names)))
            for coefficient in own.piece.coefficients[::-1]:
                part = part * spans + coefficient
            found[k:last], k = part, last
        return found

    def tell(self, time: float, desired: Motion, actual: Motion, rows: np.ndarray) -> None:
        """Give the goal under way its feedback: as ``check``, before the time of ``next_event``."""
        goal = self.goal
        if goal is not None and not goal.is_done:
            goal.feedback = Feedback(time, self.names, rows, desired, actual)

    def check(self, time: float, desired: Motion, actual: Motion, rows: np.ndarray) -> bool:
        """Compare what is wanted at a time [s] with what is, and end the goal where that is due.

        Args:
            time: [s].
            desired: Positions, velocities and accelerations (n,) of many joints.
            actual: As they are.
            rows: The controller's joints among those, (m,).

        Returns:
            Whether ``piece`` is another one now: the joints hold where a tolerance was violated.
        """
        goal = self.goal
        if goal is None or goal.is_done:
            return False
        goal.feedback = Feedback(time, self.names, rows, desired, actual)
        if self._next is not None or self._spline is None:
            return False
        late = time - self._spline.end
        if late < -SOON and not self.tolerances.path:
            return False
        positions = actual[0][rows]
        error = np.abs(desired[0][rows] - positions)
        if late < -SOON:
            beyond = self._beyond(self.tolerances.path, error)
            if beyond:
                code, text = ResultCode.PATH_TOLERANCE_VIOLATED, f"on the way {beyond}"
                self.hold(positions, GoalStatus.ABORTED, code, text)
                logger.warning("a goal was aborted: %s", text)
            return bool(beyond)
        beyond = self._beyond({name: self.near for name in self.names} | dict(self.tolerances.goal), error)
        if not beyond:
            goal.finish(GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)
        elif self.tolerances.goal_time > 0.0 and late > self.tolerances.goal_time:
            code, text = ResultCode.GOAL_TOLERANCE_VIOLATED, f"at the end {beyond}"
            self.hold(positions, GoalStatus.ABORTED, code, text)
            logger.warning("a goal was aborted: %s", text)
            return True
        return False

    def save(self) -> tuple[Any, ...]:
        """Return all that it is, for ``load``."""
        goal = self.goal
        outcome = None if goal is None else (goal.status, goal.code, goal.text, goal.feedback)
        return self.piece, self._spline, self._next, self.tolerances, goal, outcome, self._later

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was; a goal that came since is given up."""
        piece, spline, after, tolerances, goal, outcome, self._later = saved
        if self.goal is not None and self.goal is not goal:
            self.goal.finish(GoalStatus.PREEMPTED, ResultCode.INVALID_GOAL, "the world was restored")
        self.piece, self._spline, self._next, self.tolerances, self.goal = piece, spline, after, tolerances, goal
        if goal is not None:
            goal.status, goal.code, goal.text, goal.feedback = outcome

    def _within_limits(self, trajectory: JointTrajectory) -> JointTrajectory:
        if self.limits is None:
            return trajectory
        lower, upper = self.limits
        kept = np.clip(trajectory.positions, lower, upper)
        beyond = np.abs(kept - trajectory.positions).max(axis=0)
        if (beyond <= 1e-6).all():
            return trajectory
        k = int(beyond.argmax())
        logger.warning("a goal is beyond the limits and is taken to them: %s by %.4f", self.names[k], beyond[k])
        return JointTrajectory(self.names, trajectory.times, kept, trajectory.velocities, trajectory.accelerations)

    def _beyond(self, tolerances: Any, error: np.ndarray) -> str:
        for k, name in enumerate(self.names):
            allowed = tolerances.get(name, 0.0)
            if allowed > 0.0 and error[k] > allowed:
                return f"{name} is {error[k]:.4f} from where it should be, more than {allowed:g}"
        return ""


def _queued(waiting: Sequence[Later], sent: Sequence[Later]) -> tuple[Later, ...]:
    """Return what waits, and what is sent, each of which takes the place of all that waits at its time."""
    queue = list(waiting)
    for own in sent:
        until = own.start + (SOON if own.trajectory is not None else -SOON)
        queue = [*(before for before in queue if before.start <= until), own]
    return tuple(own for own in queue if own.trajectory is not None)


def _rest_of(spline: Spline, time: float) -> JointTrajectory | None:
    """Return what is left of a trajectory at a time [s], None where it is over."""
    own, passed = spline.trajectory, time - spline.start
    left = own.times > passed + SOON
    if not left.any():
        return None
    velocities = None if own.velocities is None else own.velocities[left]
    accelerations = None if own.accelerations is None else own.accelerations[left]
    return JointTrajectory(own.names, own.times[left] - passed, own.positions[left], velocities, accelerations)
