"""ImaginedHands: the hands of a robot's copies in imagined worlds, which open and close in each by itself."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError, UnknownNameError
from nuno.robot.goal import Goal
from nuno.robot.grip_order import GripOrder, GripQueue
from nuno.robot.hand_copies import HandCopies
from nuno.robot.hands import width_at
from nuno.robot.interface import ARMS
from nuno.robot.simulated_gripper import SimulatedGripper
from nuno.validation import checked, finite_array, number
from nuno.world.grips_of_worlds import drop_empty_grips, grips_by_key

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.balance import Balance
    from nuno.robot.imagined_sensors import ImaginedSensors
    from nuno.robot.motion_batch import MotionBatch
    from nuno.robot.robot_state import RobotState
    from nuno.robot.wanted_motion import WantedMotion
    from nuno.world.world import World

logger = logging.getLogger(__name__)


class ImaginedHands:
    """Hands of ``ImaginedRobot``.

    What is between the fingers when they are to close is held from when they have, or pressed on by fingers with
    dynamics, in each world by itself, with the bits of the robot alone.

    Attributes:
        hands: The hands that can be commanded, by name; where another engine than Nuno's own computes, those whose
            fingers press.
    """

    original: Any
    world: World
    balance: Balance | None
    _states: list[RobotState]
    _motions: list[WantedMotion]
    _sent: list[tuple[Any, ...]]
    _links: list[Body]
    _together: MotionBatch
    _sensors: ImaginedSensors | None
    _chosen_worlds: Callable[[Any], list[int]]

    hands: dict[str, HandCopies]
    _grippers: dict[str, list[SimulatedGripper]]  # those that cannot be commanded, too, as they were imagined
    _queues: list[GripQueue]
    _hands_before: dict[str, Any]  # as the robot itself was imagined
    _orders_before: tuple[GripOrder, ...]
    _ended: np.ndarray | None  # (worlds, n), where joints are, while a frame ends whose motion is not up to date

    @checked
    def start_grasp(
        self, arm: str = "arms", effort: float = 25, *, worlds: ArrayLike | None = None, wait: bool = False
    ) -> list[np.ndarray]:
        """Close hands on what is in them, in each world by itself.

        Args:
            arm: "larm", "rarm" or "arms", which is all that the robot has.
            effort: How hard the fingers press at most [N; N m for hinges].
            worlds: In which: indices (k,), or a mask (worlds,) bool; None are all.
            wait: Run the batch until all of them have closed.

        Returns:
            Of each hand, (k,) bool, whether it holds something now; empty without ``wait``: ``hands`` tells later.

        Raises:
            UnknownNameError: another arm, or a hand that the robot lacks.
            InvalidInputError: no effort, or worlds that there are not.
            BodyStateError: a hand that another engine cannot let grip, or a link was removed from the batch.
        """
        ended = self._move_hands(arm, 0.0, effort, worlds, wait)
        return [np.array([goal.holds is True for goal in own]) for own in ended]

    @checked
    def stop_grasp(
        self, arm: str = "arms", effort: float = 25, *, worlds: ArrayLike | None = None, wait: bool = False
    ) -> list[np.ndarray]:
        """Open hands, and let go what they hold; see ``move_gripper``."""
        return self.move_gripper(arm, 1.0, effort, worlds=worlds, wait=wait)

    @checked
    def move_gripper(
        self, arm: str, pos: ArrayLike, effort: float = 25, *, worlds: ArrayLike | None = None, wait: bool = False
    ) -> list[np.ndarray]:
        """Open or close hands, in each world by itself.

        Args:
            arm: As of ``start_grasp``.
            pos: From 0 (closed) to 1 (open), one for all or (k,), one for each of ``worlds``.
            effort: As of ``start_grasp``.
            worlds: As of ``start_grasp``.
            wait: As of ``start_grasp``.

        Returns:
            Of each hand, (k,) bool, whether it got there; empty without ``wait``.

        Raises:
            UnknownNameError: as ``start_grasp``.
            InvalidInputError: as ``start_grasp``, or a position that is not from 0 to 1.
            BodyStateError: as ``start_grasp``.
        """
        return [np.array([goal.succeeded for goal in own]) for own in self._move_hands(arm, pos, effort, worlds, wait)]

    # Inside

    def _move_hands(self, arm: str, pos: ArrayLike, effort: float, worlds: Any, wait: bool) -> list[list[Goal]]:
        """Send hands their goals in some worlds, and return these once all have ended; none without ``wait``."""
        force = number("effort", effort, above=0.0)
        if arm not in ARMS:
            raise UnknownNameError("arm", arm, list(ARMS))
        with self.world.lock:
            chosen = self._chosen_worlds(worlds)
            own = np.broadcast_to(finite_array("pos", pos, (), (len(chosen),)), len(chosen))
            if ((own < 0.0) | (own > 1.0)).any():
                raise InvalidInputError(f"pos must be in 0 to 1, got {pos!r}")
            names = [name for name in ARMS[arm] if arm != "arms" or name in self._grippers]
            for name in names:
                self._check_hand(name)
            goals: list[list[Goal]] = []
            for name in names:
                goals.append([])
                for w, position in zip(chosen, own.tolist(), strict=True):
                    gripper, clock = self._grippers[name][w], self._motions[w].joints.clock
                    self._queues[w].forget(name)
                    goals[-1].append(gripper.send(position, force))
                    self._sent[w] += (GripOrder(clock, name, position, force, gripper.controller),)
                self._settle(name)
        if not wait:
            return []
        while any(not goal.is_done for row in goals for goal in row):
            self.world.step()
        return goals

    def _check_hand(self, name: str) -> None:
        if name in self._grippers and name not in self.hands:
            raise BodyStateError(
                f"{name} of {self.original.actual.name!r} grips what it closes on, and copies of hands that do are not "
                "commanded by another engine than Nuno's own: command the robot's before they are imagined"
            )
        if name not in self.hands:
            raise UnknownNameError("hand", name, list(self.hands))

    def _make_hands(self, of: tuple[ImaginedHands, int] | None, goals: Sequence[Mapping[int, Goal]]) -> None:
        """Let each copy's hands go on with what the robot's, or those of other copies, do.

        Args:
            of: The copies that these are copies of, and which of them; None where the robot itself is copied.
            goals: For each copy, which goals of its joints stand for those it was copied from, by ``id``.
        """
        self.hands, self._grippers, self._ended = {}, {}, None
        drop_empty_grips(self.world, self._links)
        self._orders_before = self.original.grip_orders() if of is None else of[0]._orders_before
        waiting = self._orders_before if of is None else of[0]._queues[of[1]].waiting
        grips, self._hands_before = grips_by_key(self.world), {}
        fingers = None if self.balance is None else self.balance.dynamics.fingers
        for name, original in self.original.grippers.items():
            hand = HandCopies(original.hand, self.world, self._links, self._angles_in)
            if self.world.engine.is_builtin or hand.copies[0].presses:
                self.hands[name] = hand
            saved = original.save() if of is None else of[0]._grippers[name][of[1]].save()
            self._hands_before[name] = saved if of is None else of[0]._hands_before[name]
            made = self._grippers[name] = []
            for w, (copy, motion, own) in enumerate(zip(hand.copies, self._motions, goals, strict=True)):
                made.append(SimulatedGripper(copy, motion.joints, fingers, world=w))
                made[-1].take_over(saved, own, grips)
        self._queues = []
        for w, motion in enumerate(self._motions):
            own_grippers = {name: self._grippers[name][w] for name in self.hands}
            self._queues.append(GripQueue(own_grippers, motion.joints))
            self._queues[-1].waiting = waiting

    def _angles_in(self, world: int) -> np.ndarray:
        """Return where the joints of one world's are (n,)."""
        if self.balance is not None:
            return np.asarray(self.original.actual.angles_of(self._states[world].q))
        return self._motions[world].joints.positions if self._ended is None else self._ended[world]

    def _settle(self, name: str) -> None:
        rigid = self.hands[name].settle()
        if rigid.any() and self._sensors is not None:
            self._sensors.forget(rigid)

    def _hands_ahead(self, count: int) -> int:
        """Return in how many of the next frames no hand does anything but in the last."""
        if any(queue.waiting for queue in self._queues):
            return 1
        for grippers in (self._grippers[name] for name in self.hands):
            if not all(own.is_at_rest for own in grippers):
                return 1
            widths = np.array([own.loose for own in grippers])
            if count > 1 and np.isfinite(widths).any():
                joint = grippers[0].hand.description.joint
                assert joint is not None
                angles = self._together.angles_ahead(count)[:, :, self.original.actual.joint_index(joint)]
                opens = (width_at(grippers[0].hand.description, angles) > widths).any(axis=1)
                count = int(opens.argmax()) + 1 if opens.any() else count
        return count

    def _take_up_grips(self) -> None:
        """Carry out what hands were to do by now of what was told for later."""
        if any(queue.waiting for queue in self._queues):
            self._together.bring()
            for queue in self._queues:
                queue.take_up()
            for name in self.hands:
                self._settle(name)

    def _end_hands(self, angles: np.ndarray | None = None) -> None:
        """Let hands take hold or let go at the end of a frame.

        Args:
            angles: (worlds, n), where joints without dynamics are then.
        """
        self._ended, wanted = angles, self._together.wanted
        for name, hand in self.hands.items():
            grippers, presses = self._grippers[name], hand.copies[0].presses
            busy = [w for w, own in enumerate(grippers) if presses or self._has_to_do(own)]
            for w in busy:
                grippers[w].end_frame(self._states[w].contacts, wanted[w])
            if busy:
                self._settle(name)
        self._ended = None

    @staticmethod
    def _has_to_do(gripper: SimulatedGripper) -> bool:
        return (gripper.goal is not None and not gripper.goal.is_done) or bool(gripper.hand.grips)

    def _save_hands(self) -> Any:
        grippers = {name: [own.save() for own in grippers] for name, grippers in self._grippers.items()}
        return grippers, [queue.waiting for queue in self._queues]

    def _load_hands(self, saved: Any) -> None:
        grippers, waiting = saved
        for name, rows in grippers.items():
            for gripper, own in zip(self._grippers[name], rows, strict=True):
                gripper.load(own)
        for queue, orders in zip(self._queues, waiting, strict=True):
            queue.waiting = orders

    def hands_under_way(self) -> tuple[dict[str, Any], tuple[GripOrder, ...]]:
        """Return how the robot's hands were as it was imagined, by name, and what they were to do later."""
        return self._hands_before, self._orders_before

    def grippers_of(self, world: int) -> tuple[dict[str, Any], tuple[GripOrder, ...]]:
        """Return how the hands of one world are, by name, and what they are to do later."""
        return {name: own[world].save() for name, own in self._grippers.items()}, self._queues[world].waiting
