"""Tetrahedra relaxed towards given shapes while their boundary stays on a surface."""

from __future__ import annotations

import numpy as np

from nuno.mesh.surface_targets import FREE, SurfaceTargets
from nuno.mesh.tetrahedra import boundary_by_element, boundary_faces, volumes

ITERATIONS = 20
DEEP = 3
"""Edges from the boundary at which vertices stay where they are in the lattice: its voxels have the same numbers, which
are stored once."""
ATTEMPTS, AGAIN = 12, 5
"""Rounds in which vertices of flat tetrahedra are let off their corner, edge or face, and the iterations after each."""
MIN_HEIGHT, WORST_HEIGHT = 0.3, 0.1
"""Smallest height of a tetrahedron, in the shortest edge of a voxel, that is aimed at, and that is accepted; 0.58 in
a lattice."""


def relaxed(
    rest: np.ndarray, start: np.ndarray, tets: np.ndarray, targets: SurfaceTargets, edge: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Relax vertices by shape matching (Mueller et al. 2005).

    Each tetrahedron pulls its corners towards its own shape in the lattice, turned and scaled to fit best, the more
    the worse its shape is; then the vertices go back to their places on the surface. A tetrahedron that remains flat
    is left out where all its corners and a face of it are on the surface; otherwise its corners are let off what they
    are bound to.

    Args:
        rest: (n, 3) [m], the vertices in the lattice.
        start: (n, 3) [m], where they start.
        tets: (m, 4) int.
        targets: What the vertices are bound to.
        edge: Shortest edge of a voxel [m].

    Returns:
        The vertices (n, 3) [m] and the tetrahedra that stay (k, 4); None where some cannot be made better than
        `WORST_HEIGHT`.
    """
    shape = rest[tets] - rest[tets].mean(axis=1, keepdims=True)
    shape /= np.linalg.norm(shape, axis=(1, 2), keepdims=True)
    whole = np.cbrt(_volume(shape))
    deep = _deep(tets, len(rest))
    placed = _iterated(start, tets, shape, whole, targets, deep, ITERATIONS)
    for _ in range(ATTEMPTS):
        low = heights(placed, tets) < MIN_HEIGHT * edge
        if not low.any():
            break
        skin = low & (targets.kind[tets] != FREE).all(axis=1)
        skin &= np.isin(np.arange(len(tets)), boundary_by_element(tets)[1])
        targets = targets.loosened(np.unique(tets[low & ~skin]))
        tets, shape, whole = tets[~skin], shape[~skin], whole[~skin]
        placed = _iterated(placed, tets, shape, whole, targets, deep, AGAIN)
    return (placed, tets) if heights(placed, tets).min(initial=np.inf) > WORST_HEIGHT * edge else None


def heights(vertices: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return (m,) [m], the smallest height of each tetrahedron, negative where it is inside out."""
    a, b, c, d = (vertices[tets[:, corner]] for corner in range(4))
    faces = ((a, b, c), (a, b, d), (a, c, d), (b, c, d))
    area = np.max([np.linalg.norm(np.cross(q - p, r - p), axis=1) for p, q, r in faces], axis=0)
    return 6.0 * volumes(vertices, tets) / np.maximum(area, 1e-300)


def _iterated(
    placed: np.ndarray, tets: np.ndarray, shape: np.ndarray, whole: np.ndarray, targets: SurfaceTargets,
    deep: np.ndarray, count: int,
) -> np.ndarray:  # fmt: skip
    """Return the vertices after ``count`` iterations; ``shape`` (m, 4, 3) has the norm 1, ``whole`` is its size."""
    near = ~deep[tets].all(axis=1)
    tets, shape, whole = tets[near], shape[near], whole[near]
    flat = tets.ravel()
    for _ in range(count):
        corners = placed[tets]
        centre = corners.mean(axis=1, keepdims=True)
        about = corners - centre
        u, s, vt = np.linalg.svd(np.swapaxes(about, 1, 2) @ shape)
        side = np.sign(np.linalg.det(u @ vt))
        u[:, :, 2] *= side[:, None]
        s[:, 2] *= side
        goal = centre + s.sum(axis=1)[:, None, None] * (shape @ np.swapaxes(u @ vt, 1, 2))
        # the mean ratio (Liu and Joe 1994), 1 in the lattice's shape; inside out it is as bad as can be
        quality = (np.cbrt(np.maximum(_volume(about), 0.0)) / whole) ** 2 / (about**2).sum(axis=(1, 2))
        weight = 1.0 / np.maximum(quality, 0.05)
        total = np.bincount(flat, np.repeat(weight, 4), minlength=len(placed))
        pulled = [np.bincount(flat, (weight[:, None] * goal[..., k]).ravel(), minlength=len(placed)) for k in range(3)]
        stay = deep | (total == 0.0)
        pulled_to = np.stack(pulled, axis=1) / np.maximum(total, 1e-300)[:, None]
        placed = targets.place(np.where(stay[:, None], placed, pulled_to))
    return placed


def _deep(tets: np.ndarray, count: int) -> np.ndarray:
    """Return (count,) bool, the vertices that are at least `DEEP` edges from the boundary."""
    near = np.zeros(count, dtype=bool)
    near[boundary_faces(tets)] = True
    for _ in range(DEEP - 1):
        near[tets[near[tets].any(axis=1)]] = True
    return ~near


def _volume(corners: np.ndarray) -> np.ndarray:
    return np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
