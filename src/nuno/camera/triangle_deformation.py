"""The energy of a triangle that is mapped onto another: the logarithm of how unlike its two stretches are."""

from __future__ import annotations

import numpy as np

SCALE_WEIGHT = 1.0
"""What a change of area costs beside a change of form, where the size is known."""


def to_unit(corners: np.ndarray) -> np.ndarray:
    """(2, 2) float, the inverse of the edges of a triangle (3, 2) from its first corner, as columns."""
    return np.linalg.inv(np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1))


def deformation(unit: np.ndarray, first: np.ndarray, second: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """Return the energy of affine maps of a triangle: log^2(a / b) + SCALE_WEIGHT log^2(sqrt(a b) / scale).

    a and b are the map's singular values. The first term is Felzenszwalb's log-anisotropy, which no similarity changes;
    the second holds the size where that is known.

    Args:
        unit: (2, 2) of ``to_unit``.
        first: (..., 2) where the edge from the first corner to the second goes.
        second: (..., 2) where that to the third one goes.
        scale: By how much lengths are to be longer.

    Returns:
        (...,) float32; inf where the triangle is turned over or has no area.
    """
    first, second = np.asarray(first, dtype=np.float32), np.asarray(second, dtype=np.float32)
    u = unit.astype(np.float32)
    a = first[..., 0] * u[0, 0] + second[..., 0] * u[1, 0]
    b = first[..., 0] * u[0, 1] + second[..., 0] * u[1, 1]
    c = first[..., 1] * u[0, 0] + second[..., 1] * u[1, 0]
    d = first[..., 1] * u[0, 1] + second[..., 1] * u[1, 1]
    even, odd = np.hypot(a + d, c - b), np.hypot(a - d, b + c)  # the singular values are half their sum and difference
    large, small = 0.5 * (even + odd), 0.5 * (even - odd)
    good = (a * d - b * c > 0) & (small > 1e-3 * scale)
    small = np.where(good, small, 1.0)
    large = np.where(good, large, 1.0)
    form = np.log(large / small)
    size = 0.5 * np.log(large * small / np.float32(scale * scale))
    energy = form * form + np.float32(SCALE_WEIGHT) * size * size
    return np.where(good, energy, np.float32(np.inf))
