"""Rectangles in triangles of several kinds, with a straight column of vertices one cell from the left."""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

KINDS = ("right-angled", "crossed", "equilateral", "jittered", "scattered")


def rectangle(kind: str, size: tuple[float, float], cell: float, seed: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 2) [m] and faces (m, 3) of a rectangle from the origin.

    Args:
        kind: One of `KINDS`: squares cut one way; squares cut both ways; rows shifted by half a cell (equilateral to
            2 % where the width allows); the same with all inner points moved by up to 0.15 cells; points at random, at
            least 0.72 cells apart.
        size: Length and width [m].
        cell: Length of a triangle's side along the rectangle [m].
        seed: Of what is random.
    """
    nx = round(size[0] / cell)
    if kind in ("right-angled", "crossed"):
        return _squares(size, (nx, max(1, round(size[1] / cell))), crossed=kind == "crossed")
    random = np.random.default_rng(seed)
    if kind == "scattered":
        points = _scattered(size, cell, random)
    else:
        ny = max(1, round(size[1] / cell / np.sqrt(0.75)))
        points = _staggered(size, (nx, ny))
        if kind == "jittered":
            inner = (points[:, 0] > 1.1 * cell) & (points[:, 0] < size[0] - 1e-9)
            moved = random.uniform(-0.15, 0.15, points.shape) * cell * inner[:, None]
            moved[(points[:, 1] < 1e-9) | (points[:, 1] > size[1] - 1e-9), 1] = 0.0
            points = points + moved
    faces = Delaunay(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(double[:, None] > 0, faces, faces[:, ::-1])
    return points, faces[np.abs(double) > 1e-3 * cell**2]  # Delaunay fills straight rims with slivers


def _squares(size: tuple[float, float], cells: tuple[int, int], crossed: bool) -> tuple[np.ndarray, np.ndarray]:
    nx, ny = cells
    i, j = (c.ravel() for c in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="xy"))
    step = np.array([size[0] / nx, size[1] / ny])
    points = np.stack([i, j], axis=1) * step
    p, q = (c.ravel() for c in np.meshgrid(np.arange(nx), np.arange(ny), indexing="xy"))
    a = q * (nx + 1) + p
    b, c, d = a + 1, a + nx + 2, a + nx + 1
    if not crossed:
        return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    e = len(points) + np.arange(nx * ny)
    points = np.concatenate([points, (np.stack([p, q], axis=1) + 0.5) * step])
    return points, np.concatenate([np.stack(corners, 1) for corners in ((a, b, e), (b, c, e), (c, d, e), (d, a, e))])


def _staggered(size: tuple[float, float], cells: tuple[int, int]) -> np.ndarray:
    nx, ny = cells
    step = np.array([size[0] / nx, size[1] / ny])
    rows = []
    for j in range(ny + 1):
        inner = np.arange(1.5, nx) if j % 2 else np.arange(2, nx)
        x = np.r_[0.0, 1.0, inner, nx]
        rows.append(np.stack([x, np.full(len(x), j)], axis=1))
    return np.concatenate(rows) * step


def _scattered(size: tuple[float, float], cell: float, random: np.random.Generator) -> np.ndarray:
    nx, ny = round(size[0] / cell), max(1, round(size[1] / cell))
    x, y = np.linspace(0.0, size[0], nx + 1), np.linspace(0.0, size[1], ny + 1)
    points = [(p, q) for p in x for q in (0.0, size[1])] + [(p, q) for p in (0.0, x[1], size[0]) for q in y[1:-1]]
    refused = 0
    while refused < 2000:
        trial = random.uniform([x[1] + 0.4 * cell, 0.4 * cell], [size[0] - 0.4 * cell, size[1] - 0.4 * cell])
        near = np.linalg.norm(np.array(points) - trial, axis=1).min() < 0.72 * cell
        refused = refused + 1 if near else 0
        if not near:
            points.append(tuple(trial))
    return np.array(points)
