"""Linear elasticity in equilibrium on linear tetrahedra: another method for soft bodies under small strain."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg


def displacements(
    x: np.ndarray, tets: np.ndarray, young: float, poisson_ratio: float, body_force: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """Return how far vertices move (n, 3) [m] under a body force, where forces of all tetrahedra balance.

    Args:
        x: (n, 3) [m].
        tets: (m, 4) int.
        young: Young's modulus [Pa].
        poisson_ratio: Poisson's ratio.
        body_force: (3,) [N/m3].
        held: (n, 3) bool, the coordinates that do not move; enough to keep the body in place.
    """
    first = young * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    second = young / (2 * (1 + poisson_ratio))
    edges = x[tets[:, 1:]] - x[tets[:, :1]]
    volume = np.abs(np.linalg.det(edges)) / 6.0
    slopes = np.linalg.inv(edges).transpose(0, 2, 1)  # gradients of the last three shape functions
    slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
    stiff = first * np.einsum("mai,mbj->maibj", slopes, slopes) + second * np.einsum("maj,mbi->maibj", slopes, slopes)
    stiff += second * np.einsum("mac,mbc,ij->maibj", slopes, slopes, np.eye(3))
    rows = (3 * tets[:, :, None] + np.arange(3)).reshape(-1, 12)
    places = (np.repeat(rows, 12, axis=1).ravel(), np.tile(rows, (1, 12)).ravel())
    matrix = sparse.csr_matrix(((stiff * volume[:, None, None, None, None]).ravel(), places), (x.size, x.size))
    force = np.zeros(x.shape)
    np.add.at(force, tets.ravel(), np.repeat(volume / 4.0, 4)[:, None] * body_force)
    free = ~held.ravel()
    matrix, force = matrix[free][:, free], force.ravel()[free]
    scale = sparse.diags(1.0 / matrix.diagonal())
    found, failed = scipy.sparse.linalg.cg(matrix, force, rtol=1e-9, M=scale)
    assert failed == 0
    moved = np.zeros(x.size)
    moved[free] = found
    return moved.reshape(x.shape)
