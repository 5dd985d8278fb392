"""GripOrder: what a robot's hand was told to do, kept for another that is to do the same later."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from nuno.robot.walk_order import SOON

if TYPE_CHECKING:
    from nuno.robot.simulated_gripper import SimulatedGripper
    from nuno.robot.simulated_joints import SimulatedJoints


class GripOrder(NamedTuple):
    """An order to open or close a hand.

    Attributes:
        clock: When it was given [s], by the joints' clock.
        hand: Which hand.
        position: How far open, from 0 (closed) to 1.
        effort: How hard its fingers press at most [N].
        controller: Which controller moves its fingers, None where there is none.
    """

    clock: float
    hand: str
    position: float
    effort: float
    controller: str | None


class GripQueue:
    """Orders to a robot's hands that are to be carried out later.

    Args:
        grippers: The hands, by name.
        joints: Whose clock counts.

    Attributes:
        waiting: The orders, in the order of time.
    """

    def __init__(self, grippers: Mapping[str, SimulatedGripper], joints: SimulatedJoints) -> None:
        self._grippers, self._joints = grippers, joints
        self.waiting: tuple[GripOrder, ...] = ()

    def follow(self, waiting: Sequence[GripOrder], given: Sequence[GripOrder], later: float) -> None:
        """Carry out from now on what another robot's hands were told, each order ``later`` [s] after it was.

        Args:
            waiting: What they were to do when it was left alone.
            given: What they were told from then on.
            later: [s].
        """
        queue = list(waiting)
        for own in given:
            queue = [*(before for before in queue if before.hand != own.hand or before.clock <= own.clock + SOON), own]
        queue.sort(key=lambda own: own.clock)
        self.waiting = tuple(own._replace(clock=own.clock + later) for own in queue)

    def forget(self, hand: str) -> None:
        """Give up what is to come later for a hand: it is told something else."""
        self.waiting = tuple(own for own in self.waiting if own.hand != hand)

    def take_up(self) -> None:
        """Carry out what is due by now; what other hands were told waits on."""
        now = self._joints.clock + SOON
        due = [own for own in self.waiting if own.clock <= now and own.hand in self._grippers]
        if due:
            self.waiting = tuple(own for own in self.waiting if own not in due)
        for order in due:
            self._grippers[order.hand].send(order.position, order.effort, among_others=True)
