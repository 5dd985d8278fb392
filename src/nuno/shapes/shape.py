"""Shapes: what a body looks like in its own frame, as small frozen dataclasses.

Every shape has ``kind``, ``centre`` (where its own frame's origin starts in the world) and ``mesh()``
(its triangles in its own frame).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from nuno.errors import MeshError
from nuno.mesh import primitives
from nuno.mesh.closed import enclosed_volume
from nuno.mesh.memory_limit import SHEET_BYTES, check_host_memory
from nuno.mesh.primitives import MeshArrays
from nuno.topology.cloth_mesh_checks import check_cloth_mesh
from nuno.validation import count, finite_array, index_array, number

LARGE = 1_000_000
"""Vertices from which on it is asked whether there is memory for them."""
SHORTEST, LONGEST = 1e-6, 1e6
"""Lengths of shapes [m]."""
UNBOUNDED = 1.0e9
"""[m] Bounding radius of a plane."""
FLAT = 1e-6
"""Of its convex hull's volume, what a hull may lack by rounding."""


@dataclass(frozen=True)
class Formula:
    """The numbers by which contacts take a shape whose kind has a formula in `nuno.contact.particle.distances`.

    Attributes:
        sizes: (3,) [m], as the formula takes them.
        reach: Radius [m] of a sphere about the frame's origin in which all of it lies.
        curvature: The least radius [m] with which its surface is curved; 0 with edges, infinite where it is flat.
    """

    sizes: tuple[float, float, float]
    reach: float
    curvature: float


@dataclass(frozen=True, eq=False)
class Shape:
    """Root of all shapes.

    A shape by formula is a class here with its `formula` and its triangles, the formula under its ``kind`` in
    `nuno.contact.particle.distances`, and a function in `nuno.bodies.make_bodies`: see docs/extending.md.
    """

    kind: ClassVar[str] = "shape"
    is_cloth: ClassVar[bool] = False  # whether cloth dynamics can be attached
    is_soft: ClassVar[bool] = False  # whether it is filled with tetrahedra, so that soft dynamics can be

    @property
    def centre(self) -> np.ndarray:
        """(3,) float [m], where the shape stands unless it is placed."""
        return np.zeros(3)

    @property
    def is_solid(self) -> bool:
        """Return True if the shape has an inside."""
        return not self.is_cloth

    @property
    def formula(self) -> Formula | None:
        """The numbers of the formula that contacts take it by; None takes its triangles."""
        return None

    def mesh(self) -> MeshArrays:
        """Return vertices (n, 3) [m] in the shape's own frame and faces (m, 3) int32, both read-only."""
        return _primitive(self)

    def _triangles(self) -> MeshArrays:
        """Return what `mesh` keeps."""
        raise NotImplementedError


@dataclass(frozen=True)
class Box(Shape):
    """A box with edges ``size`` [m] along x, y, z."""

    size: tuple[float, float, float]
    kind: ClassVar[str] = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", lengths("size", self.size, 3))

    @property
    def formula(self) -> Formula:
        """Half the edges."""
        x, y, z = self.size
        return Formula((x / 2, y / 2, z / 2), float(np.linalg.norm(np.array(self.size) / 2)), 0.0)

    def _triangles(self) -> MeshArrays:
        return primitives.box_mesh(self.size)


