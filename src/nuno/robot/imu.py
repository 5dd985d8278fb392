"""The inertial measurement unit: how a frame is turned, how it spins, and what accelerates it but gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.ground import moment
from nuno.robot.pinocchio import pin

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid


class InertialUnit:
    """An inertial measurement unit in a frame.

    Args:
        robot: The robot.
        frame: The frame's name.
        data: Pinocchio's, from which it reads what ``rnea`` has left there.
    """

    def __init__(self, robot: Humanoid, frame: str, data: Any) -> None:
        own = robot.model.frames[robot.frame_index(frame)]
        self._carrier, self._placement = data.oMi[own.parentJoint], own.placement.copy()
        self._into = self._placement.inverse().toActionMatrix()  # motions from the joint's frame
        # of the joint; what rnea calls its acceleration is less gravity
        self._velocity, self._acceleration = data.v[own.parentJoint].vector, data.a_gf[own.parentJoint].vector

    def read(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what it measures, after ``rnea`` and with the joints' placements in the world.

        Returns:
            Orientation (4,), (w, x, y, z) in the world; angular velocity (3,) [rad/s]; and specific force (3,) [m/s2]:
            acceleration less gravity. The last two are in the frame's own axes.
        """
        turn = pin.SE3ToXYZQUAT(self._carrier * self._placement)[[6, 3, 4, 5]]
        velocity = self._into @ self._velocity
        spin = velocity[3:]
        return turn, spin, (self._into @ self._acceleration)[:3] + moment(spin, velocity[:3])
