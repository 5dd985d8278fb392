"""Body objects: the scene objects that show one body, in each of the worlds that are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.shapes.coordinates import Pose, apply, invert
from nuno.shapes.shape import Plane, Shape
from nuno.viewer.outline import CREASE, outline
from nuno.viewer.scene_object import SceneObject, light_of
from nuno.viewer.style import Style
from nuno.viewer.vertex_values import vertex_layers, vertex_strains
from nuno.world.drawing import draw


@dataclass(frozen=True, eq=False)
class Place:
    """A world that is looked at.

    Attributes:
        index: Its number in the batch.
        root: What it is called in the page's tree.
        offset: (3,) float [m] that it is drawn away from its place.
    """

    index: int
    root: str
    offset: np.ndarray


@dataclass(frozen=True, eq=False)
class VisualMesh:
    """The visual mesh of a robot's link, drawn in place of the body's own shape.

    Attributes:
        path: Its place in the page's tree.
        shape: The mesh.
        pose: Where that is in the body's frame.
        color: (r, g, b) in [0, 1].
    """

    path: tuple[str, ...]
    shape: Shape
    pose: Pose
    color: Any


class BodyObjects:
    """The scene objects of one body, in one style and, while it is rigid, in one shape.

    Args:
        body: The body.
        style: How it is drawn.
        places: The worlds that are looked at.
        visual_meshes: What is drawn in its place; None is its own shape.
        edges: Whether surfaces are drawn with their outlines.
    """

    def __init__(
        self, body: Body, style: Style, places: Sequence[Place], visual_meshes: Sequence[VisualMesh] | None = None,
        edges: bool = True,
    ) -> None:  # fmt: skip
        self.body, self.style, self._edges = body, style, edges
        self._is_dressed = visual_meshes is not None
        self.is_rigid = _is_rigid(body)
        self._deformed, self._color = body._deformed, body.color
        self._raw: Any = None
        self._read()
        if visual_meshes is None:
            shown = places[:1] if isinstance(body.shape, Plane) else places  # endless planes would lie in each other
            self.objects = [self._object(place) for place in shown]
            self.indices = [place.index for place in shown]
        else:
            self.objects = [_dressed(visual_mesh, place, style) for place in places for visual_mesh in visual_meshes]
            self.indices = [place.index for place in places for _ in visual_meshes]

    def fits(self, style: Style) -> bool:
        """Return True if the body can still be shown by these scene objects."""
        body = self.body
        return (
            style is self.style
            and body.color == self._color
            and self.is_rigid == _is_rigid(body)
            and (not self.is_rigid or body._deformed is self._deformed)
        )

    def look(self) -> bool:
        """Take the body's present state, under the world's lock, and return whether it may have changed."""
        before = self._raw
        self._read()
        return before is None or self._raw[0] is not before[0] or self._raw[1] is not before[1]

    def poses(self) -> list[Pose]:
        """Return where the rigid body was at the last look, for each scene object."""
        place, turn = self._raw
        return [(place[k] if place.ndim == 2 else place, turn[k] if turn.ndim == 2 else turn) for k in self.indices]

    def shift(self) -> None:
        """Set the points of the scene objects of a body that deforms to those of the last look."""
        for obj, k in zip(self.objects, self.indices, strict=True):
            obj.shift(self.style.points(self.body, self._vertices(k)) + obj.offset)

    def tint(self, values: np.ndarray | None = None) -> None:
        """Colour the vertices by the style's quantity at the last look.

        Args:
            values: Those of the vertices, (worlds, n), where the quantity depends on more than their places.
        """
        quantity = self.style.color_by
        if quantity is None or self._is_dressed:
            return
        for obj, k in zip(self.objects, self.indices, strict=True):
            if values is not None:
                own = values[k if len(values) > 1 else 0]
            elif quantity == "strain":
                own = vertex_strains(self.body, self._vertices(k))
            else:
                own = vertex_layers(self.body.shape.mesh()[1], self._vertices(k))
            obj.tint(self.style.colors(self.body, own))

    def _read(self) -> None:
        if not self.is_rigid:
            self._raw = (self.body._vertices(), None)
        elif not self.body.is_dynamic and self.body._parent is None:
            self._raw = (self.body._position, self.body._quaternion)
        else:
            self._raw = self.body.pose()

    def _vertices(self, index: int) -> np.ndarray:
        vertices = self._raw[0] if not self.is_rigid else self.body._rigid_vertices(self._raw)
        return vertices[index if len(vertices) > 1 else 0] if vertices.ndim == 3 else vertices

    def _object(self, place: Place) -> SceneObject:
        body, style = self.body, self.style
        drawing = draw(body, style.mode, explode=style.explode, slice_at=style.slice_at)
        points = style.points(body, self._vertices(place.index))
        if self.is_rigid:
            turned, k = self._raw, place.index
            points = apply(invert(tuple(part[k] if part.ndim == 2 else part for part in turned)), points)  # type: ignore[arg-type]
        else:
            points = points + place.offset
        crease = 0.0 if style.mode == "tetrahedra" else None if body.shape.is_cloth else CREASE
        if style.mode != "surface":
            edges = drawing.segments.astype(np.uint32).ravel()
        elif self._edges and not isinstance(body.shape, Plane):
            edges = outline(points, drawing.triangles, crease)
        else:
            edges = np.empty(0, np.uint32)
        return SceneObject(
            (place.root, body.name), "mesh" if len(drawing.triangles) else "lines", points, offset=place.offset,
            color=light_of(body.color if style.color is None else style.color), opacity=style.opacity,
            triangles=drawing.triangles.astype(np.uint32).ravel(), lines=edges, crease=crease,
            endless=isinstance(body.shape, Plane),
        )  # fmt: skip


def _is_rigid(body: Body) -> bool:
    return body._dynamics is None or body._dynamics.is_rigid


def _dressed(visual_mesh: VisualMesh, place: Place, style: Style) -> SceneObject:
    vertices, faces = visual_mesh.shape.mesh()
    return SceneObject(
        (place.root, *visual_mesh.path), "mesh", vertices, offset=place.offset, inner=visual_mesh.pose,
        color=light_of(visual_mesh.color if style.color is None else style.color), opacity=style.opacity,
        triangles=faces.astype(np.uint32).ravel(), lines=np.empty(0, np.uint32), crease=CREASE, endless=False,
    )  # fmt: skip
