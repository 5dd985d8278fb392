"""Exact tests between the elements of one cloth, by brute force."""

import numpy as np


def edges_of(faces: np.ndarray) -> np.ndarray:
    """Return the (e, 2) edges of triangles (m, 3)."""
    half = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(half, axis=1), axis=0)


def count_crossings(x: np.ndarray, faces: np.ndarray) -> int:
    """Return how many pairs of an edge and a triangle without a common vertex pass through each other."""
    edges = edges_of(faces)
    p, q = x[edges[:, 0]], x[edges[:, 1]]
    low, high = np.minimum(p, q), np.maximum(p, q)
    count = 0
    for face in faces:
        corners = x[face]
        near = ((low <= corners.max(axis=0)) & (high >= corners.min(axis=0))).all(axis=1)
        near &= ~np.isin(edges, face).any(axis=1)
        if not near.any():
            continue
        a, b, c = corners
        normal = np.cross(b - a, c - a)
        start, end = (p[near] - a) @ normal, (q[near] - a) @ normal
        through = start * end < 0
        part = start[through] / (start[through] - end[through])
        y = p[near][through] + part[:, None] * (q[near][through] - p[near][through])
        inside = [np.cross(w - v, y - v) @ normal > 0 for v, w in ((a, b), (b, c), (c, a))]
        count += int(np.all(inside, axis=0).sum())
    return count


def vertex_triangle_distances(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (n, m) distances [m] of all vertices from all triangles."""
    a, b, c = (x[faces[:, k]] for k in range(3))
    r = x[:, None] - a
    e, f = b - a, c - a
    normal = np.cross(e, f)
    nn = (normal**2).sum(axis=1)
    v = (np.cross(r, f) * normal).sum(axis=-1) / nn
    w = (np.cross(e[None], r) * normal).sum(axis=-1) / nn
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    plane = np.abs((r * normal).sum(axis=-1)) / np.sqrt(nn)

    def to_segment(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        d = q - p
        t = np.clip(((x[:, None] - p) * d).sum(axis=-1) / (d * d).sum(axis=-1), 0, 1)
        return np.linalg.norm(x[:, None] - p - t[..., None] * d, axis=-1)

    return np.where(inside, plane, np.minimum(np.minimum(to_segment(a, b), to_segment(b, c)), to_segment(c, a)))


def edge_edge_distances(x: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return (e, e) distances [m] between all edges."""
    p, d = x[edges[:, 0]], x[edges[:, 1]] - x[edges[:, 0]]
    r = p[:, None] - p[None]
    aa = (d * d).sum(axis=1)
    ab = d @ d.T
    ar, br = np.einsum("ik,ijk->ij", d, r), np.einsum("jk,ijk->ij", d, r)
    best = np.full(ab.shape, np.inf)
    det = aa[:, None] * aa[None] - ab**2
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(det > 1e-12 * aa[:, None] * aa[None], (ab * br - ar * aa[None]) / det, 0.0)
    for first in (np.clip(s, 0, 1), np.zeros_like(s), np.ones_like(s)):
        q = np.clip((ab * first + br) / aa[None], 0, 1)
        t = np.clip((ab * q - ar) / aa[:, None], 0, 1)
        gap = r + t[..., None] * d[:, None] - q[..., None] * d[None]
        best = np.minimum(best, np.linalg.norm(gap, axis=-1))
    return best
