"""The elements of a shape that deforms: cells or triangles of a cloth, tetrahedra of a soft body, made once."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.shapes.shape import ClothMesh, Shape, Sheet
from nuno.shapes.soft_shape import SoftShape

if TYPE_CHECKING:
    pass


def element_count(shape: Shape) -> int:
    """Return how many elements a material may tell apart: cells, faces of a cloth mesh, or tetrahedra."""
    if isinstance(shape, Sheet):
        return shape.cells[0] * shape.cells[1]
    return len(shape.tetrahedra().tets) if isinstance(shape, SoftShape) else len(shape.mesh()[1])


def vertex_shares(shape: Shape) -> np.ndarray:
    """Return (n,) float, the area at rest around each vertex of a cloth [m2], or the volume of a soft body's [m3]."""
    if shape.is_soft:
        topology = topology_of(shape)
        return np.asarray(topology.masses(np.ones((1, 1))))[0]
    vertices, faces = shape.mesh()
    if isinstance(shape, ClothMesh) and shape.rest is not None:
        vertices = np.pad(shape.rest, ((0, 0), (0, 3 - shape.rest.shape[1])))
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(faces.ravel(), np.repeat(area / 3.0, 3), minlength=len(vertices))


def topology_of(shape: Shape) -> Any:
    """Return the elements of a cloth's or soft body's shape, made once."""
    return _soft_topology(shape) if isinstance(shape, SoftShape) else _cloth_topology(shape)


@lru_cache(maxsize=64)
def _soft_topology(shape: SoftShape) -> Any:
    from nuno.topology.soft_topology import SoftTopology

    made = shape.tetrahedra()
    return SoftTopology.of(made.vertices, made.tets, made.fraction, getattr(shape, "mean_strain", False))


@lru_cache(maxsize=64)
def _cloth_topology(shape: Shape) -> Any:
    from nuno.topology.cloth_topology import ClothTopology

    if isinstance(shape, Sheet):
        return ClothTopology.sheet(shape.cells, shape.size)
    assert isinstance(shape, ClothMesh)
    rest: Any = shape.rest  # of its vertices where none was given
    return ClothTopology.mesh(rest, shape.faces)
