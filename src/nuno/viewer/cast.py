"""Casts: the actors that show one body, in each of the worlds that are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.body import Body
from nuno.coordinates import Pose, apply, invert
from nuno.drawing import draw
from nuno.shape import Plane, Shape
from nuno.viewer.actor import Actor, light_of
from nuno.viewer.style import Style

CREASE = 35.0  # [deg] between faces, above which an edge of a solid is drawn sharp


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
class Garment:
    """What is drawn in place of a body's own shape: a visual mesh of a robot's link.

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


class Cast:
    """The actors of one body, in one style and, while it is rigid, in one shape.

    Args:
        body: The body.
        style: How it is drawn.
        places: The worlds that are looked at.
        garments: What is drawn in its place; None is its own shape.
    """

    def __init__(
        self, body: Body, style: Style, places: Sequence[Place], garments: Sequence[Garment] | None = None
    ) -> None:
        self.body, self.style = body, style
        self.is_rigid = _is_rigid(body)
        self._deformed, self._color = body._deformed, body.color
        self._raw: Any = None
        self._read()
        if garments is None:
            shown = places[:1] if isinstance(body.shape, Plane) else places  # endless planes would lie in each other
            self.actors = [self._actor(place) for place in shown]
            self._indices = [place.index for place in shown]
        else:
            self.actors = [_dressed(garment, place, style) for place in places for garment in garments]
            self._indices = [place.index for place in places for _ in garments]

    def fits(self, style: Style) -> bool:
        """Return whether the body can still be shown by these actors."""
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
        """Return where the rigid body was at the last look, for each actor."""
        place, turn = self._raw
        return [(place[k] if place.ndim == 2 else place, turn[k] if turn.ndim == 2 else turn) for k in self._indices]

    def shift(self) -> None:
        """Set the points of the actors of a body that deforms to those of the last look."""
        for actor, k in zip(self.actors, self._indices, strict=True):
            actor.shift(self.style.points(self.body, self._vertices(k)) + actor.offset)

    def _read(self) -> None:
        if not self.is_rigid:
            self._raw = (self.body._vertices(), None)
        elif self.body._dynamics is None and self.body._parent is None:
            self._raw = (self.body._position, self.body._quaternion)
        else:
            self._raw = self.body._pose()

    def _vertices(self, index: int) -> np.ndarray:
        vertices = self._raw[0] if not self.is_rigid else self.body._rigid_vertices(self._raw)
        return vertices[index if len(vertices) > 1 else 0] if vertices.ndim == 3 else vertices

    def _actor(self, place: Place) -> Actor:
        body, style = self.body, self.style
        drawing = draw(body, style.mode, explode=style.explode, slice_at=style.slice_at)
        points = style.points(body, self._vertices(place.index))
        if self.is_rigid:
            turned, k = self._raw, place.index
            points = apply(invert(tuple(part[k] if part.ndim == 2 else part for part in turned)), points)  # type: ignore[arg-type]
        else:
            points = points + place.offset
        edges = np.empty(0, np.uint32) if style.mode == "surface" else drawing.segments.astype(np.uint32).ravel()
        crease = 0.0 if style.mode == "tetrahedra" else None if body.shape.is_cloth else CREASE
        return Actor(
            (place.root, body.name), "mesh" if len(drawing.triangles) else "lines", points, offset=place.offset,
            color=light_of(body.color if style.color is None else style.color), opacity=style.opacity,
            triangles=drawing.triangles.astype(np.uint32).ravel(), lines=edges, crease=crease,
            endless=isinstance(body.shape, Plane),
        )  # fmt: skip


def _is_rigid(body: Body) -> bool:
    return body._dynamics is None or body._dynamics.is_rigid


def _dressed(garment: Garment, place: Place, style: Style) -> Actor:
    vertices, faces = garment.shape.mesh()
    return Actor(
        (place.root, *garment.path), "mesh", vertices, offset=place.offset, inner=garment.pose,
        color=light_of(garment.color if style.color is None else style.color), opacity=style.opacity,
        triangles=faces.astype(np.uint32).ravel(), lines=np.empty(0, np.uint32), crease=CREASE, endless=False,
    )  # fmt: skip
