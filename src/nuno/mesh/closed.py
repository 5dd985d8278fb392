"""Checks that a mesh bounds a volume: closed, looking outwards, and not passing through itself."""

from __future__ import annotations

import numpy as np

from nuno.errors import MeshError
from nuno.mesh.crossings import crossing_faces


def check_closed(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Check that a mesh bounds a volume.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int.

    Raises:
        MeshError: it is open, its faces look to different sides or inwards, or it intersects itself; with what is
            wrong, in how many places, and how trimesh could mend it.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, edge, shared = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    if single := int((shared == 1).sum()):
        raise _unusable(
            f"is open: {single} edges belong to one face only, and a volume needs a closed surface",
            "mesh.merge_vertices() where it was cut into loose faces, otherwise trimesh.repair.fill_holes(mesh)",
        )
    if crowded := int((shared > 2).sum()):
        raise _unusable(
            f"is no surface: {crowded} edges belong to more than two faces",
            "mesh.update_faces(mesh.unique_faces()) where faces are there twice, or mesh.split(), a body of each",
        )
    forward = np.bincount(edge.ravel(), edges[:, 0] < edges[:, 1], minlength=len(shared))
    if twisted := int((forward != 1).sum()):
        raise _unusable(
            f"has neighbouring faces that look to different sides, at {twisted} edges",
            "trimesh.repair.fix_normals(mesh)",
        )
    if (volume := enclosed_volume(vertices, faces)) <= 0.0:
        raise _unusable(
            f"is inside out: it encloses {volume:.3g} m3, as its {len(faces)} faces run clockwise seen from outside",
            "mesh.invert()",
        )
    if len(crossings := crossing_faces(vertices, faces)):
        first = tuple(int(face) for face in crossings[0])
        raise _unusable(
            f"intersects itself: {len(crossings)} pairs of faces pass through each other, first {first}",
            "trimesh.boolean.union(mesh.split()) where its parts overlap, or a surface made anew, "
            "mesh.voxelized(pitch).fill().marching_cubes, which needs scikit-image",
        )


def _unusable(wrong: str, repair: str) -> MeshError:
    return MeshError(f"the mesh {wrong}. trimesh may mend it: {repair} (pip install 'trimesh[easy]')")


def enclosed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the volume inside a closed mesh [m3], negative where its faces look inwards."""
    a, b, c = (vertices[faces[:, corner]] - vertices[faces[0, 0]] for corner in range(3))
    return float(np.einsum("fx,fx->", a, np.cross(b, c)) / 6.0)
