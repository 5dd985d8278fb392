"""The triangles of a sheet's flex, whose diagonals alternate, so that bending is alike along both diagonals."""

from __future__ import annotations

import numpy as np


def sheet_triangles(nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles (m, 3) of a sheet's cells, and the cell of each (m,)."""
    i, j = np.meshgrid(np.arange(nx), np.arange(ny))
    a = (j * (nx + 1) + i).ravel()
    b, c, d = a + 1, a + nx + 1, a + nx + 2
    even = (((i + j) % 2) == 0).ravel()
    first = np.where(even[:, None], np.stack([a, b, d], 1), np.stack([a, b, c], 1))
    second = np.where(even[:, None], np.stack([a, d, c], 1), np.stack([b, d, c], 1))
    return np.stack([first, second], axis=1).reshape(-1, 3), np.repeat(np.arange(nx * ny), 2)
