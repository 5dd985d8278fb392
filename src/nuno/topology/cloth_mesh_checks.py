"""Checks of a cloth's triangles, before anything is made of them."""

from __future__ import annotations

import numpy as np

from nuno.errors import MeshError
from nuno.topology.patches import neighbours


def check_cloth_mesh(rest: np.ndarray, faces: np.ndarray, vertices: np.ndarray) -> None:
    """Check that a mesh can be a cloth.

    Args:
        rest: (n, 3) [m], where nothing is stretched.
        faces: (m, 3) int.
        vertices: (n, 3) [m], its present shape.

    Raises:
        MeshError: a triangle without area, an edge of three faces, an unused vertex, or triangles that lie side by side
            without sharing their vertices.
    """
    check_areas(rest, faces)
    _, across = neighbours(faces)
    sharing = np.count_nonzero(across >= 0) // 2
    merged = len(np.unique(vertices, axis=0))
    # each facet, of one or two triangles, has vertices of its own, as in an STL; where a slit is cut there are few such
    if merged < len(vertices) and 2 * sharing <= len(faces):
        raise MeshError(
            f"the {len(faces)} triangles share {sharing} edges only, and {len(vertices) - merged} of {len(vertices)} "
            "vertices lie where others do: they would fall apart. trimesh's mesh.merge_vertices() joins them"
        )


def check_areas(rest: np.ndarray, faces: np.ndarray) -> None:
    """Check that each triangle has an area in the rest shape (n, 3), and each vertex a triangle.

    Raises:
        MeshError: one has not.
    """
    x = rest[faces]
    double = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    longest = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)
    bad = np.nonzero(double <= 1e-6 * longest**2)[0]
    if len(bad):
        raise MeshError(
            f"{len(bad)} triangles have no area in the rest shape (the first is face {bad[0]}); trimesh's "
            "mesh.update_faces(mesh.nondegenerate_faces()) takes them out"
        )
    unused = np.setdiff1d(np.arange(len(rest)), faces)
    if len(unused):
        raise MeshError(
            f"{len(unused)} vertices belong to no face (the first is {unused[0]}); trimesh's "
            "mesh.remove_unreferenced_vertices() takes them out"
        )
