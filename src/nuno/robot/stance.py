"""Stance: where the base of a robot goes when its legs move and its feet stay on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.robot_model import IDENTITY

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.trajectory import Motion

LOWER = 5e-3
"""[m] How much lower than the first foot another one must be to be the one that bears the robot."""


class Stance:
    """The foot that bears a robot keeps its place: as the legs move, it is the base that goes.

    Where both feet stand, that is the first one (the left); legs that are moved so that both could stay let both stay.
    Where one is lifted it is the lower one.

    Limitations: nothing falls or slips, and no foot is kept out of the ground.

    Args:
        robot: The robot; of one without legs the base stays.

    Attributes:
        rows: Joints of all legs, (k,): while they rest the base stays.
    """

    def __init__(self, robot: Humanoid) -> None:
        self._robot, model = robot, robot.model
        frames = [robot.frame_index(foot) for foot in robot.description.feet]
        joints = [int(model.frames[frame].parentJoint) for frame in frames]
        self._rows = [np.array([j - 2 for j in model.supports[joint] if j >= 2], dtype=int) for joint in joints]
        self.rows = np.unique(np.concatenate([np.zeros(0, dtype=int), *self._rows]))
        self._placements = [model.frames[frame].placement.copy() for frame in frames]
        # Pinocchio's own: where the soles are now, and how the feet would move with a base that rests
        self._soles = [robot.data.oMf[frame] for frame in frames]
        data = robot.scratch
        self._carriers = [(data.oMi[joint], data.v[joint], data.a[joint]) for joint in joints]

    def ahead(self, angles: np.ndarray) -> np.ndarray | None:
        """Return where the base goes (k, 7) as the joints go through angles (k, n) from now on, None where it stays.

        The foot that bears the robot now is taken to bear it all the while.
        """
        if not any((np.ptp(angles[:, rows], axis=0) != 0.0).any() for rows in self._rows):
            return None
        foot, robot = self._bearing(), self._robot
        placed = self._soles[foot].copy()
        carrier = self._carriers[foot][0]
        found = np.empty((len(angles), 7))
        for k, own in enumerate(angles):
            pin.forwardKinematics(robot.model, robot.scratch, robot.configuration_of(own, IDENTITY))
            found[k] = pin.SE3ToXYZQUAT(placed * (carrier * self._placements[foot]).inverse())
        return found

    def _bearing(self) -> int:
        """Return the number of the foot that bears the robot where it is."""
        self._robot.update()
        return _lower(self._soles)

    def base(self, present: np.ndarray, motion: Motion) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]] | None:
        """Return where the base goes and how it moves, None where it stays.

        Args:
            present: (n,) angles that the robot has now [rad; m for slides].
            motion: Positions, velocities and accelerations (n,) that the joints are about to have.

        Returns:
            Position and quaternion (x, y, z, w) of the base (7,), and its velocity and acceleration (6,) each in its
            own frame.
        """
        legs_move = self._legs_move(present, motion)
        if not any(legs_move):
            return None
        k = self._bearing()
        return self._carried_by(k, self._soles[k], motion) if legs_move[k] else None

    def base_from(
        self, q: np.ndarray, present: np.ndarray, motion: Motion
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]] | None:
        """Return what `base` does for a copy of the robot that is in a configuration q (nq,) now."""
        legs_move = self._legs_move(present, motion)
        if not any(legs_move):
            return None
        model, data = self._robot.model, self._robot.scratch
        pin.forwardKinematics(model, data, q)
        soles = [carrier * own for (carrier, *_), own in zip(self._carriers, self._placements, strict=True)]
        k = _lower(soles)
        return self._carried_by(k, soles[k], motion) if legs_move[k] else None

    def _legs_move(self, present: np.ndarray, motion: Motion) -> list[bool]:
        positions, velocities, accelerations = motion
        moving = (positions != present) | (velocities != 0.0) | (accelerations != 0.0)
        return [bool(np.count_nonzero(moving[rows])) for rows in self._rows]

    def _carried_by(
        self, k: int, sole: Any, motion: Motion
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:  # fmt: skip
        """Return the base and its motion as one foot keeps its place."""
        robot, (positions, velocities, accelerations) = self._robot, motion
        model = robot.model
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[6:], a[6:] = velocities, accelerations
        pin.forwardKinematics(model, robot.scratch, robot.configuration_of(positions, IDENTITY), v, a)
        # seen from the base the foot moves; as it stands, the base moves against that
        carrier, velocity, acceleration = self._carriers[k]
        placed = sole * (carrier * self._placements[k]).inverse()
        return pin.SE3ToXYZQUAT(placed), (-carrier.act(velocity).vector, -carrier.act(acceleration).vector)


def _lower(soles: Sequence[Any]) -> int:
    """Return the number of the sole that bears, of Pinocchio's placements: the first, unless another is lower."""
    heights = [float(sole.translation[2]) for sole in soles]
    return heights.index(min(heights)) if min(heights) < heights[0] - LOWER else 0
