"""The commands of a future: what a robot's copy was told there, carried out by the robot itself from now on."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from nuno.errors import BodyStateError
from nuno.robot.grip_order import GripOrder
from nuno.robot.simulated_joints import Sent
from nuno.robot.walk_order import WalkOrder

if TYPE_CHECKING:
    from nuno.robot.gait import Gait
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.servo import ServoCommand
    from nuno.robot.simulated_gripper import SimulatedGripper
    from nuno.robot.simulated_joints import SimulatedJoints
    from nuno.world.world import World

logger = logging.getLogger(__name__)


class CommandedRobot(Protocol):
    """The robot that carries commands out; `SimulatedRobot` says what each member is."""

    actual: Humanoid
    joints: SimulatedJoints
    gait: Gait
    grippers: dict[str, SimulatedGripper]

    def follow_grips(self, waiting: Sequence[GripOrder], given: Sequence[GripOrder], later: float) -> bool:
        """Let its hands do from now on what those of a copy were told; return whether that is anything."""

    def saved(self) -> tuple[Any, Any, Any, Any, Any]:
        """Return its state, what is wanted, its servo command, what was found of its way, and what it feels."""

    def servo(self, command: ServoCommand | None) -> None:
        """Put joints under a torque law, or give them back."""


def future_commands(robot: CommandedRobot, futures: World, k: int) -> Callable[[], None]:
    """Return what lets a robot do from now on what its copy in a future was told to.

    Where the robot is as it was when it was imagined, its joints are wanted to the bit where the copy's were. Else what
    was left then of trajectories under way begins from how its joints move now.

    Args:
        robot: The robot.
        futures: The futures.
        k: Which.

    Raises:
        BodyStateError: the robot is not in the futures; or it walks, or did as they were imagined, and time has passed.
    """
    name = robot.actual.name
    copies: Any = next((other for other in futures.drivers if getattr(other, "original", None) is robot), None)
    if copies is None:
        raise BodyStateError(f"{name!r} is not in these futures: it entered the world after they were imagined")
    under_way, servo, given = copies.commanded_in(k)
    _, _, joints, gait = under_way
    goes_on, passed = robot.joints.are_as(joints), robot.joints.clock - joints[0][0]
    # in whose controllers a hand's order takes the place of what came before
    sent = [Sent(own.clock, own.controller, None) if isinstance(own, GripOrder) and own.controller else own
            for own in given]  # fmt: skip
    sent = [own for own in sent if isinstance(own, Sent)]
    hands, waiting = copies.hands_under_way()
    if not goes_on:  # a hand that was under way is told anew, in place of what was left of its motion
        busy = [robot.grippers[hand].controller for hand, own in hands.items() if robot.grippers[hand].was_busy(own)]
        sent = [*(Sent(joints[0][0], controller, None) for controller in busy if controller), *sent]
    grips = [own for own in given if isinstance(own, GripOrder)]
    orders = [own for own in given if isinstance(own, WalkOrder)]
    if not goes_on and robot.gait.is_walking:
        raise BodyStateError(f"{name!r} walks, and these futures were imagined earlier: wait until it stands")
    if not goes_on and gait[2] is not None:
        raise BodyStateError(f"{name!r} walked as these futures were imagined, and has gone on since: imagine it anew")

    def carry_out() -> None:
        if goes_on:
            robot.gait.load(gait)
        robot.gait.follow(gait[-1], orders, 0.0 if goes_on else passed)
        if servo is not robot.saved()[2]:
            robot.servo(None if servo is None else servo.command)
        moves = robot.joints.follow(joints, sent) or robot.gait.is_walking or robot.gait.awaits
        moves = robot.follow_grips(waiting, grips, 0.0 if goes_on else passed) or moves
        for hand, saved in hands.items():
            robot.grippers[hand].go_on(saved, goes_on)
        if not moves and servo is None:
            logger.warning("%r was told nothing in future %d, and holds its joints where they are", name, k)

    return carry_out
