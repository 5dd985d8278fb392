"""The field of displacements that fits what is known of a cloth's vertices, and changes least between them."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

COHERENCE = 0.3
"""Weight of the change along an edge beside what is known of a vertex: the field is smooth over some two edges."""
REST = 1e-3
"""Weight of no displacement at all, where nothing is known."""


class DisplacementField:
    """Solves for displacements of a cloth's vertices.

    The equations are a band, once the vertices are ordered by Cuthill and McKee ("Reducing the bandwidth of sparse
    symmetric matrices", 1969), and solved by a band's Cholesky factors.

    Args:
        count: How many vertices.
        faces: (m, 3) int.
    """

    def __init__(self, count: int, faces: np.ndarray) -> None:
        pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        a, b = np.unique(pairs, axis=0).T
        link = csr_matrix(coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count)))
        self._order = reverse_cuthill_mckee(link + link.T, symmetric_mode=True)
        place = np.empty(count, dtype=int)
        place[self._order] = np.arange(count)
        low, high = np.sort(np.stack([place[a], place[b]]), axis=0)
        width = int((high - low).max(initial=0))
        degree = np.bincount(np.concatenate([low, high]), minlength=count)
        # the lower band by columns: row r of column c is the coefficient of unknowns c and c + r
        self._smooth = np.zeros((3 * width + 3, 3 * count))
        for axis in range(3):
            self._smooth[0, axis::3] = COHERENCE * degree + REST
            self._smooth[3 * (high - low), 3 * low + axis] = -COHERENCE

    def solve(self, information: np.ndarray, residuals: np.ndarray) -> np.ndarray:
        """Return displacements (n, 3) [m].

        Args:
            information: (n, 3, 3), of each vertex's displacement.
            residuals: (n, 3) [m], the information times the displacement that it tells of.
        """
        if not residuals.any():
            return np.zeros_like(residuals)
        band, known = self._smooth.copy(), information[self._order]
        for row in range(3):
            for column in range(row + 1):
                band[row - column, column::3] += known[:, row, column]
        found = np.empty_like(residuals)
        found[self._order] = solveh_banded(
            band, residuals[self._order].ravel(), overwrite_ab=True, lower=True, check_finite=False
        ).reshape(-1, 3)
        return found


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals (n, 3) of a surface's vertices (n, 3), those of their faces (m, 3) by area; 0 where none."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = faces.T.ravel()
    total = np.stack([np.bincount(flat, np.tile(across[:, k], 3), minlength=len(vertices)) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)


class Rim:
    """The border of a surface.

    Args:
        faces: (m, 3) int.
    """

    def __init__(self, faces: np.ndarray) -> None:
        sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        opposite = np.roll(faces, -2, axis=1).ravel()
        _, index, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
        border = count[index.ravel()] == 1
        self._ends, self._apex = sides[border], opposite[border]

    def inwards(self, vertices: np.ndarray) -> np.ndarray:
        """Return which way is inwards of each vertex (n, 3) at the border: unit vectors (n, 3), 0 within."""
        ends = self._ends
        along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
        across = vertices[self._apex] - vertices[ends[:, 0]]
        square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-30)
        across -= along * (np.einsum("ij,ij->i", across, along) / square)[:, None]
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
        across *= np.sqrt(square)[:, None]
        total = np.zeros_like(vertices)
        for k in (0, 1):
            np.add.at(total, ends[:, k], across)
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)
