"""Linear tetrahedra of small-strain elasticity, assembled and solved directly: what the mesh itself gives."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve


def stiffness(vertices, tets, young, poisson):
    """Return the stiffness matrix (3 n, 3 n) [N/m] of tetrahedra."""
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
    own = np.einsum("mai,ab,mbj,m->mij", strain, law, strain, volume, optimize=True)
    unknowns = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 12)
    rows, columns = np.repeat(unknowns, 12, axis=1), np.tile(unknowns, (1, 12))
    return csr_matrix((own.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * len(vertices),) * 2)


def reactions(matrix, held, moved):
    """Return the forces (n, 3) [N] that displace the vertices ``held`` (k,) by ``moved`` (k, 3) [m], others free."""
    fixed = np.zeros((matrix.shape[0] // 3, 3), dtype=bool)
    fixed[held] = True
    step = np.zeros(fixed.shape)
    step[held] = moved
    free, step = ~fixed.ravel(), step.ravel()
    step[free] = spsolve(matrix[free][:, free].tocsc(), -(matrix @ step)[free])
    return (matrix @ step).reshape(-1, 3)
