"""A soft body's elements: tetrahedra, their rest shape, and the clusters in which they are solved.

Everything here depends on the rest shape alone; materials come in when a solver is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import MeshError
from nuno.mesh.tetrahedra import boundary_faces
from nuno.topology.element_clusters import Clusters, clusters

OWN_SHARE = 0.25
"""Of the stiffness of a voxel that has a mean, what its tetrahedra keep each by itself: it is what resists the modes in
which the mean does not change. With 0.2 to 0.3 a bar of four voxels across is within 2 % in bending and 8 to 12 % in
torsion."""
ALIKE = 1e-6
"""Of its size: how near a cluster must be to a parallelepiped to be a voxel."""
THINNEST = 1e-9
"""Least volume over the cube of the longest edge: below it, float32 has no digit of the volume left."""


@dataclass(frozen=True, eq=False)
class SoftTopology:
    """Everything about a soft body that does not depend on its material or state.

    Elements are kept in the order in which they were given, which is that of a material's values per element.

    Attributes:
        rest: (n, 3) float64, rest shape [m].
        tets: (m, 4) int32, vertex indices, of positive volume.
        volume: (m,) float64, rest volume of each element [m3], whole where it is only partly filled.
        inverse: (m, 3, 3) float64 [1/m], inverse of the matrix whose columns are the edges from the first vertex.
        fraction: (m,) float64, the filled part of each element's volume: scales its mass and stiffness. Above 1
            where flat faces cut a round body's volume.
        faces: (f, 3) int32, triangles of the boundary, counterclockwise from outside.
        clusters: The elements in groups, sorted by colour.
        voxels: (k,) int, the clusters whose energy is that of their mean deformation but for `OWN_SHARE`.
        cell_size: Smallest height of an element [m], between a vertex and the opposite face.
        extent: Longest straight line in the rest shape's bounding box [m].
    """

    rest: np.ndarray
    tets: np.ndarray
    volume: np.ndarray
    inverse: np.ndarray
    fraction: np.ndarray
    faces: np.ndarray
    clusters: Clusters
    voxels: np.ndarray
    cell_size: float
    extent: float
    device_arrays: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return len(self.rest)

    @property
    def element_count(self) -> int:
        """Number of tetrahedra: what a material per element counts."""
        return len(self.tets)

    @classmethod
    def of(
        cls, vertices: ArrayLike, tets: ArrayLike, fraction: ArrayLike | None = None, mean_strain: bool = False
    ) -> SoftTopology:
        """Return the topology of tetrahedra.

        Args:
            vertices: (n, 3) float, rest shape [m].
            tets: (m, 4) int; an element given inside out is turned around.
            fraction: (m,) float above 0, the part of each element that is filled; None for all of it.
            mean_strain: Whether voxels of five tetrahedra share their mean deformation.

        Raises:
            MeshError: there is no element, an index is out of range, an element is flat, a vertex belongs to none, or
                a fraction is not above 0.
        """
        rest = np.asarray(vertices, dtype=np.float64)
        corners = np.array(tets, dtype=np.int64)
        if corners.ndim != 2 or corners.shape[1] != 4 or not len(corners):
            raise MeshError(f"a soft body needs tetrahedra (m, 4), got {corners.shape}")
        if rest.ndim != 2 or rest.shape[1] != 3 or not np.isfinite(rest).all():
            raise MeshError(f"a soft body needs finite vertices (n, 3), got {rest.shape}")
        if corners.min() < 0 or corners.max() >= len(rest):
            raise MeshError(f"tetrahedra name vertices {corners.min()} to {corners.max()}; there are {len(rest)}")
        if loose := len(rest) - len(np.unique(corners)):
            raise MeshError(f"{loose} of {len(rest)} vertices belong to no tetrahedron; leave them out")
        share = np.ones(len(corners)) if fraction is None else np.asarray(fraction, dtype=np.float64)
        if share.shape != (len(corners),) or not ((share > 0.0) & np.isfinite(share)).all():
            raise MeshError(f"fraction must be ({len(corners)},) above 0, got {share.shape}")
        edges = edge_matrices(rest, corners)
        volume = np.linalg.det(edges) / 6.0
        inside_out = volume < 0.0
        corners[inside_out] = corners[inside_out][:, [0, 1, 3, 2]]
        edges, volume = edge_matrices(rest, corners), np.abs(volume)
        longest = np.linalg.norm(edges, axis=1).max(axis=1)
        if (flat := volume <= THINNEST * longest**3).any():
            raise MeshError(f"{int(flat.sum())} tetrahedra are flat, the first is {int(np.argmax(flat))}")
        inverse = np.linalg.inv(edges)
        # the gradient of a corner's weight is one over its height
        steepest = np.linalg.norm(shape_gradients(inverse), axis=2).max()
        # neighbours one after the other take fewer colours than elements in the order of some mesh
        along = np.lexsort(np.round(rest[corners].mean(axis=1) / np.cbrt(volume.mean()), 3).T)
        grouped = clusters(corners, volume, along, len(rest))
        return cls(
            rest, corners.astype(np.int32), volume, inverse, share, boundary_faces(corners), grouped,
            _voxels(rest, grouped, share) if mean_strain else np.zeros(0, dtype=int), float(1.0 / steepest),
            float(np.linalg.norm(np.ptp(rest, axis=0))),
        )  # fmt: skip

    def masses(self, density: np.ndarray) -> np.ndarray:
        """Return (worlds, n) [kg]: each element's mass to its corners, by their solid angles.

        A lattice of five tetrahedra a cell has vertices of 8 and of 32 elements. Quarters of the elements' masses would
        make the former five times as light as the latter, and the lightest vertex is what asks for small substeps; by
        solid angle they differ by a half.

        Args:
            density: (worlds, m or 1) [kg/m3].
        """
        angles = solid_angles(edge_matrices(self.rest, self.tets))
        part = angles / angles.sum(axis=1, keepdims=True)
        shares = (density * (self.volume * self.fraction))[..., None] * part
        return np.stack([np.bincount(self.tets.ravel(), s.ravel(), minlength=self.vertex_count) for s in shares])


def _voxels(rest: np.ndarray, grouped: Clusters, fraction: np.ndarray) -> np.ndarray:
    """Return (k,) int, the clusters that are parallelepipeds, evenly filled: opposite corners all have one middle."""
    full = np.flatnonzero((grouped.elements >= 0).all(axis=1))
    corners, part = rest[grouped.vertices[full]], fraction[grouped.elements[full]]
    middle = 0.5 * (corners[:, :4] + corners[:, 4:])
    size = np.ptp(corners, axis=1).max(axis=1)
    even = (np.ptp(middle, axis=1).max(axis=1) < ALIKE * size) & (np.ptp(part, axis=1) < ALIKE * part[:, 0])
    return full[even]


def edge_matrices(positions: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return (..., m, 3, 3): columns are the edges from each element's first vertex to the others [m].

    Args:
        positions: (..., n, 3) [m].
        tets: (m, 4) int.
    """
    corners = positions[..., tets, :]
    return np.swapaxes(corners[..., 1:, :] - corners[..., :1, :], -1, -2)