@dataclass(frozen=True)
class Sphere(Shape):
    """A sphere of ``radius`` [m]."""

    radius: float
    kind: ClassVar[str] = "sphere"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length("radius", self.radius))

    @property
    def formula(self) -> Formula:
        """The radius."""
        return Formula((self.radius, 0.0, 0.0), self.radius, self.radius)

    def _triangles(self) -> MeshArrays:
        return primitives.sphere_mesh(self.radius)


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder of ``radius`` and ``height`` [m] along z, closed at both ends."""

    radius: float
    height: float
    kind: ClassVar[str] = "cylinder"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length("radius", self.radius))
        object.__setattr__(self, "height", length("height", self.height))

    @property
    def formula(self) -> Formula:
        """The radius and half the height."""
        return Formula((self.radius, self.height / 2, 0.0), float(np.hypot(self.radius, self.height / 2)), 0.0)

    def _triangles(self) -> MeshArrays:
        return primitives.cylinder_mesh(self.radius, self.height)


@dataclass(frozen=True)
class Capsule(Shape):
    """All points within ``radius`` [m] of a segment of length ``height`` [m] along z."""

    radius: float
    height: float
    kind: ClassVar[str] = "capsule"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", length("radius", self.radius))
        object.__setattr__(self, "height", length("height", self.height))

    @property
    def formula(self) -> Formula:
        """The radius and half the height."""
        return Formula((self.radius, self.height / 2, 0.0), self.radius + self.height / 2, self.radius)

    def _triangles(self) -> MeshArrays:
        return primitives.capsule_mesh(self.radius, self.height)


@dataclass(frozen=True)
class Plane(Shape):
    """The endless plane z = 0 of its own frame; what lies below it is solid."""

    kind: ClassVar[str] = "plane"

    @property
    def formula(self) -> Formula:
        """No sizes."""
        return Formula((0.0, 0.0, 0.0), UNBOUNDED, np.inf)

    def _triangles(self) -> MeshArrays:
        return primitives.plane_mesh()


@dataclass(frozen=True)
class Sheet(Shape):
    """A flat cloth of ``size`` [m] in its own xy plane, in ``cells`` (along x, along y)."""

    size: tuple[float, float]
    cells: tuple[int, int]
    kind: ClassVar[str] = "sheet"
    is_cloth: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", lengths("size", self.size, 2))
        try:
            nx, ny = self.cells
        except (TypeError, ValueError) as error:
            raise MeshError(f"cells must be two whole numbers (nx, ny), got {self.cells!r}") from error
        object.__setattr__(self, "cells", (count("cells[0]", nx), count("cells[1]", ny)))
        vertices = (self.cells[0] + 1) * (self.cells[1] + 1)
        if vertices > LARGE:
            check_host_memory(f"a sheet of {vertices} vertices", SHEET_BYTES * vertices)

    def _triangles(self) -> MeshArrays:
        return primitives.sheet_mesh(self.size, self.cells)


@dataclass(frozen=True, eq=False)
class TriangleMesh(Shape):
    """A rigid surface of triangles.

    Attributes:
        vertices: (n, 3) float [m]; the shape's frame has its origin at their mean.
        faces: (m, 3) int.
    """

    vertices: np.ndarray
    faces: np.ndarray
    kind: ClassVar[str] = "mesh"
    _local: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        vertices, faces = checked_mesh(self.vertices, self.faces)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "_local", frozen(vertices - vertices.mean(axis=0)))

    @property
    def centre(self) -> np.ndarray:
        """(3,) float [m], the mean of the vertices as they were given."""
        return self.vertices.mean(axis=0)

    @property
    def is_solid(self) -> bool:
        """Return True if the faces close the surface and look outwards; a cloth is never solid."""
        return not self.is_cloth and _looks_outwards(self)

    def mesh(self) -> MeshArrays:
        """Return the vertices about their mean, and the faces."""
        return self._local, self.faces


@dataclass(frozen=True, eq=False)
class Hull(TriangleMesh):
    """A convex solid: particles look at the planes of its faces instead of searching for the nearest one.

    Of up to a few hundred faces that is several times as fast as a `TriangleMesh`. What is thick keeps its distance
    from the planes, and so a little more from sharp edges.

    Attributes:
        vertices: (n, 3) float [m]; the shape's frame has its origin at their mean.
        faces: (m, 3) int, closed, looking outwards, and convex.
    """

    kind: ClassVar[str] = "hull"

    def __post_init__(self) -> None:
        super().__post_init__()
        own, full = enclosed_volume(self._local, self.faces), float(self._quickhull.volume)
        if not self.is_solid or own < (1.0 - FLAT) * full:
            raise MeshError(
                f"a hull is closed, convex and looks outwards, got {len(self.faces)} faces that enclose {own:.6g} m3 "
                f"of their convex hull's {full:.6g} m3; Hull.of(points) makes one"
            )

    @classmethod
    def of(cls, points: np.ndarray) -> Hull:
        """Return the convex hull of points (n, 3) [m].

        Raises:
            MeshError: all of them lie in a plane, or are not finite.
        """
        hull = _quickhull(finite_array("points", points, ("n", 3), error=MeshError))
        corners = hull.points[hull.simplices]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        inwards = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
        faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
        number = np.zeros(len(hull.points), dtype=np.int64)
        number[hull.vertices] = np.arange(len(hull.vertices))
        return cls(hull.points[hull.vertices], number[faces])

    @cached_property
    def planes(self) -> np.ndarray:
        """(k, 4) float, of each plane face an outward normal and its distance from the frame's origin [m]."""
        planes: np.ndarray = np.unique(self._quickhull.equations, axis=0)
        return frozen(planes * (1.0, 1.0, 1.0, -1.0))

    @cached_property
    def _quickhull(self) -> Any:
        return _quickhull(self._local)


