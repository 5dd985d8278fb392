"""Linear tetrahedra of small-strain elasticity, assembled and solved directly: what the mesh itself gives."""

import numpy as np
from scipy.sparse import csr_matrix, diags, kron
from scipy.sparse.linalg import spsolve


def stiffness(vertices, tets, young, poisson, own=1.0):
    """Return the stiffness matrix (3 n, 3 n) [N/m] of tetrahedra.

    Each has the share ``own`` of it by itself; the rest is that of the mean strain of every five in a row.
    """
    shear = young / (2.0 * (1.0 + poisson))
    first = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    # strains as (xx, yy, zz, yz, zx, xy)
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += first
    inverse = np.linalg.inv(np.concatenate([np.ones((len(tets), 4, 1)), vertices[tets]], axis=2))
    volume = 1.0 / (6.0 * np.abs(np.linalg.det(inverse)))
    strain = np.zeros((len(tets), 6, 12))
    x, y, z = (inverse[:, k] for k in (1, 2, 3))  # the gradients of the four weights
    for row, axis, slope in (
        (0, 0, x), (1, 1, y), (2, 2, z), (3, 1, z), (3, 2, y), (4, 0, z), (4, 2, x), (5, 0, y), (5, 1, x),
    ):  # fmt: skip
        strain[:, row, axis::3] = slope
    unknowns = np.repeat((3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 1, 12), 6, axis=1)
    rows = np.repeat(np.arange(6 * len(tets)), 12)
    each = csr_matrix((strain.ravel(), (rows, unknowns.ravel())), shape=(6 * len(tets), 3 * len(vertices)))
    whole = own * each.T @ kron(diags(volume), law) @ each
    if own < 1.0:
        five = np.arange(len(tets)) // 5
        total = np.bincount(five, volume)
        part = csr_matrix((volume / total[five], (five, np.arange(len(tets)))))
        mean = kron(part, np.eye(6)) @ each
        whole = whole + (1.0 - own) * mean.T @ kron(diags(total), law) @ mean
    return whole.tocsr()


def reactions(matrix, held, moved):
    """Return the forces (n, 3) [N] that displace the vertices ``held`` (k,) by ``moved`` (k, 3) [m], others free."""
    fixed = np.zeros((matrix.shape[0] // 3, 3), dtype=bool)
    fixed[held] = True
    step = np.zeros(fixed.shape)
    step[held] = moved
    free, step = ~fixed.ravel(), step.ravel()
    step[free] = spsolve(matrix[free][:, free].tocsc(), -(matrix @ step)[free])
    return (matrix @ step).reshape(-1, 3)
