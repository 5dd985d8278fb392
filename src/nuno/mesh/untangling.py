"""Take the triangles of a mesh apart that pass through each other.

Where two parts of a cloth pass through each other, triangles meet along lines. Each edge that pierces a triangle is
drawn, and the triangle pushed, in the direction in which these lines become shorter, until there are none: Volino and
Magnenat-Thalmann, Resolving surface collisions through intersection contour minimization, 2006, section 3.
"""

from __future__ import annotations

import numpy as np

from nuno.mesh.crossings import crossing_faces

ITERATIONS = 60
"""Rounds at most."""
STEPS = (1.0, 0.5, 0.25)
"""Of the longest step, by turns: steps of one length may go to and fro."""
SHORT = 0.2
"""Lengths of a gradient, which is 2 where a line is met head-on by both faces of an edge, below which moves are short:
it is about to turn round."""

FLAT = 0.05
"""Sine of the angle between an edge and a triangle that it pierces, below which it counts as so much."""


def untangle(vertices: np.ndarray, faces: np.ndarray, free: np.ndarray, step: float) -> tuple[np.ndarray, int]:
    """Return vertices (n, 3) [m] with fewer pairs of faces that pass through each other, and how many there are left.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int.
        free: (n,) bool, the vertices that may move.
        step: How far a vertex moves at once at most [m].
    """
    best = moved = np.array(vertices, dtype=float)
    pairs = crossing_faces(best, faces)
    left, faces_at = len(pairs), _faces_of_edges(faces)
    for iteration in range(ITERATIONS if left else 0):
        moved = moved + step * STEPS[iteration % len(STEPS)] * _ways(moved, faces, pairs, faces_at, free)
        pairs = crossing_faces(moved, faces)
        if len(pairs) <= left:
            best, left = moved, len(pairs)
        if not len(pairs):
            break
    return best, left


def _ways(
    x: np.ndarray, faces: np.ndarray, pairs: np.ndarray, faces_at: dict[tuple[int, int], list[int]], free: np.ndarray
) -> np.ndarray:
    """Return (n, 3), where each vertex is to go: at most 1 long."""
    edges, through, shares, normals = _pierced(x, faces, pairs)
    along = _unit(x[edges[:, 1]] - x[edges[:, 0]])
    ahead = _dot(along, normals)
    steep = np.copysign(np.maximum(np.abs(ahead), FLAT), ahead)
    gradient = np.zeros_like(along)
    for k, (a, b) in enumerate(edges.tolist()):
        for face in faces_at[a, b]:
            corner = x[next(v for v in faces[face] if v not in (a, b))] - x[a]
            own = np.cross(along[k], corner)
            line = np.cross(own, normals[k])
            size = float(np.linalg.norm(line))
            if size > 1e-12 * float(np.linalg.norm(own)):
                # where the edge's face meets the triangle, from the edge into the face
                line *= np.sign(line @ np.cross(own, along[k])) / size
                gradient[k] += line - 2.0 * (along[k] @ line) / steep[k] * normals[k]
    ways = gradient / np.sqrt(_dot(gradient, gradient) + SHORT**2)[:, None]
    total, count = np.zeros_like(x), np.zeros(len(x))
    # an edge goes one way and the triangle the other, each vertex by its share in the point where they meet
    for vertex, share in zip((*edges.T, *faces[through].T), (*shares[:, :2].T, *-shares[:, 2:].T), strict=True):
        np.add.at(total, vertex, share[:, None] * ways)
        np.add.at(count, vertex, np.abs(share))
    return np.where(free[:, None], total / np.maximum(count, 1e-12)[:, None], 0.0)


def _pierced(x: np.ndarray, faces: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, ...]:
    """Find the edges that pass through faces among pairs of them.

    Returns:
        The edges (k, 2), the faces (k,) that they pass through, the shares (k, 5) of the edge's ends and the face's
        corners in the point where they meet, and the faces' normals (k, 3).
    """
    rows = [
        np.column_stack([np.sort(faces[pairs[:, one]][:, [a, b]], axis=1), pairs[:, other]])
        for one, other in ((0, 1), (1, 0))
        for a, b in ((0, 1), (1, 2), (2, 0))
    ]
    found = np.unique(np.concatenate(rows), axis=0)
    edges, through = found[:, :2], found[:, 2]
    a, b, c = (x[faces[through, corner]] for corner in range(3))
    normal = _unit(np.cross(b - a, c - a))
    start, end = _dot(x[edges[:, 0]] - a, normal), _dot(x[edges[:, 1]] - a, normal)
    apart = ~(edges[:, :, None] == faces[through][:, None, :]).any(axis=(1, 2))
    kept = np.flatnonzero((start * end < 0.0) & apart)
    edges, through, normal, a, b, c = (array[kept] for array in (edges, through, normal, a, b, c))
    part = start[kept] / (start[kept] - end[kept])
    met = x[edges[:, 0]] + part[:, None] * (x[edges[:, 1]] - x[edges[:, 0]])
    areas = np.stack([_dot(np.cross(v - u, met - u), normal) for u, v in ((b, c), (c, a), (a, b))], axis=1)
    inside = np.flatnonzero((areas > 0.0).all(axis=1))
    shares = np.column_stack([1.0 - part, part, areas / areas.sum(axis=1, keepdims=True)])
    return edges[inside], through[inside], shares[inside], normal[inside]


def _faces_of_edges(faces: np.ndarray) -> dict[tuple[int, int], list[int]]:
    faces_at: dict[tuple[int, int], list[int]] = {}
    for k, (a, b, c) in enumerate(faces.tolist()):
        for edge in ((a, b), (b, c), (c, a)):
            faces_at.setdefault((min(edge), max(edge)), []).append(k)
    return faces_at


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1)
