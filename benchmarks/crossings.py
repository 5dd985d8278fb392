"""Count the pairs of an edge and a triangle of one mesh that pass through each other, sharing no vertex."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


def crossing_pairs(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Number of (edge, triangle) pairs that cross.

    Möller and Trumbore's test (1997) in double precision on all pairs whose middles are near enough.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int.
    """
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    corners = vertices[faces]
    middle, half = corners.mean(axis=1), vertices[edges].mean(axis=1)
    reach = (
        np.linalg.norm(corners - middle[:, None], axis=2).max()
        + np.linalg.norm(vertices[edges[:, 0]] - half, axis=1).max()
    )
    near = cKDTree(half).query_ball_point(middle, reach)
    t = np.repeat(np.arange(len(faces)), [len(found) for found in near])
    e = np.concatenate([np.asarray(found, dtype=int) for found in near])
    apart = ~((faces[t] == edges[e][:, :1]) | (faces[t] == edges[e][:, 1:])).any(axis=1)
    t, e = t[apart], e[apart]
    a, b, c = (vertices[faces[t, k]] for k in range(3))
    p, d = vertices[edges[e, 0]], vertices[edges[e, 1]] - vertices[edges[e, 0]]
    e1, e2 = b - a, c - a
    h = np.cross(d, e2)
    det = (e1 * h).sum(axis=1)
    inverse = 1.0 / np.where(np.abs(det) > 1e-18, det, np.inf)
    s = p - a
    u = (s * h).sum(axis=1) * inverse
    q = np.cross(s, e1)
    v = (d * q).sum(axis=1) * inverse
    w = (e2 * q).sum(axis=1) * inverse
    inside = (u > 1e-9) & (v > 1e-9) & (u + v < 1 - 1e-9) & (w > 1e-9) & (w < 1 - 1e-9)
    return int(inside.sum())
