"""Drawings: what to draw of a body, as triangles and line segments, in one of the modes of a viewer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.mesh.tetrahedra import FACES, Tetrahedra, boundary_by_element
from nuno.shapes.soft_shape import SoftShape
from nuno.validation import checked, finite_array, number

if TYPE_CHECKING:
    from nuno.bodies.body import Body

Mode = Literal["surface", "wireframe", "tetrahedra"]


@dataclass(frozen=True, eq=False)
class Drawing:
    """Triangles and lines to draw, in the world frame.

    Attributes:
        vertices: (n, 3), in a batch (worlds, n, 3), float64 [m].
        triangles: (t, 3) int32, counterclockwise from outside; none in a wireframe.
        segments: (s, 2) int32, each edge once.
        elements: (t,) int32, the tetrahedron that each triangle belongs to, for colours by strain or stress; or None.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    segments: np.ndarray
    elements: np.ndarray | None = None


@checked
def draw(
    body: Body, mode: Mode = "surface", *, explode: float = 1.3, slice_at: tuple[ArrayLike, ArrayLike] | None = None
) -> Drawing:
    """Return what to draw of a body as it is now.

    Args:
        body: The body.
        mode: "surface" is the skin; "wireframe" the edges of the mesh that moves, of a soft body those of its boundary;
            "tetrahedra" a soft body's inside, exploded, or cut where ``slice_at`` is given.
        explode: In the mode "tetrahedra", how many times as far from the body's centre each tetrahedron is drawn; 1 or
            more.
        slice_at: In that mode, a plane in the shape's own frame at rest: a point (3,) [m] and a normal (3,). Tetrahedra
            whose middle lies on the normal's side are left out, the same ones however the body moves.

    Raises:
        InvalidInputError: no such mode, tetrahedra of a body that has none, or a plane that is none or leaves nothing.
    """
    number("explode", explode, low=1.0)
    if slice_at is not None:
        slice_at = (finite_array("slice_at[0]", slice_at[0], (3,)), finite_array("slice_at[1]", slice_at[1], (3,)))
    if not isinstance(mode, str):
        raise InvalidInputError(f'mode must be "surface", "wireframe" or "tetrahedra", got {mode!r}')
    if mode == "surface":
        vertices, faces = body.skin()
        return Drawing(vertices, faces, _edges(faces))
    if mode == "wireframe":
        return Drawing(body.vertices, np.empty((0, 3), dtype=np.int32), _edges(body.faces))
    if mode != "tetrahedra":
        raise InvalidInputError(f'mode must be "surface", "wireframe" or "tetrahedra", got {mode!r}')
    if not isinstance(body.shape, SoftShape):
        raise InvalidInputError(f"only soft bodies have tetrahedra to draw; {body.name!r} is a {body.shape.kind}")
    made = body.shape.tetrahedra()
    if slice_at is None:
        return exploded(made, body.vertices, explode)
    return sliced(made, body.vertices, *slice_at)


def exploded(made: Tetrahedra, vertices: np.ndarray, factor: float) -> Drawing:
    """Return every tetrahedron by itself, its middle ``factor`` times as far from the middle of all.

    Args:
        made: The tetrahedra.
        vertices: (n, 3) or (worlds, n, 3) [m], where their vertices are.
        factor: 1 or more.
    """
    corners = vertices[..., made.tets, :]
    middles = corners.mean(axis=-2, keepdims=True)
    centre = vertices.mean(axis=-2)[..., None, None, :]
    moved = corners + (factor - 1.0) * (middles - centre)
    count = len(made.tets)
    each = 4 * np.arange(count, dtype=np.int32)[:, None, None]
    triangles = (each + FACES.astype(np.int32)).reshape(-1, 3)
    elements = np.repeat(np.arange(count, dtype=np.int32), 4)
    return Drawing(moved.reshape(*vertices.shape[:-2], 4 * count, 3), triangles, _edges(triangles), elements)


def sliced(made: Tetrahedra, vertices: np.ndarray, point: np.ndarray, normal: np.ndarray) -> Drawing:
    """Return the boundary of those tetrahedra whose middle, at rest, is not on the normal's side of a plane.

    Args:
        made: The tetrahedra, at rest.
        vertices: (n, 3) or (worlds, n, 3) [m], where their vertices are now.
        point: (3,) [m], a point of the plane, in the frame of ``made``.
        normal: (3,), of any length.

    Raises:
        InvalidInputError: the normal is zero, or nothing is left.
    """
    if not normal.any():
        raise InvalidInputError("slice_at needs a normal that is not zero")
    kept = np.flatnonzero((made.vertices[made.tets].mean(axis=1) - point) @ normal <= 0.0)
    if not len(kept):
        raise InvalidInputError(
            f"no tetrahedron lies behind the plane through {point.tolist()} with the normal {normal.tolist()}"
        )
    faces, elements = boundary_by_element(made.tets[kept])
    return Drawing(vertices, faces, _edges(faces), kept[elements].astype(np.int32))


def _edges(faces: np.ndarray) -> np.ndarray:
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int32)
