"""Stance: where the base of a robot goes when its legs move and its feet stay on the ground."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

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
    """

    def __init__(self, robot: Humanoid) -> None:
        self._robot, model = robot, robot.model
        self._frames = [robot.frame_index(foot) for foot in robot.description.feet]
        self._joints = [int(model.frames[frame].parentJoint) for frame in self._frames]
        self._rows = [np.array([j - 2 for j in model.supports[joint] if j >= 2], dtype=int) for joint in self._joints]

    def base(self, present: np.ndarray, motion: Motion) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]] | None:
        """Return where the base goes and how it moves, None where it stays.

        Args:
            present: (n,) angles that the robot has now [rad; m for slides].
            motion: Positions, velocities and accelerations (n,) that the joints are about to have.

        Returns:
            Position and quaternion (x, y, z, w) of the base (7,), and its velocity and acceleration (6,) each in its
            own frame.
        """
        robot, (positions, velocities, accelerations) = self._robot, motion
        moving = (positions != present) | (velocities != 0.0) | (accelerations != 0.0)
        if not any([moving[rows].any() for rows in self._rows]):
            return None
        places = robot.update().oMf
        heights = np.array([places[frame].translation[2] for frame in self._frames])
        k = int(heights.argmin()) if heights.min() < heights[0] - LOWER else 0
        if not moving[self._rows[k]].any():
            return None
        model, data = robot.model, robot.scratch
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[6:], a[6:] = velocities, accelerations
        pin.forwardKinematics(model, data, robot.configuration_of(positions, np.eye(7)[6]), v, a)
        # seen from the base the foot moves; as it stands, the base moves against that
        carrier, frame = data.oMi[self._joints[k]], model.frames[self._frames[k]]
        placed = places[self._frames[k]] * (carrier * frame.placement).inverse()
        own = carrier.act(data.v[self._joints[k]]), carrier.act(data.a[self._joints[k]])
        return pin.SE3ToXYZQUAT(placed), (-own[0].vector, -own[1].vector)
