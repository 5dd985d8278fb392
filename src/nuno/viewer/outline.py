"""Outlines: the edges with which a surface is drawn, so that it is seen before another of its colour."""

from __future__ import annotations

import numpy as np

CREASE = 35.0  # [deg] between faces, above which an edge of a solid is drawn sharp


def outline(points: np.ndarray, triangles: np.ndarray, crease: float | None) -> np.ndarray:
    """Return the edges of a surface that belong to its outline, (2 k,) uint32: its border, and its sharp edges.

    Args:
        points: (n, 3) [m].
        triangles: (m, 3).
        crease: [deg] between two faces, above which their edge is sharp; None draws the border alone.
    """
    if not len(triangles):
        return np.empty(0, np.uint32)
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.sort(np.asarray(triangles)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    face = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, face = edges[order], face[order]
    begins = np.flatnonzero(np.r_[True, (edges[1:] != edges[:-1]).any(axis=1)])
    counts = np.diff(np.r_[begins, len(edges)])
    chosen = counts == 1
    if crease is not None:
        pair = counts == 2
        a, b = face[begins[pair]], face[begins[pair] + 1]
        chosen[pair] = np.einsum("kx,kx->k", normals[a], normals[b]) < np.cos(np.radians(crease))
    return edges[begins[chosen]].astype(np.uint32).ravel()
