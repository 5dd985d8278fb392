"""Spatial arrays: Pinocchio's vectors of placements, motions and forces, seen as NumPy arrays of the same memory.

Taking numbers out of them one by one costs more than the dynamics themselves. What is written into an array is what
Pinocchio has from then on, and the other way round. An array must not outlive the vector that it is of.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np


def placement_arrays(placements: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotation matrices (n, 3, 3) and the places (n, 3) [m] of n placements."""
    return _joined(own.rotation for own in placements), _joined(own.translation for own in placements)


def quaternions_of(rotations: np.ndarray) -> np.ndarray:
    """Return the quaternions (..., 4), (x, y, z, w), of rotation matrices (..., 3, 3), to the bit as Pinocchio does.

    By the largest of the trace and the diagonal (Shepperd, Journal of Guidance and Control 1, 1978), in Eigen's order.
    """
    m = np.moveaxis(rotations, (-2, -1), (0, 1))
    trace = m[0, 0] + (m[1, 1] + m[2, 2])
    found = np.empty((*trace.shape, 4))
    by_trace = trace > 0.0
    root = np.sqrt(np.where(by_trace, trace, 0.0) + 1.0)
    found[..., 3], scale = 0.5 * root, 0.5 / root
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        found[..., i] = (m[k, j] - m[j, k]) * scale
    if by_trace.all():
        return found
    axis = np.where(m[1, 1] > m[0, 0], 1, 0)
    axis = np.where(m[2, 2] > np.where(axis == 1, m[1, 1], m[0, 0]), 2, axis)
    for i in range(3):
        own = ~by_trace & (axis == i)
        if own.any():
            j, k = (i + 1) % 3, (i + 2) % 3
            root = np.sqrt(m[i, i][own] - m[j, j][own] - m[k, k][own] + 1.0)
            scale = 0.5 / root
            part = np.empty((len(root), 4))
            part[:, i], part[:, 3] = 0.5 * root, (m[k, j][own] - m[j, k][own]) * scale
            part[:, j], part[:, k] = (m[j, i] + m[i, j])[own] * scale, (m[k, i] + m[i, k])[own] * scale
            found[own] = part
    return found


def spatial_array(quantities: Any) -> np.ndarray:
    """Return n motions or forces as (n, 6): along the axes, then about them."""
    return _joined(own.vector for own in quantities)


def _joined(parts: Iterable[np.ndarray]) -> np.ndarray:
    """Return arrays that lie one after the other in memory, at equal distances, as one."""
    views = list(parts)
    places = [view.__array_interface__["data"][0] for view in views]
    step = (places[-1] - places[0]) // max(len(views) - 1, 1)
    assert places == [places[0] + k * step for k in range(len(views))], "a C++ vector lies in one piece"
    first = views[0]
    return np.lib.stride_tricks.as_strided(first, (len(views), *first.shape), (step, *first.strides))
