"""ImaginedBase: walks of a robot's copies in imagined worlds, in each its own."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError
from nuno.robot.goal import Goal, GoalStatus
from nuno.robot.walk_order import WalkOrder
from nuno.validation import checked, finite_array, number
from nuno.world.progress import with_bar
from nuno.world.reset import checked_worlds

if TYPE_CHECKING:
    from nuno.robot.balance import Balance
    from nuno.robot.motion_batch import MotionBatch
    from nuno.robot.robot_state import RobotState
    from nuno.robot.wanted_motion import WantedMotion
    from nuno.world.world import World

logger = logging.getLogger(__name__)


class ImaginedBase:
    """Walks of ``ImaginedRobot``.

    A walk goes as the one that the robot's own driver begins when it is told the same in the same state, to the bit.
    """

    original: Any
    world: World
    balance: Balance | None
    _motions: list[WantedMotion]
    _states: list[RobotState]
    _sent: list[tuple[Any, ...]]
    _together: MotionBatch
    _base_goals: list[Goal | None]

    @checked
    def go_pos(
        self, x: ArrayLike = 0.0, y: ArrayLike = 0.0, yaw: ArrayLike = 0.0, *, worlds: ArrayLike | None = None,
        progress: bool | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Set off to a place seen from where each copy is now, and return at once which did, (k,) bool.

        Planning a walk takes 0.3 to 1 s; copies that stand alike and are to go alike share one. A copy that walks comes
        to rest first, and goes there then. Why one does not go, a warning says by world, and ``base_goals`` tells.

        Args:
            x: Forward [m], one for all or (k,), one for each of ``worlds``.
            y: To the left [m], likewise.
            yaw: Counterclockwise [rad], likewise.
            worlds: Which copies go: indices (k,), or a mask (worlds,) bool; None are all.
            progress: Progress bar of the planning; None shows one in a terminal after two seconds.

        Raises:
            InvalidInputError: not finite, other shapes, or worlds that there are not.
            BodyStateError: a link was removed from the batch.
        """
        return self._go((x, y, yaw), None, worlds, progress)

    @checked
    def go_velocity(
        self, x: ArrayLike = 0.0, y: ArrayLike = 0.0, yaw: ArrayLike = 0.0, sec: float = 1.0, *,
        worlds: ArrayLike | None = None, progress: bool | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Set off at a velocity for a while, or change the walk under way, and return which did, (k,) bool.

        Args:
            x: Forward [m/s], one for all or (k,), one for each of ``worlds``.
            y: To the left [m/s], likewise.
            yaw: Counterclockwise [rad/s], likewise.
            sec: For how long [s].
            worlds: As of ``go_pos``.
            progress: As of ``go_pos``.

        Raises:
            InvalidInputError: as ``go_pos``, or no time.
            BodyStateError: a link was removed from the batch.
        """
        return self._go((x, y, yaw), number("sec", sec, above=0.0), worlds, progress)

    @checked
    def send_velocity(
        self, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, hold: float = 1.0, *, worlds: ArrayLike | None = None
    ) -> np.ndarray:
        """Keep a velocity until another comes, as from a joystick, and return which do, (k,) bool.

        Each copy takes the newest at its next landing, and comes to rest ``hold`` after the last. Why one does not set
        off, or keeps to what it did, a warning says by world, and ``base_goals`` tells.

        Args:
            x: Forward [m/s], one for all or (k,), one for each of ``worlds``.
            y: To the left [m/s], likewise.
            yaw: Counterclockwise [rad/s], likewise.
            hold: How long it counts [s] where no other comes.
            worlds: As of ``go_pos``.

        Raises:
            InvalidInputError: as ``go_pos``, or no time.
            BodyStateError: a link was removed from the batch.
        """
        span = number("hold", hold, above=0.0)
        with self.world.lock:
            chosen = self._chosen_worlds(worlds)
            goals = []
            for w, (ahead, left, turn) in zip(chosen, self._ways((x, y, yaw), len(chosen)).tolist(), strict=True):
                gait, clock = self._motions[w].gait, self._motions[w].joints.clock
                gait.forget()
                goals.append(gait.drive(ahead, left, turn, span))
                self._sent[w] += (WalkOrder(clock, (ahead, left, turn), None, gait.walk, span),)
            return self._set_off(chosen, goals)

    @checked
    def go_stop(self, *, worlds: ArrayLike | None = None) -> None:
        """Let copies come to rest as soon as they safely can.

        Args:
            worlds: As of ``go_pos``.

        Raises:
            InvalidInputError: worlds that there are not.
            BodyStateError: a link was removed from the batch.
        """
        with self.world.lock:
            for w in self._chosen_worlds(worlds):
                gait = self._motions[w].gait
                gait.forget()
                gait.cancel()
                self._sent[w] += (WalkOrder(self._motions[w].joints.clock, None),)

    def base_goals(self) -> tuple[Goal | None, ...]:
        """Return of each copy the goal of the last walk that was begun or refused there; None where there was none.

        Its status and its text say how it ended, and why. What stopped it on the way is in ``state()[k].collision``.
        """
        with self.world.lock:
            return tuple(
                own.gait.newest_goal if refused is None else refused
                for own, refused in zip(self._motions, self._base_goals, strict=True)
            )

    # Inside

    def _go(self, way: Sequence[ArrayLike], sec: float | None, worlds: Any, progress: bool | None) -> np.ndarray:
        """Set copies off on a way (3,) [m, m, rad], or at that a second for ``sec`` [s]."""
        with self.world.lock:
            chosen = self._chosen_worlds(worlds)
            ways = (self._ways(way, len(chosen)) * (1.0 if sec is None else sec)).tolist()
            asked = list(zip(chosen, ways, strict=True))
            standing = [each for each in asked if not self._motions[each[0]].gait.is_walking]
            # kept until copies hold them, as robots that stand alike take the same
            planned = [
                self._motions[w].gait.planned(x, y, yaw, sec)
                for w, (x, y, yaw) in with_bar(standing, "planning walks", progress, "walk")
            ]
            goals = []
            for w, (x, y, yaw) in asked:
                gait, goal, clock = self._motions[w].gait, Goal((x, y, yaw)), self._motions[w].joints.clock
                gait.forget()
                gait.go(goal, x, y, yaw, sec)
                goals.append(goal)
                self._sent[w] += (WalkOrder(clock, (x, y, yaw), sec, gait.walk),)
            del planned
            return self._set_off(chosen, goals)

    @staticmethod
    def _ways(way: Sequence[ArrayLike], count: int) -> np.ndarray:
        """Return ways or velocities (count, 3) that are given by x, y and yaw, each one for all or (count,)."""
        parts = [finite_array(name, own, (), (count,)) for name, own in zip(("x", "y", "yaw"), way, strict=True)]
        return np.stack([np.broadcast_to(own, count) for own in parts], axis=1)

    def _set_off(self, chosen: list[int], goals: list[Goal]) -> np.ndarray:
        """Keep the goals that were refused, tell of them, and return which were not, (k,) bool."""
        why: dict[str, list[int]] = {}
        for w, goal in zip(chosen, goals, strict=True):
            refused = goal.status == GoalStatus.REJECTED
            self._base_goals[w] = goal if refused else None
            if refused:
                why.setdefault(goal.text, []).append(w)
        for text, own in why.items():
            logger.warning("%r did not set off in worlds %s: %s", self.original.actual.name, own, text)
        return np.array([goal.status != GoalStatus.REJECTED for goal in goals], dtype=bool)

    def _chosen_worlds(self, worlds: Any) -> list[int]:
        """Return the copies that are to be told something, all brought up to date.

        Raises:
            InvalidInputError: worlds that there are not.
            BodyStateError: a link was removed from the batch.
        """
        everyone = list(range(self.world.world_count))
        chosen = everyone if worlds is None else checked_worlds(worlds, len(everyone)).tolist()
        self._check_whole()
        self._together.bring()
        return chosen

    def _is_whole(self) -> bool:
        """Return True as long as no link was removed from the batch; without all of them the robot does nothing."""
        raise NotImplementedError

    def _check_whole(self) -> None:
        if not self._is_whole():
            raise BodyStateError(f"the copies of {self.original.actual.name!r} lack links; imagine the batch anew")

    def _carried(self, world: int) -> tuple[float, np.ndarray] | None:
        """Return what a copy carries as ``plan_walk`` takes it, None without dynamics."""
        if self.balance is None:
            return None
        state, robot = self._states[world], self.original.actual.copy()
        carried = self.balance.load(state)
        if carried is None:
            return None
        robot.move_to(robot.angles_of(state.q), state.q[:7])
        return carried.seen_from(robot)
