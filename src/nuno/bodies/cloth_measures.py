"""The elastic energy of a cloth, from where its vertices are: the constraints of the solver in plain NumPy.

A constraint with the compliance alpha has the energy C^2 / (2 alpha). The C of a kind of elements is in its row of
`nuno.topology.cloth_topology.ELEMENT_KINDS`; those of edges and triangles, which have compliances by direction, are
here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.constraints.compliances import Compliances, compliances
from nuno.topology.cloth_topology import ELEMENT_KINDS, ClothTopology
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
    energy = edge_energy(topology, x, soft) + triangle_energy(topology, x, soft)
    for table in ("stretch", "shear", "bend"):
        energy = energy + sum(
            _energy(part, getattr(topology, kind.elements).scale, getattr(soft, table)[:, soft.place[kind.name]])
            for kind in ELEMENT_KINDS if kind.compliance == table and kind.value is not None
            for part in np.moveaxis(kind.value(getattr(topology, kind.elements), x), 2, 0)
        )  # fmt: skip
    return energy


def edge_energy(topology: ClothTopology, x: np.ndarray, soft: Compliances) -> np.ndarray:
    """Return (worlds,) [J] of a sheet's edges, x (worlds, n, 3) [m]: C = |x_i - x_j| - rest."""
    edges = topology.edges
    order = find_grid_lines(edges)[0]
    i, j = edges.vertices[order].T
    longer = np.linalg.norm(x[:, i] - x[:, j], axis=-1) - edges.extra["rest"][order]
    return _energy(longer, edges.scale[order], soft.stretch[:, soft.place["edge"]])


def triangle_energy(topology: ClothTopology, x: np.ndarray, soft: Compliances) -> np.ndarray:
    """Return (worlds,) [J] of a mesh's triangles, x (worlds, n, 3) [m].

    C = |F_u| - 1 along warp, |F_v| - 1 along weft and F_u . F_v, with F_u and F_v (worlds, triangles, 3) where a unit
    step of the rest shape along warp or weft leads.
    """
    triangles = topology.triangles
    corners, place = x[:, triangles.vertices], soft.place["triangle"]
    u, v = (np.einsum("wmcx,mc->wmx", corners, triangles.extra[along]) for along in ("u", "v"))
    return (
        _energy(np.linalg.norm(u, axis=-1) - 1.0, triangles.scale, soft.stretch[:, place[:, 0]])
        + _energy(np.linalg.norm(v, axis=-1) - 1.0, triangles.scale, soft.stretch[:, place[:, 1]])
        + _energy((u * v).sum(axis=-1), triangles.scale, soft.shear[:, place[:, 2]])
    )


def _energy(values: np.ndarray, scale: np.ndarray, compliance: np.ndarray) -> np.ndarray:
    """Return the sum of C^2 / (2 alpha) by world, of C (worlds, m) or (worlds, m, 3) and compliances (worlds, m)."""
    squares = values**2 if values.ndim == 2 else (values**2).sum(axis=-1)
    return 0.5 * (squares / (scale * compliance)).sum(axis=-1)
