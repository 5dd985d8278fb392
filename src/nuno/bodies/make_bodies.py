"""Making bodies: one function for each shape. All take the keyword arguments of ``Body``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Unpack

from numpy.typing import ArrayLike

from nuno.bodies.body import Body, BodyOptions
from nuno.errors import InvalidInputError, MeshError
from nuno.mesh.load import MeshSource, has_faces, load_mesh
from nuno.shapes.compound import Compound
from nuno.shapes.shape import Box, Capsule, ClothMesh, Cylinder, Plane, Sheet, Sphere, TriangleMesh
from nuno.shapes.soft_shape import SoftBox, SoftCapsule, SoftCylinder, SoftMesh, SoftSphere, SoftTetrahedra, closed_mesh
from nuno.validation import flag, number, text


def box(size: ArrayLike, **options: Unpack[BodyOptions]) -> Body:
    """Return a box.

    Args:
        size: Edges along x, y and z (3,) [m].
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(Box(size), **options)  # type: ignore[arg-type]


def sphere(radius: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a sphere.

    Args:
        radius: [m].
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(Sphere(radius), **options)


def cylinder(radius: float, height: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a cylinder along z.

    Args:
        radius: [m].
        height: Along z [m].
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(Cylinder(radius, height), **options)


def capsule(radius: float, height: float, **options: Unpack[BodyOptions]) -> Body:
    """Return a capsule along z.

    Args:
        radius: [m].
        height: Between the centres of its half spheres [m].
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(Capsule(radius, height), **options)


def plane(**options: Unpack[BodyOptions]) -> Body:
    """Return the endless plane z = 0 of its own frame, solid below.

    Args:
        options: Those of ``Body``.

    Raises:
        InvalidInputError: an option of a wrong shape.
    """
    return Body(Plane(), **options)


def compound(parts: Sequence[Any], **options: Unpack[BodyOptions]) -> Body:
    """Return several shapes fixed to each other.

    Args:
        parts: A shape such as ``Box(...)``, or (shape, position (3,) [m]) or (shape, position, quaternion (w, x, y,
            z)), of each part, in the body's own frame.
        options: Those of ``Body``.

    Raises:
        InvalidInputError: no parts, or a plane or cloth among them.
    """
    return Body(Compound(tuple(parts) if isinstance(parts, Sequence) else parts), **options)


def mesh(source: MeshSource, **options: Unpack[BodyOptions]) -> Body:
    """Return a rigid surface.

    Args:
        source: A path, a trimesh, or vertices (n, 3) [m] and faces (m, 3) int.
        options: Those of ``Body``.

    Raises:
        MeshError: nothing to read, or not a usable mesh.
    """
    return Body(TriangleMesh(*load_mesh(source)), **options)


def sheet(size: ArrayLike, cells: tuple[int, int], **options: Unpack[BodyOptions]) -> Body:
    """Return a flat cloth.

    Args:
        size: Sides along x and y (2,) [m].
        cells: (nx, ny), of which each has a vertex at every corner.
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a size or a count of cells that is not positive, or an option of a wrong shape.
    """
    return Body(Sheet(size, cells), **options)  # type: ignore[arg-type]


def cloth_mesh(
    source: MeshSource | ArrayLike, faces: ArrayLike | None = None, rest: ArrayLike | None = None,
    **options: Unpack[BodyOptions],
) -> Body:  # fmt: skip
    """Return a cloth of any cut.

    Args:
        source: Its present shape: a path, a trimesh or (vertices, faces) [m] as ``mesh`` takes them; or vertices (n, 3)
            [m], where ``faces`` is given.
        faces: (m, 3) int, of vertices alone.
        rest: (n, 2) pattern or (n, 3) shape [m] in which nothing is stretched; None is the present shape.
        options: Those of ``Body``.

    Raises:
        MeshError: nothing to read, not a usable mesh, faces twice, or a rest shape with faces of no area.
    """
    if faces is None:
        return Body(ClothMesh(*load_mesh(source), rest), **options)  # type: ignore[arg-type]
    if has_faces(source):
        raise MeshError(f"faces are for vertices (n, 3), but {type(source).__name__} has its own; name rest=")
    return Body(ClothMesh(source, faces, rest), **options)  # type: ignore[arg-type]


def soft_box(
    size: ArrayLike, cells: tuple[int, int, int], *, mean_strain: bool = False, **options: Unpack[BodyOptions]
) -> Body:
    """Return a soft box of voxels.

    Each voxel is five tetrahedra, alternating so that their faces match. ``vertices`` are the corners of the voxels,
    those inside the box included, vertex (i, j, k) at (k (ny + 1) + j) (nx + 1) + i.

    Args:
        size: Edges along x, y and z (3,) [m].
        cells: Voxels along x, y and z (nx, ny, nz).
        mean_strain: Whether the five tetrahedra of a voxel share their mean deformation. Without it few voxels across
            are too stiff in bending and torsion (docs/soft-bodies.md).
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a size or a count of cells that is not positive, or an option of a wrong shape.
    """
    return Body(SoftBox(size, cells, mean_strain), **options)  # type: ignore[arg-type]


def soft_sphere(
    radius: float, cell: float, *, tetrahedraliser: Literal["fitted", "lattice"] = "fitted",
    mean_strain: bool = False, **options: Unpack[BodyOptions],
) -> Body:  # fmt: skip
    """Return a soft sphere.

    ``vertices`` are the tetrahedra's; the round surface that is drawn is ``Body.skin()``.

    Args:
        radius: [m].
        cell: Longest edge of a voxel [m].
        tetrahedraliser: "fitted" or "lattice", as for ``soft_mesh``.
        mean_strain: Whether whole voxels share their mean deformation, as in ``soft_box``.
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(SoftSphere(radius, cell, tetrahedraliser, mean_strain), **options)


def soft_cylinder(
    radius: float, height: float, cell: float, *, tetrahedraliser: Literal["fitted", "lattice"] = "fitted",
    mean_strain: bool = False, **options: Unpack[BodyOptions],
) -> Body:  # fmt: skip
    """Return a soft cylinder along z.

    ``vertices`` are the tetrahedra's; the round surface that is drawn is ``Body.skin()``.

    Args:
        radius: [m].
        height: Along z [m].
        cell: Longest edge of a voxel [m].
        tetrahedraliser: "fitted" or "lattice", as for ``soft_mesh``.
        mean_strain: Whether whole voxels share their mean deformation, as in ``soft_box``.
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(SoftCylinder(radius, height, cell, tetrahedraliser, mean_strain), **options)


def soft_capsule(
    radius: float, height: float, cell: float, *, tetrahedraliser: Literal["fitted", "lattice"] = "fitted",
    mean_strain: bool = False, **options: Unpack[BodyOptions],
) -> Body:  # fmt: skip
    """Return a soft capsule along z.

    ``vertices`` are the tetrahedra's; the round surface that is drawn is ``Body.skin()``.

    Args:
        radius: [m].
        height: Between the centres of its half spheres [m].
        cell: Longest edge of a voxel [m].
        tetrahedraliser: "fitted" or "lattice", as for ``soft_mesh``.
        mean_strain: Whether whole voxels share their mean deformation, as in ``soft_box``.
        options: Those of ``Body``.

    Raises:
        InvalidInputError: a length that is not positive and finite, or an option of a wrong shape.
    """
    return Body(SoftCapsule(radius, height, cell, tetrahedraliser, mean_strain), **options)


def soft_mesh(
    source: MeshSource, cell: float, *, tetrahedraliser: Literal["fitted", "lattice", "pytetwild"] = "fitted",
    mean_strain: bool = False, **options: Unpack[BodyOptions],
) -> Body:  # fmt: skip
    """Return the inside of a closed surface as a soft body.

    Its bounding box is divided into voxels of five tetrahedra, whose boundary is moved onto the surface; the surface is
    embedded in them (``Body.skin``). With ``tetrahedraliser="lattice"`` whole voxels around the surface move, whose
    flat faces make the contacts; parts thinner than a cell need it, and where there are some it is taken with a
    warning. With "pytetwild" the tetrahedra are fTetWild's (the extra ``tetrahedra``), and their own boundary
    is the skin.

    Args:
        source: A path, a trimesh or (vertices, faces) [m].
        cell: Longest edge of a voxel [m], or the length of an edge that pytetwild aims at.
        tetrahedraliser: "fitted", "lattice" or "pytetwild".
        mean_strain: Whether whole voxels share their mean deformation, as in ``soft_box``; elements beside a
            surface that is not aligned are in none.
        options: Those of ``Body``.

    Raises:
        MeshError: nothing to read, or a surface that is open, inside out or intersects itself.
        InvalidInputError: another tetrahedraliser, or a length that is not positive.
        MissingPackageError: pytetwild is asked for and not installed.
    """
    text("tetrahedraliser", tetrahedraliser)
    vertices, faces = load_mesh(source)
    if tetrahedraliser in ("fitted", "lattice"):
        return Body(SoftMesh(vertices, faces, cell, tetrahedraliser, mean_strain), **options)
    if tetrahedraliser != "pytetwild":
        raise InvalidInputError(f'tetrahedraliser must be "fitted", "lattice" or "pytetwild", got {tetrahedraliser!r}')
    if flag("mean_strain", mean_strain):
        raise InvalidInputError("mean_strain is for voxels, and pytetwild makes none; leave it out")
    from nuno.mesh.tetrahedraliser import fitted_tetrahedra

    points, triangles = closed_mesh(vertices, faces)
    return soft_tetrahedra(*fitted_tetrahedra(points, triangles, number("cell", cell, above=0.0)), **options)


def soft_tetrahedra(vertices: ArrayLike, tets: ArrayLike, **options: Unpack[BodyOptions]) -> Body:
    """Return a soft body of given tetrahedra.

    Args:
        vertices: (n, 3) [m].
        tets: (m, 4) int.
        options: Those of ``Body``.

    Raises:
        MeshError: an index out of range, a flat tetrahedron, or a vertex of none.
    """
    return Body(SoftTetrahedra(vertices, tets), **options)  # type: ignore[arg-type]