def shape_gradients(inverse: np.ndarray) -> np.ndarray:
    """Return (m, 4, 3) [1/m]: the gradient in the rest shape of each corner's barycentric weight."""
    return np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)


def solid_angles(edges: np.ndarray) -> np.ndarray:
    """Return (m, 4) [sr]: the solid angle at each corner (van Oosterom and Strackee 1983)."""
    corners = np.concatenate([np.zeros((len(edges), 1, 3)), np.swapaxes(edges, 1, 2)], axis=1)
    angles = np.zeros((len(edges), 4))
    for k in range(4):
        a, b, c = (corners[:, j] - corners[:, k] for j in range(4) if j != k)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        top = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
        angles[:, k] = 2.0 * np.arctan2(top, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    return angles


def moduli(values: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the two moduli of the energy, (worlds or 1, m or 1) float64 [Pa] each: mu, and Lame's first plus mu.

    For small strains E the energy's shear part mu (|F|^2 / 2 - J) is mu (E:E - tr(E)^2 / 2); the second modulus makes
    up for its second term, so that Young's modulus and Poisson's ratio are those of linear elasticity.

    Args:
        values: What `Soft.resolved` gives.
    """
    young, poisson = np.broadcast_arrays(*(values[k].astype(float) for k in ("youngs_modulus", "poisson_ratio")))
    mu = young / (2.0 * (1.0 + poisson))
    return mu, young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)) + mu
