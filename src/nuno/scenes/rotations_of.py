"""Quaternions of rotation matrices."""

from __future__ import annotations

import numpy as np


def quaternion_from(matrix: np.ndarray) -> np.ndarray:
    """Return the quaternion (w, x, y, z) of a rotation matrix (3, 3), with w at least 0."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(matrix).as_quat()
    found = np.array([w, x, y, z])
    return -found if w < 0.0 else found
