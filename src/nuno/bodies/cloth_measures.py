"""The elastic energy of a cloth, from where its vertices are: the constraints of the solver in plain NumPy.

A constraint of `nuno.constraints.membrane` and `nuno.constraints.bending` with the compliance alpha has the energy
C^2 / (2 alpha).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.constraints.compliances import Compliances, compliances
from nuno.topology.cloth_topology import ClothTopology
from nuno.topology.grid_lines import find_grid_lines

if TYPE_CHECKING:
    from nuno.materials import Cloth


def elastic_energy(topology: ClothTopology, positions: ArrayLike, material: Cloth, worlds: int = 1) -> np.ndarray:
    """Return (worlds,) [J]: the elastic energy of stretch, shear and bending, zero at rest.

    Args:
        topology: The cloth's elements.
        positions: (worlds, n, 3) [m].
        material: What it is made of.
        worlds: How many worlds the material's arrays may tell apart.
    """
    x = np.asarray(positions, dtype=np.float64)
    soft = compliances(topology, material.resolved(worlds, topology.element_count))
    return stretch_energy(topology, x, soft) + shear_energy(topology, x, soft) + bending_energy(topology, x, soft)


def stretch_energy(topology: ClothTopology, x: np.ndarray, soft: Compliances) -> np.ndarray:
    """Return (worlds,) [J] of x (worlds, n, 3) [m]: edges of a sheet, triangles along warp and weft of a mesh.

    An edge's constraint is C = |x_i - x_j| - rest; a triangle's is C = |F_u| - 1 along warp and |F_v| - 1 along weft.
    """
    edges, triangles = topology.edges, topology.triangles
    order = find_grid_lines(edges)[0]
    i, j = edges.vertices[order].T
    longer = np.linalg.norm(x[:, i] - x[:, j], axis=-1) - edges.extra["rest"][order]
    energy = _energy(longer, edges.scale[order], soft.stretch[:, soft.place["edge"]])
    for along, place in (("u", 0), ("v", 1)):
        stretch = np.linalg.norm(_slopes(topology, x, along), axis=-1) - 1.0
        energy = energy + _energy(stretch, triangles.scale, soft.stretch[:, soft.place["triangle"][:, place]])
    return energy


def shear_energy(topology: ClothTopology, x: np.ndarray, soft: Compliances) -> np.ndarray:
    """Return (worlds,) [J] of x (worlds, n, 3) [m]: C = F_u . F_v of each cell or triangle.

    In a cell of corners a, b, c, d that is (|d - a|^2 - |b - c|^2) / (4 area).
    """
    cells, triangles = topology.cells, topology.triangles
    a, b, c, d = (x[:, corner] for corner in cells.vertices.T)
    diagonals = ((d - a) ** 2).sum(axis=-1) - ((b - c) ** 2).sum(axis=-1)
    energy = _energy(diagonals * cells.extra["quarter"], cells.scale, soft.shear[:, soft.place["cell"]])
    shear = (_slopes(topology, x, "u") * _slopes(topology, x, "v")).sum(axis=-1)
    return energy + _energy(shear, triangles.scale, soft.shear[:, soft.place["triangle"][:, 2]])


def bending_energy(topology: ClothTopology, x: np.ndarray, soft: Compliances) -> np.ndarray:
    """Return (worlds,) [J] of x (worlds, n, 3) [m]: vector constraints, weighted sums of vertices less those at rest.

    Along a grid line x_0 - 2 x_1 + x_2; the twist of a cell x_0 - x_1 - x_2 + x_3; of a triangle and its neighbours
    three sums of six vertices, whose value at rest turns with the triangle.
    """
    lines, twists, patches = topology.lines, topology.twists, topology.patches
    along = np.einsum("wmcx,c->wmx", x[:, lines.vertices], (1.0, -2.0, 1.0))
    energy = _energy(along, lines.scale, soft.bend[:, soft.place["line"]])
    across = np.einsum("wmcx,c->wmx", x[:, twists.vertices], (1.0, -1.0, -1.0, 1.0))
    energy = energy + _energy(across, twists.scale, soft.bend[:, soft.place["twist"]])
    corners = x[:, patches.vertices]
    side, fold = corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0]
    normal = np.cross(side, fold)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-10)
    at_rest = np.einsum("mjk,wmkx->wmjx", patches.extra["rest"], np.stack([side, fold, normal], axis=2))
    bent = np.einsum("mjc,wmcx->wmjx", patches.extra["weight"], corners) - at_rest
    return energy + sum(_energy(bent[:, :, j], patches.scale, soft.bend[:, soft.place["patch"]]) for j in range(3))


def _slopes(topology: ClothTopology, x: np.ndarray, along: str) -> np.ndarray:
    """Return F_u or F_v (worlds, triangles, 3), where a unit step of the rest shape along warp or weft leads."""
    triangles = topology.triangles
    return np.einsum("wmcx,mc->wmx", x[:, triangles.vertices], triangles.extra[along])


def _energy(values: np.ndarray, scale: np.ndarray, compliance: np.ndarray) -> np.ndarray:
    """Return the sum of C^2 / (2 alpha) by world, of C (worlds, m) or (worlds, m, 3) and compliances (worlds, m)."""
    squares = values**2 if values.ndim == 2 else (values**2).sum(axis=-1)
    return 0.5 * (squares / (scale * compliance)).sum(axis=-1)
