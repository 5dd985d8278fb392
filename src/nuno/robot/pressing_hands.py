"""PressingHands: the hands of a robot's copies with dynamics, each of which lets go where its fingers are opened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.goal import Goal, standing_for
from nuno.robot.hands import pressed_names, width_at
from nuno.robot.simulated_gripper import LOOSE

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.finger_dynamics import FingerDynamics
    from nuno.robot.robot_state import RobotState
    from nuno.robot.simulated_gripper import SimulatedGripper


class PressingHands:
    """Hands whose fingers press, in each world by itself.

    They take no commands. Where a vector of joint angles opens the fingers, what they press on is let go as the robot's
    own hands do (``SimulatedGripper``).

    Args:
        grippers: The robot's own.
        fingers: The copies' fingers.
        links: The copies of the robot's links.
        goals: For each copy, which goals of its joints stand for those it was copied from, by ``id``.
        of: The copies that these are copies of, and which of them; None where the robot itself is copied.
    """

    def __init__(
        self, grippers: Mapping[str, SimulatedGripper], fingers: FingerDynamics, links: Sequence[Body],
        goals: Sequence[Mapping[int, Goal]], of: tuple[PressingHands, int] | None,
    ) -> None:  # fmt: skip
        self._fingers, self._links = fingers, links
        self._hands = {name: own.hand for name, own in grippers.items() if name in fingers.closed}
        self._motions: dict[str, list[Goal | None]] = {}  # of a hand's own goal, by world
        for name in self._hands:
            before = grippers[name].motion if of is None else of[0]._motions[name][of[1]]
            self._motions[name] = [standing_for(before, own) for own in goals]
        if of is not None:
            fingers.become(of[0]._fingers, of[1])

    def motions_of(self, world: int) -> dict[str, Goal | None]:
        """Return by hand what moves the fingers of one world's, of what the hands themselves were told."""
        return {name: own[world] for name, own in self._motions.items()}

    def end_frame(self, states: Sequence[RobotState], angles: np.ndarray, wanted: np.ndarray) -> None:
        """Let hands go of what they press on where their fingers are wanted further open than they are.

        Args:
            states: Of each world, at the end of the frame.
            angles: (worlds, n), where the joints are then,
            wanted: (worlds, n), and where they are wanted.
        """
        for name, hand in self._hands.items():
            own = hand.description
            if own.joint is None:
                continue
            row = hand.links.robot.joint_index(own.joint)
            loose = width_at(own, wanted[:, row]) > width_at(own, angles[:, row]) + LOOSE
            opens = np.asarray(self._fingers.closed[name] & loose)
            for world in np.flatnonzero(opens).tolist():
                motion = self._motions[name][world]
                moves = motion is not None and not motion.is_done  # by its own goal
                opens[world] = not moves and bool(pressed_names(hand, states[world].contacts, self._links))
            if opens.any():
                self._fingers.closed[name] = self._fingers.closed[name] & ~opens
