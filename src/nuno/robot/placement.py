"""Placements: Pinocchio's frames, and their poses as Nuno has them, a place and a quaternion (w, x, y, z)."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,), (w, x, y, z), of a rotation matrix (3, 3)."""
    x, y, z, w = pin.Quaternion(rotation).coeffs()
    return np.array([w, x, y, z])


def pose_of(placement: Any) -> Pose:
    """Return place (3,) [m] and unit quaternion (4,) of an SE3, copies."""
    return np.array(placement.translation), quat.unit("quaternion", quaternion_of(placement.rotation), (4,))


def frame_called(model: Any, name: str) -> int:
    """Return the index of a frame that there is; of several with one name a role's, else the link's."""
    for kind in (pin.FrameType.OP_FRAME, pin.FrameType.BODY):
        if model.existFrame(name, kind):
            return int(model.getFrameId(name, kind))
    return int(model.getFrameId(name))
