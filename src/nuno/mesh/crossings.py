"""Crossings of a mesh with itself: triangles that pass through each other."""

from __future__ import annotations

import numpy as np

BITS = 10  # of a coordinate in the order of triangles along a Z-curve
TOUCH = 1e-6  # of the mesh's extent: what passes through by less is rounding, of coordinates that files keep in float32


def crossing_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (c, 2) int, the pairs of faces of which an edge of one passes through the inside of the other.

    Faces that only touch, to a millionth of the mesh's extent, and edges that meet the other face in a common vertex do
    not count.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int.
    """
    corners = vertices[faces]
    touch = TOUCH * float(np.ptp(vertices, axis=0).max())
    found: list[np.ndarray] = []
    pairs = _overlapping_boxes(corners.min(axis=1), corners.max(axis=1))
    for batch in np.array_split(pairs, max(1, len(pairs) // 200_000)):
        crosses = np.zeros(len(batch), dtype=bool)
        for edges_of, through in ((0, 1), (1, 0)):
            for a, b in ((0, 1), (1, 2), (2, 0)):
                edge = faces[batch[:, edges_of]][:, [a, b]]
                crosses |= _passes(vertices, edge, faces[batch[:, through]], touch)
        found.append(batch[crosses])
    return np.concatenate(found)


def _passes(vertices: np.ndarray, edges: np.ndarray, triangles: np.ndarray, touch: float) -> np.ndarray:
    """Return (k,) bool, whether each edge passes through its triangle, by more than ``touch`` [m] on all sides."""
    p, q = vertices[edges[:, 0]], vertices[edges[:, 1]]
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    apart = ~(edges[:, :, None] == triangles[:, None, :]).any(axis=(1, 2))
    normal = np.cross(b - a, c - a)
    start, end = _dot(p - a, normal), _dot(q - a, normal)
    deep = touch * np.linalg.norm(normal, axis=1)
    through = (np.minimum(start, end) < -deep) & (np.maximum(start, end) > deep)
    # The line of the edge passes the triangle's sides all on one hand: the volumes that it spans with them agree.
    along = q - p
    sides = np.stack([_dot(np.cross(u - p, v - p), along) for u, v in ((a, b), (b, c), (c, a))])
    lengths = np.stack([np.linalg.norm(v - u, axis=1) for u, v in ((a, b), (b, c), (c, a))])
    margin = touch * lengths * np.linalg.norm(along, axis=1)
    return apart & through & ((sides > margin).all(axis=0) | (sides < -margin).all(axis=0))


def _overlapping_boxes(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (p, 2) int, pairs i, j of boxes that overlap or touch, from a tree of boxes, level by level."""
    order = _along_curve(0.5 * (low + high))
    leaves = 1 << max(0, int(len(low) - 1).bit_length())
    lower, upper = np.full((leaves, 3), np.inf), np.full((leaves, 3), -np.inf)
    lower[: len(low)], upper[: len(low)] = low[order], high[order]
    levels = [(lower, upper)]
    while len(levels[-1][0]) > 1:
        below = levels[-1]
        levels.append((below[0].reshape(-1, 2, 3).min(axis=1), below[1].reshape(-1, 2, 3).max(axis=1)))
    i = j = np.zeros(1, dtype=np.int64)
    for lower, upper in levels[-2::-1]:
        # children of i and j; of a node with itself, the pair in the wrong order falls away
        i, j = (np.concatenate([2 * i, 2 * i, 2 * i + 1, 2 * i + 1]), np.concatenate([2 * j, 2 * j + 1] * 2))
        near = (i <= j) & (lower[i] <= upper[j]).all(axis=1) & (lower[j] <= upper[i]).all(axis=1)
        i, j = i[near], j[near]
    different = i < j
    return np.sort(np.stack([order[i[different]], order[j[different]]], axis=1), axis=1)


def _along_curve(points: np.ndarray) -> np.ndarray:
    """Return the order of points along a Z-curve, in which neighbours stay together."""
    extent = np.ptp(points, axis=0)
    scaled = (points - points.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    grid = np.minimum(scaled * (1 << BITS), (1 << BITS) - 1).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(BITS):
        for axis in range(3):
            code |= (grid[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1)
