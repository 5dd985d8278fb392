"""Surfaces for other programs: as trimesh objects, and as mesh files."""

from __future__ import annotations

import os
from pathlib import Path as FilePath
from typing import Any, Protocol

import numpy as np

from nuno.errors import InvalidInputError
from nuno.files.whole_file import file_path, write_whole
from nuno.shapes.color import rgb

EXTENSIONS = (".glb", ".obj", ".ply")


class SkinnedBody(Protocol):
    """A body with a surface that is drawn."""

    @property
    def color(self) -> str | tuple[float, float, float]:
        """A name or (r, g, b) in [0, 1]."""

    def skin(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (k, 3), in a batch (worlds, k, 3) [m], and faces (m, 3)."""


def to_trimesh(body: SkinnedBody, world: int | None = None) -> Any:
    """Return a body's surface as it is now, a ``trimesh.Trimesh`` in the world frame with vertex colours.

    Args:
        body: The body; of a soft one, its skin.
        world: Which world of a batch; None for a single world.

    Raises:
        InvalidInputError: a batch without ``world``, or out of range.
    """
    import trimesh

    vertices, faces = body.skin()
    color = np.append(np.round(rgb(body.color) * 255.0), 255.0).astype(np.uint8)
    points = one_world(vertices, world)
    return trimesh.Trimesh(points, faces, vertex_colors=np.tile(color, (len(points), 1)), process=False)


def write_surface(path: str | os.PathLike[str], body: SkinnedBody, world: int | None) -> None:
    """Write a body's surface to a mesh file; see ``nuno.export_body``."""
    goal = file_path(path)
    check_extension(goal, *EXTENSIONS)
    write_whole(goal, to_trimesh(body, world).export(file_type=goal.suffix[1:].lower()))


def check_extension(path: FilePath, *extensions: str) -> None:
    """Check how a path ends.

    Raises:
        InvalidInputError: with none of the extensions.
    """
    if path.suffix.lower() not in extensions:
        raise InvalidInputError(f"the file must end with {' or '.join(extensions)}, got {path.name!r}")


def one_world(vertices: np.ndarray, world: int | None, axis: int = 0) -> np.ndarray:
    """Return the vertices of one world, of those of a single world or of a batch, whose axis is ``axis``.

    Raises:
        InvalidInputError: a batch without ``world``, or out of range.
    """
    count = vertices.shape[axis] if vertices.ndim == axis + 3 else 1
    if world is None and count > 1:
        raise InvalidInputError(f"the body is in a batch of {count} worlds; say which, from 0 to {count - 1}")
    index = 0 if world is None else world
    if isinstance(index, bool) or not isinstance(index, int | np.integer) or not 0 <= index < count:
        raise InvalidInputError(f"world must be a whole number in [0, {count - 1}], got {world!r}")
    return vertices.take(index, axis=axis) if vertices.ndim == axis + 3 else vertices
