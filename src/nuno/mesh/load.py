"""Meshes from files and from trimesh objects."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from nuno.errors import MeshError

MeshSource = Any  # a path, a trimesh.Trimesh, or (vertices, faces)


def load_mesh(source: MeshSource) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a mesh.

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
    return np.asarray(loaded.vertices), np.asarray(loaded.faces)
