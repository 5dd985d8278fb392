"""Polygons in the plane: area, length, points inside, corners, and points along the outline."""

from __future__ import annotations

import numpy as np

CORNER_ANGLE = 0.6
"""[rad] A corner that turns by more than this is one of the shape, not of how finely its outline was drawn."""


def signed_area(polygon: np.ndarray) -> float:
    """Return the area [m2] inside a polygon (n, 2) [m], positive where it runs anticlockwise."""
    x, y = np.asarray(polygon, dtype=float).T
    x, y = x - x[0], y - y[0]
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def perimeter(polygon: np.ndarray) -> float:
    """Return the length [m] of a polygon's outline (n, 2) [m]."""
    return float(np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1).sum())


def contains(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (k,) bool, which points (k, 2) are inside a polygon (n, 2), by crossings of a ray along x."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    y = points[:, 1, None]
    crosses = (a[:, 1] <= y) != (b[:, 1] <= y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return np.asarray((crosses & (at > points[:, :1])).sum(axis=1) % 2 == 1)


def distance_to_outline(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (k,) [m], how far points (k, 2) are from the nearest point of a polygon's outline (n, 2)."""
    a, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    offset = points[:, None] - a
    part = np.clip((offset * along).sum(axis=2) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - part[..., None] * along, axis=2).min(axis=1))


def turns(polygon: np.ndarray) -> np.ndarray:
    """Return (n,) [rad], by how much a polygon (n, 2) turns at each corner, to the left positive."""
    ahead = np.roll(polygon, -1, axis=0) - polygon
    behind = np.roll(ahead, 1, axis=0)
    across = behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0]
    return np.asarray(np.arctan2(across, (behind * ahead).sum(axis=1)))


def corners_of(polygon: np.ndarray, corner_angle: float = CORNER_ANGLE) -> np.ndarray:
    """Return (c,) int, the corners at which a polygon (n, 2) turns sharply."""
    return np.flatnonzero(np.abs(turns(polygon)) > corner_angle)


def crosses_itself(polygon: np.ndarray) -> bool:
    """Return True if two sides of a polygon (n, 2) that are no neighbours pass through each other."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    n = len(polygon)
    touch = 1e-12 * float(np.ptp(polygon, axis=0).max()) ** 2  # points of one line are on it but for rounding

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    one, other = side(a[:, None], b[:, None], a[None]), side(a[:, None], b[:, None], b[None])
    apart = (np.minimum(one, other) < -touch) & (np.maximum(one, other) > touch)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    far = (i != j) & ((i + 1) % n != j) & ((j + 1) % n != i)
    return bool((apart & apart.T & far).any())


def along_line(line: np.ndarray, spacing: float) -> np.ndarray:
    """Return points (k, 2) along an open line (n, 2), its ends among them, evenly at about a spacing [m]."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    places = np.linspace(0.0, at[-1], max(1, round(float(at[-1]) / spacing)) + 1)
    points = np.stack([np.interp(places, at, line[:, k]) for k in range(2)], axis=1)
    points[0], points[-1] = line[0], line[-1]
    return points


def along_outline(polygon: np.ndarray, spacing: float, corner_angle: float = CORNER_ANGLE) -> np.ndarray:
    """Return points (k, 2) along a polygon's outline, evenly at about a spacing [m] between its sharp corners.

    The sharp corners are among them. An outline without one begins at its first point.
    """
    ends = corners_of(polygon, corner_angle)
    ends = np.array([0]) if len(ends) == 0 else ends
    points = []
    for k, first in enumerate(ends):
        last = ends[(k + 1) % len(ends)]
        count = (last - first - 1) % len(polygon) + 1
        part = polygon[(first + np.arange(count + 1)) % len(polygon)]
        if len(ends) == 1 and perimeter(polygon) < 3.0 * spacing:
            spacing = perimeter(polygon) / 3.0
        points.append(along_line(part, spacing)[:-1])
    return np.concatenate(points)


def staggered(low: np.ndarray, high: np.ndarray, spacing: float) -> np.ndarray:
    """Return points (k, 2) in rows, each row shifted by half a spacing [m], that fill a box and are symmetric in x."""
    height = spacing * np.sqrt(0.75)
    rows = np.arange(np.ceil((high[1] - low[1]) / height) + 1)
    middle = 0.5 * (low + high)
    half = int(np.ceil(0.5 * (high[0] - low[0]) / spacing)) + 1
    points = []
    for row in rows:
        x = (np.arange(-half, half + 1) if row % 2 == 0 else np.arange(-half, half) + 0.5) * spacing
        y = middle[1] + (row - rows[-1] / 2) * height
        points.append(np.stack([middle[0] + x, np.full(len(x), y)], axis=1))
    return np.concatenate(points)
