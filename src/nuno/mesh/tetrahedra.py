"""Tetrahedra: regular blocks of five per voxel, and what is told from a set of tetrahedra alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.errors import MeshError
from nuno.validation import MAX_INDEX, checked, finite_array, index_array

# The corner of a voxel at (x, y, z) in {0, 1} has the number x + 2 y + 4 z. A voxel's four outer tetrahedra stand on
# every other corner, about the fifth; in the neighbours, which have the other corners, the diagonals of the common face
# agree.
EVEN = np.array([[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 4, 7], [6, 4, 2, 7], [1, 2, 4, 7]])
ODD = np.array([[1, 3, 0, 5], [2, 0, 3, 6], [4, 0, 6, 5], [7, 5, 6, 3], [0, 5, 3, 6]])
FIVE = np.stack([EVEN, ODD])
"""(2, 5, 4) corners of the tetrahedra of an even and of an odd voxel, all of positive volume."""

FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
"""(4, 3) corners of a tetrahedron's faces, counterclockwise from outside."""


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """A volume as tetrahedra, with the surface that is drawn.

    Attributes:
        vertices: (n, 3) float64 [m].
        tets: (m, 4) int32, all of positive volume.
        fraction: (m,) float64 above 0, the part of each that is filled: it scales its mass and stiffness.
        faces: (f, 3) int32, triangles of the skin; they name ``vertices``, or embedded points where there are some.
        skin_tets: (k,) int32, in which tetrahedron each embedded point is; None where the skin is the boundary.
        skin_weights: (k, 4) float64, the weights of its corners, which add up to 1; None likewise.
    """

    vertices: np.ndarray
    tets: np.ndarray
    fraction: np.ndarray
    faces: np.ndarray
    skin_tets: np.ndarray | None = None
    skin_weights: np.ndarray | None = None

    def __post_init__(self) -> None:
        for array in (self.vertices, self.tets, self.fraction, self.faces, self.skin_tets, self.skin_weights):
            if array is not None:
                array.setflags(write=False)

    def skin_vertices(self, vertices: np.ndarray) -> np.ndarray:
        """Return where the skin's vertices are, (..., k, 3) [m], when the tetrahedra's are at (..., n, 3) [m]."""
        if self.skin_tets is None or self.skin_weights is None:
            return vertices
        corners = vertices[..., self.tets[self.skin_tets], :]
        return np.einsum("kc,...kcx->...kx", self.skin_weights, corners)


@checked
def box_tetrahedra(size: tuple[float, float, float], cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return a box about the origin as five tetrahedra per voxel.

    Args:
        size: Edges along x, y, z [m].
        cells: Voxels along x, y, z.

    Returns:
        vertices (n, 3) float64 [m], vertex (i, j, k) at (k (ny + 1) + j) (nx + 1) + i, and tets (m, 4) int32, those of
        voxel (i, j, k) from 5 ((k ny + j) nx + i).

    Raises:
        MeshError: sizes that are not positive and finite, or fewer than one voxel.
    """
    edges = finite_array("size", size, (3,), error=MeshError)
    if edges.min() <= 0.0 or min(cells) < 1:
        raise MeshError(f"a box needs positive edges and one voxel or more along each, got {size} and {cells}")
    axes = [(np.arange(n + 1) / n - 0.5) * edge for n, edge in zip(cells, edges.tolist(), strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    k, j, i = (index.ravel() for index in np.indices(cells[::-1]))
    return vertices, voxel_tetrahedra(np.stack([i, j, k], axis=1), cells).astype(np.int32)


def voxel_tetrahedra(voxels: np.ndarray, cells: tuple[int, int, int]) -> np.ndarray:
    """Return (5 v, 4) int64, the tetrahedra of voxels (v, 3) in terms of the lattice's nodes, x fastest."""
    nx, ny = cells[0] + 1, cells[1] + 1
    corner = np.arange(8)
    offset = (corner & 1) + nx * (corner >> 1 & 1) + nx * ny * (corner >> 2)
    first = voxels[:, 0] + nx * voxels[:, 1] + nx * ny * voxels[:, 2]
    return (first[:, None, None] + offset[FIVE[voxels.sum(axis=1) % 2]]).reshape(-1, 4)


@checked
def boundary_faces(tets: np.ndarray) -> np.ndarray:
    """Return the faces of the boundary: those that belong to one tetrahedron only.

    Args:
        tets: (m, 4) int.

    Returns:
        (f, 3) int32, counterclockwise from outside.

    Raises:
        MeshError: no tetrahedra.
    """
    return boundary_by_element(index_array("tets", tets, ("m", 4), low=0, high=MAX_INDEX, error=MeshError))[0]


def boundary_by_element(tets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the boundary's faces (f, 3) int32, and of which tetrahedron each is one, (f,) int32."""
    faces = tets[:, FACES].reshape(-1, 3)
    named = np.sort(faces, axis=1)
    order = np.lexsort(named.T)
    first = np.ones(len(faces) + 1, dtype=bool)  # of those with the same vertices, which stand together in the order
    first[1:-1] = (named[order][1:] != named[order][:-1]).any(axis=1)
    alone = np.sort(order[first[:-1] & first[1:]])
    return faces[alone].astype(np.int32), (alone // 4).astype(np.int32)


def volumes(vertices: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return (..., m) [m3], negative where a tetrahedron is inside out, of vertices (..., n, 3) [m]."""
    a, b, c, d = (vertices[..., tets[:, corner], :] for corner in range(4))
    return np.einsum("...x,...x->...", np.cross(b - a, c - a), d - a) / 6.0
