"""The field of displacements that fits what is known of a cloth's vertices, and changes least between them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags, identity, kron
from scipy.sparse.linalg import spsolve

COHERENCE = 0.3
"""Weight of the change along an edge beside what is known of a vertex: the field is smooth over some two edges."""
REST = 1e-3
"""Weight of no displacement at all, where nothing is known."""


class DisplacementField:
    """Solves for displacements of a cloth's vertices.

    Args:
        count: How many vertices.
        faces: (m, 3) int.
    """

    def __init__(self, count: int, faces: np.ndarray) -> None:
        pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        a, b = np.unique(pairs, axis=0).T
        link = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
        link = link + link.T
        laplacian = diags(np.asarray(link.sum(axis=1)).ravel()) - link
        self._smooth: csr_matrix = csr_matrix(kron(COHERENCE * laplacian + REST * identity(count), identity(3)))

    def solve(self, information: np.ndarray, residuals: np.ndarray) -> np.ndarray:
        """Return displacements (n, 3) [m].

        Args:
            information: (n, 3, 3), of each vertex's displacement.
            residuals: (n, 3) [m], the information times the displacement that it tells of.
        """
        if not residuals.any():
            return np.zeros_like(residuals)
        n = len(residuals)
        rows = np.arange(3 * n).reshape(n, 3)
        known = coo_matrix(
            (information.ravel(), (np.repeat(rows, 3, axis=1).ravel(), np.tile(rows, 3).ravel())), shape=(3 * n, 3 * n)
        )
        found: np.ndarray = spsolve((self._smooth + known).tocsc(), residuals.ravel())
        return found.reshape(n, 3)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals (n, 3) of a surface's vertices (n, 3), those of their faces (m, 3) by area; 0 where none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = faces.T.ravel()
    total = np.stack([np.bincount(flat, np.tile(across[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


def rim_directions(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return which way is inwards of each vertex (n, 3) at the border of a surface: unit vectors (n, 3), 0 within."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    opposite = np.roll(faces, -2, axis=1).ravel()
    _, index, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    border = count[index.ravel()] == 1
    ends, apex = sides[border], opposite[border]
    along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    across = vertices[apex] - vertices[ends[:, 0]]
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
    across -= along * (np.einsum("ij,ij->i", across, along) / square)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
    across *= np.sqrt(square)[:, None]
    total = np.zeros_like(vertices)
    for k in (0, 1):
        np.add.at(total, ends[:, k], across)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)
