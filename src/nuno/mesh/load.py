"""Meshes from files and from trimesh objects."""

from __future__ import annotations

import logging
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from nuno.errors import MeshError

MeshSource = Any  # a path, a trimesh.Trimesh, or (vertices, faces)

USUAL_EXTENT = 20.0
"""Extent [m] above which a file's numbers are probably not metres: a mug of 8 cm in millimetres is 80."""

_log = logging.getLogger(__name__)


def load_mesh(source: MeshSource) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a mesh.

    Vertices of a file at the same place become one. Files repeat them where texture or normal jump, and a cloth would
    come apart there. A file larger than `USUAL_EXTENT` gives a warning.

    Args:
        source: A path of a file that trimesh reads (STL, OBJ, PLY, GLB ...; its numbers are metres), a
            ``trimesh.Trimesh`` (or anything with ``vertices`` and ``faces``), or a pair (vertices, faces).

    Raises:
        MeshError: the file is not there, cannot be read, or holds no triangles.
    """
    if isinstance(source, str | PathLike):
        return _from_file(Path(source))
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return np.asarray(source.vertices), np.asarray(source.faces)
    if isinstance(source, tuple | list) and len(source) == 2:
        return np.asarray(source[0]), np.asarray(source[1])
    raise MeshError(f"a mesh is a path, a trimesh.Trimesh or (vertices, faces), got {type(source).__name__}")


def has_faces(source: Any) -> bool:
    """Return True if a source of a mesh is more than vertices: a path, a trimesh.Trimesh, or (vertices, faces)."""
    if isinstance(source, str | PathLike) or hasattr(source, "faces"):
        return True
    # three numbers make a vertex
    return isinstance(source, tuple | list) and len(source) == 2 and np.ndim(source[0]) == 2


def _from_file(path: Path) -> tuple[np.ndarray, np.ndarray]:
    if not path.is_file():
        raise MeshError(f"there is no mesh file {str(path)!r}")
    import trimesh

    try:
        loaded: Any = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their format's parser raises
        raise MeshError(f"cannot read {str(path)!r} as a mesh: {error}") from error
    if len(getattr(loaded, "faces", ())) == 0:
        raise MeshError(f"{str(path)!r} holds no triangles")
    if len(np.unique(loaded.vertices, axis=0)) < len(loaded.vertices):  # others keep their order
        loaded.merge_vertices(merge_tex=True, merge_norm=True)
    if (extent := float(np.ptp(loaded.vertices, axis=0).max())) > USUAL_EXTENT:
        _log.warning(
            "%r is %.4g m long, as its numbers are taken for metres. If they are millimetres, read it by "
            "mesh = trimesh.load(path, force='mesh'), shrink it by mesh.apply_scale(0.001), and give the mesh",
            str(path), extent,
        )  # fmt: skip
    return np.asarray(loaded.vertices), np.asarray(loaded.faces)
