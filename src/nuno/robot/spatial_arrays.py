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
