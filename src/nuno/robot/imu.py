"""The inertial measurement unit: how a frame is turned, how it spins, and what accelerates it but gravity."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin


def read_imu(model: Any, data: Any, frame: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what an IMU in a frame measures.

    Args:
        model: Pinocchio's model.
        data: Its data after forward kinematics of second order.
        frame: Index of the frame.

    Returns:
        Orientation (4,), (w, x, y, z) in the world; angular velocity (3,) [rad/s]; and specific force (3,) [m/s2]:
        acceleration less gravity. The last two are in the frame's own axes.
    """
    placement = pin.updateFramePlacement(model, data, frame)
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    spin = pin.getFrameVelocity(model, data, frame, pin.LOCAL).angular
    moved = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL).linear
    return np.array([w, x, y, z]), np.array(spin), moved - placement.rotation.T @ model.gravity.linear
