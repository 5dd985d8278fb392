"""Soft shapes: solids that are filled with tetrahedra.

A soft shape's ``mesh()`` is that of its tetrahedra: all their vertices, which are what dynamics move, and their
boundary. Where the tetrahedra are made from a surface, the surface is the skin: it moves along with them, and
``Body.skin`` has it.

``tetrahedraliser`` is "fitted" for tetrahedra whose boundary follows the surface, or "lattice" for whole voxels around
it; a shape that does not say is a lattice, as those in files of earlier versions are. With ``mean_strain`` the five
tetrahedra of a whole voxel share three quarters of their stiffness, which acts on their mean deformation.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from nuno.errors import InvalidInputError, MeshError
from nuno.mesh import primitives
from nuno.mesh.closed import check_closed
from nuno.mesh.lattice import MAX_VOXELS, lattice_tetrahedra
from nuno.mesh.primitives import MeshArrays
from nuno.mesh.tetrahedra import Tetrahedra, boundary_faces, box_tetrahedra, volumes
from nuno.shapes.shape import Shape, checked_mesh, frozen, length, lengths
from nuno.validation import count, finite_array, flag, index_array

logger = logging.getLogger(__name__)
FITTED, LATTICE = "fitted", "lattice"
SEGMENTS = 128  # segments around what a round shape's lattice is filled from: within 0.1 % of its volume


@dataclass(frozen=True, eq=False)
class SoftShape(Shape):
    """Root of all soft shapes."""

    kind: ClassVar[str] = "soft_shape"
    is_soft: ClassVar[bool] = True

    def tetrahedra(self) -> Tetrahedra:
        """Return the tetrahedra in the shape's own frame, whose origin is the mean of their vertices."""
        return _filled(self)[0]

    def mesh(self) -> MeshArrays:
        """Return the tetrahedra's vertices (n, 3) [m] in the shape's own frame and their boundary (m, 3) int32."""
        made, boundary, _ = _filled(self)
        return made.vertices, boundary


@dataclass(frozen=True)
class SoftBox(SoftShape):
    """A box with edges ``size`` [m] along x, y, z, in ``cells`` voxels of five tetrahedra each."""

    size: tuple[float, float, float]
    cells: tuple[int, int, int]
    mean_strain: bool = False
    kind: ClassVar[str] = "soft_box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", lengths("size", self.size, 3))
        object.__setattr__(self, "mean_strain", flag("mean_strain", self.mean_strain))
        try:
            nx, ny, nz = self.cells
        except (TypeError, ValueError) as error:
            raise MeshError(f"cells must be three whole numbers (nx, ny, nz), got {self.cells!r}") from error
        object.__setattr__(self, "cells", (count("cells[0]", nx), count("cells[1]", ny), count("cells[2]", nz)))
        if nx * ny * nz > MAX_VOXELS:
            raise MeshError(f"cells {self.cells} are {nx * ny * nz} voxels; at most {MAX_VOXELS} are made")


@dataclass(frozen=True)
class SoftSphere(SoftShape):
    """A sphere of ``radius`` [m], from voxels of at most ``cell`` [m]."""

    radius: float
    cell: float
    tetrahedraliser: str = LATTICE
    mean_strain: bool = False
    kind: ClassVar[str] = "soft_sphere"

    def __post_init__(self) -> None:
        _set_lengths(self, "radius", "cell")
        _filled(self)


@dataclass(frozen=True)
class _Upright(SoftShape):
    """Root of round shapes along z."""

    radius: float
    height: float
    cell: float
    tetrahedraliser: str = LATTICE
    mean_strain: bool = False

    def __post_init__(self) -> None:
        _set_lengths(self, "radius", "height", "cell")
        _filled(self)


@dataclass(frozen=True)
class SoftCylinder(_Upright):
    """A cylinder of ``radius`` and ``height`` [m] along z, from voxels of at most ``cell`` [m]."""

    kind: ClassVar[str] = "soft_cylinder"


@dataclass(frozen=True)
class SoftCapsule(_Upright):
    """A capsule, ``height`` [m] along z between half spheres, from voxels of at most ``cell`` [m]."""

    kind: ClassVar[str] = "soft_capsule"


@dataclass(frozen=True, eq=False)
class SoftMesh(SoftShape):
    """The inside of a closed surface, from voxels; the surface is embedded in their tetrahedra.

    Attributes:
        vertices: (n, 3) float [m]; those of no face are left out.
        faces: (m, 3) int, closed, counterclockwise from outside.
        cell: Longest edge of a voxel [m].
        tetrahedraliser: "fitted" or "lattice".
        mean_strain: Whether whole voxels share their mean deformation.

    Raises:
        MeshError: the surface is open, inside out or intersects itself, or the cell is too small.
    """

    vertices: np.ndarray
    faces: np.ndarray
    cell: float
    tetrahedraliser: str = LATTICE
    mean_strain: bool = False
    kind: ClassVar[str] = "soft_mesh"

    def __post_init__(self) -> None:
        _set_lengths(self, "cell")
        vertices, faces = closed_mesh(self.vertices, self.faces)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        _filled(self)

    @property
    def centre(self) -> np.ndarray:
        """(3,) float [m], the mean of the tetrahedra's vertices, for the surface as it was given."""
        return _filled(self)[2].copy()


