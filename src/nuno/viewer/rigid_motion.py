"""Rigid motion of vertices: whether they moved as one thing, and how."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

RIGID = 1e-5  # [m] from the places that a rigid motion gives: what float32 solvers make of a rigid body


def rigid_motion(points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return vertices in a frame of their own, and that frame's poses; or the first frame, and None if they deformed.

    The best rotation is that of Kabsch (1976).

    Args:
        points: (t, n, 3) float [m].

    Returns:
        (n, 3) float [m], and (t, 7) float32: position [m] and quaternion (w, x, y, z); or None.
    """
    centres = points.mean(axis=1)
    local = points[0] - centres[0]
    away = points - centres[:, None]
    left, _, right = np.linalg.svd(np.einsum("tni,nj->tij", away, local))
    mirror = np.sign(np.linalg.det(left @ right))
    left[..., -1] *= mirror[:, None]
    turns = left @ right
    if np.abs(np.einsum("tij,nj->tni", turns, local) - away).max() > RIGID:
        return points[0], None
    x, y, z, w = Rotation.from_matrix(turns).as_quat().T
    return local, np.column_stack([centres, w, x, y, z]).astype(np.float32)
