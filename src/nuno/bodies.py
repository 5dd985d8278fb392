"""Making bodies: one function for each shape. All take the keyword arguments of ``Body``."""

from __future__ import annotations

from typing import Unpack

from numpy.typing import ArrayLike

from nuno.body import Body, BodyOptions
from nuno.mesh.load import MeshSource, load_mesh
from nuno.shape import Box, Capsule, ClothMesh, Cylinder, Plane, Sheet, Sphere, TriangleMesh


def box(size: ArrayLike, **options: Unpack[BodyOptions]) -> Body:
    """Return a box with edges ``size`` (3,) [m]; the options are those of ``Body``."""
    return Body(Box(size), **options)  # type: ignore[arg-type]


def sphere(radius: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a sphere of ``radius`` [m]; the options are those of ``Body``."""
    return Body(Sphere(radius), **options)


def cylinder(radius: float, height: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a cylinder along z of ``radius`` and ``height`` [m]; the options are those of ``Body``."""
    return Body(Cylinder(radius, height), **options)


def capsule(radius: float, height: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a capsule along z, ``height`` [m] between its half spheres; options as for ``Body``."""
    return Body(Capsule(radius, height), **options)


def plane(**options: Unpack[BodyOptions]) -> Body:
    """Return the endless plane z = 0 of its own frame, solid below; the options are those of ``Body``."""
    return Body(Plane(), **options)


def mesh(source: MeshSource, **options: Unpack[BodyOptions]) -> Body:
    """Return a rigid surface from a path, a trimesh or (vertices, faces) [m]; options as for ``Body``.

    Raises:
        MeshError: nothing to read, or not a usable mesh.
    """
    return Body(TriangleMesh(*load_mesh(source)), **options)


def sheet(size: ArrayLike, cells: tuple[int, int], **options: Unpack[BodyOptions]) -> Body:
    """Return a flat cloth of ``size`` (2,) [m] along x, y in ``cells`` (nx, ny); options as for ``Body``."""
    return Body(Sheet(size, cells), **options)  # type: ignore[arg-type]


def cloth_mesh(
    vertices: ArrayLike, faces: ArrayLike, rest: ArrayLike | None = None, **options: Unpack[BodyOptions]
) -> Body:
    """Return a cloth of any cut.

    Args:
        vertices: (n, 3) [m], its present shape.
        faces: (m, 3) int.
        rest: (n, 2) pattern or (n, 3) shape [m] in which nothing is stretched; None is ``vertices``.
        options: Those of ``Body``.

    Raises:
        MeshError: not a usable mesh, or a rest shape with faces of no area.
    """
    return Body(ClothMesh(vertices, faces, rest), **options)  # type: ignore[arg-type]