@dataclass(frozen=True, eq=False)
class ClothMesh(TriangleMesh):
    """A cloth of any cut.

    Attributes:
        vertices: (n, 3) float [m], its present shape.
        faces: (m, 3) int.
        rest: (n, 2) or (n, 3) float [m], the shape in which nothing is stretched; None is ``vertices``.
    """

    rest: np.ndarray | None = None
    kind: ClassVar[str] = "cloth_mesh"
    is_cloth: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.vertices)
        rest = self.vertices if self.rest is None else self.rest
        rest = finite_array("rest", rest, (n, 2), (n, 3), error=MeshError)
        check_cloth_mesh(np.pad(rest, ((0, 0), (0, 3 - rest.shape[1]))), self.faces, self.vertices)
        object.__setattr__(self, "rest", frozen(rest))


@lru_cache(maxsize=512)
def _primitive(shape: Any) -> MeshArrays:
    vertices, faces = shape._triangles()
    return frozen(vertices), frozen(faces)


@lru_cache(maxsize=512)
def _looks_outwards(shape: TriangleMesh) -> bool:
    return _is_closed(shape.faces) and enclosed_volume(shape._local, shape.faces) > 0.0


def _quickhull(points: np.ndarray) -> Any:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise MeshError(f"a hull needs points that are not all in one plane, got {len(points)}: {error}") from error


def frozen(array: np.ndarray) -> np.ndarray:
    """Return the array, read-only from now on."""
    array.setflags(write=False)
    return array


def length(name: str, value: Any) -> float:
    """Return ``value`` [m], of which squares and cubes are still numbers for a solver.

    Raises:
        InvalidInputError: no number, shorter than 1 um or longer than 1,000 km.
    """
    return number(name, value, low=SHORTEST, high=LONGEST)


def lengths(name: str, value: Any, n: int) -> tuple[float, ...]:
    """Return ``value`` as n floats, each as ``length`` returns it [m]."""
    return tuple(length(f"{name}[{i}]", x) for i, x in enumerate(finite_array(name, value, (n,))))


def checked_mesh(vertices: Any, faces: Any) -> MeshArrays:
    """Return vertices (n, 3) float64 and faces (m, 3) int32, read-only.

    Raises:
        MeshError: not finite, an index out of range, or a face that names a vertex twice.
    """
    points = finite_array("vertices", vertices, ("n", 3), error=MeshError)
    triangles = index_array("faces", faces, ("m", 3), low=0, high=len(points), error=MeshError)
    a, b, c = triangles.T
    if (bad := np.flatnonzero((a == b) | (b == c) | (c == a))).size:
        raise MeshError(f"{bad.size} faces name a vertex twice, the first is {bad[0]}; remove them")
    return frozen(points), frozen(triangles)


def _is_closed(faces: np.ndarray) -> bool:
    """Return True if every directed edge is met by exactly one the other way."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    codes = np.sort(edges[:, 0] << 32 | edges[:, 1])
    return len(np.unique(codes)) == len(codes) and bool(np.array_equal(codes, np.sort(edges[:, 1] << 32 | edges[:, 0])))