@dataclass(frozen=True, eq=False)
class SoftTetrahedra(SoftShape):
    """A solid of given tetrahedra.

    Attributes:
        vertices: (n, 3) float [m].
        tets: (m, 4) int; an element given inside out is turned around.

    Raises:
        MeshError: an element is flat, or a vertex belongs to none.
    """

    vertices: np.ndarray
    tets: np.ndarray
    kind: ClassVar[str] = "soft_tetrahedra"

    def __post_init__(self) -> None:
        vertices = finite_array("vertices", self.vertices, ("n", 3), error=MeshError)
        tets = index_array("tets", self.tets, ("m", 4), low=0, high=len(vertices), error=MeshError)
        volume = volumes(vertices, tets)
        tets[volume < 0.0] = tets[volume < 0.0][:, [0, 1, 3, 2]]
        corners = vertices[tets]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
        # below a billionth of the cube of its edge, float32 has no digit of the volume left
        if (flat := np.flatnonzero(np.abs(volume) <= 1e-9 * longest**3)).size:
            raise MeshError(f"{flat.size} tetrahedra are flat, the first is {flat[0]}; remove them")
        if loose := len(vertices) - len(np.unique(tets)):
            raise MeshError(f"{loose} of {len(vertices)} vertices belong to no tetrahedron; leave them out")
        _check_sides(tets)
        object.__setattr__(self, "vertices", frozen(vertices))
        object.__setattr__(self, "tets", frozen(tets))

    @property
    def centre(self) -> np.ndarray:
        """(3,) float [m], the mean of the vertices as they were given."""
        return _filled(self)[2].copy()


def closed_mesh(vertices: Any, faces: Any) -> MeshArrays:
    """Return the vertices that faces name, and the faces, of a mesh that bounds a volume; both read-only.

    Raises:
        MeshError: no mesh, or one that is open, inside out or intersects itself.
    """
    points, triangles = checked_mesh(vertices, faces)
    used, renamed = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], renamed.reshape(-1, 3).astype(np.int32)
    check_closed(points, triangles)
    return frozen(points), frozen(triangles)


def _check_sides(tets: np.ndarray) -> None:
    """Check that no side is that of three tetrahedra, as it is where one is there twice.

    Raises:
        MeshError: one is.
    """
    sides = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    _, first, numbers = np.unique(sides, axis=0, return_index=True, return_counts=True)
    if (crowded := np.flatnonzero(numbers > 2)).size or len(np.unique(np.sort(tets, axis=1), axis=0)) < len(tets):
        at = int(first[crowded[0]]) % len(tets) if crowded.size else 0
        raise MeshError(
            f"tetrahedra overlap: one is there twice, or {crowded.size} sides belong to three or more, the first to "
            f"element {at}; remove them"
        )


def _set_lengths(shape: SoftShape, *names: str) -> None:
    for name in names:
        object.__setattr__(shape, name, length(name, getattr(shape, name)))
    object.__setattr__(shape, "mean_strain", flag("mean_strain", getattr(shape, "mean_strain", False)))
    kind = getattr(shape, "tetrahedraliser", LATTICE)
    if not isinstance(kind, str) or kind not in (FITTED, LATTICE):
        raise InvalidInputError(f'tetrahedraliser must be "fitted" or "lattice", got {kind!r}')


@lru_cache(maxsize=64)
def _filled(shape: Any) -> tuple[Tetrahedra, np.ndarray, np.ndarray]:
    """Return the tetrahedra about the mean of their vertices, their boundary, and that mean."""
    made = {
        "soft_box": lambda: _whole(*box_tetrahedra(shape.size, shape.cells)),
        "soft_sphere": lambda: _round(shape, primitives.sphere_mesh, shape.radius),
        "soft_cylinder": lambda: _round(shape, primitives.cylinder_mesh, shape.radius, shape.height),
        "soft_capsule": lambda: _round(shape, primitives.capsule_mesh, shape.radius, shape.height),
        "soft_mesh": lambda: _voxels(shape, shape.vertices, shape.faces),
        "soft_tetrahedra": lambda: _whole(shape.vertices, shape.tets),
    }[shape.kind]()
    centre = made.vertices.mean(axis=0)
    boundary = boundary_faces(made.tets)
    about = Tetrahedra(
        made.vertices - centre, made.tets, made.fraction, made.faces, made.skin_tets, made.skin_weights
    )  # fmt: skip
    return about, frozen(boundary), frozen(centre)


def _whole(vertices: np.ndarray, tets: np.ndarray) -> Tetrahedra:
    return Tetrahedra(vertices, tets, np.ones(len(tets)), boundary_faces(tets))


def _round(shape: Any, surface: Any, *sizes: float) -> Tetrahedra:
    vertices, faces = surface(*sizes, around=SEGMENTS)
    return _voxels(shape, vertices, faces, surface(*sizes), mean=(0.0, 0.0, 0.0))


def _voxels(
    shape: Any, vertices: np.ndarray, faces: np.ndarray, skin: MeshArrays | None = None,
    mean: tuple[float, float, float] | None = None,
) -> Tetrahedra:  # fmt: skip
    if shape.tetrahedraliser == FITTED:
        from nuno.mesh.fitted import UnresolvedMeshError, fitted_tetrahedra  # scipy: loaded where it is used

        try:
            return fitted_tetrahedra(vertices, faces, shape.cell, skin, mean)
        except UnresolvedMeshError as error:
            logger.warning(
                "a %s is filled with whole voxels, whose flat faces make its contacts: a cell of %g m is too large to "
                "follow its surface (%s); a smaller cell may",
                shape.kind, shape.cell, error,
            )  # fmt: skip
    return lattice_tetrahedra(vertices, faces, shape.cell, skin)
