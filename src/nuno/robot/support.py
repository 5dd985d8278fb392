"""Support: the outline of soles, how far inside a point is, the zero moment point."""

from __future__ import annotations

import numpy as np


def convex_outline(points: np.ndarray) -> np.ndarray:
    """Return the corners (k, 2) of the convex hull of points (n, 2), counterclockwise (Andrew 1979)."""
    ordered = sorted(set(map(tuple, points.tolist())))
    chains = []
    for sweep in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for point in sweep:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains += chain[:-1]
    return np.array(chains)


def edges_of(outline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return outward normals (k, 2) and offsets (k,) [m] of a counterclockwise outline: inside is n p <= offset."""
    normals = np.empty(outline.shape)
    normals[:-1, 0], normals[-1, 0] = outline[1:, 1] - outline[:-1, 1], outline[0, 1] - outline[-1, 1]
    normals[:-1, 1], normals[-1, 1] = outline[:-1, 0] - outline[1:, 0], outline[-1, 0] - outline[0, 0]
    normals /= np.sqrt(normals[:, :1] ** 2 + normals[:, 1:] ** 2)
    return normals, normals[:, 0] * outline[:, 0] + normals[:, 1] * outline[:, 1]


def distance_inside(outline: np.ndarray, point: np.ndarray) -> float:
    """Return how far a point (2,) is from the nearest edge [m], negative outside."""
    normals, offsets = edges_of(outline)
    return float((offsets - normals @ point).min())


def zero_moment_point(force: np.ndarray, torque: np.ndarray, height: float) -> np.ndarray:
    """Return where (2,) [m] in the plane z = height the moment of a ground reaction is upright; NaN without one.

    Args:
        force: (3,) [N].
        torque: (3,) [N m], about the world's origin.
        height: [m].
    """
    along_x, along_y, upward = force.tolist()
    about_x, about_y, _ = torque.tolist()
    if not upward > 1e-9:
        return np.full(2, np.nan)
    return np.array([height * along_x - about_y, about_x + height * along_y]) / upward


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
