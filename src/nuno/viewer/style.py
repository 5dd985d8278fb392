"""Styles: in which way a body is drawn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body, Color
from nuno.errors import InvalidInputError
from nuno.shapes.color import rgb
from nuno.shapes.soft_shape import SoftShape
from nuno.validation import finite_array, number
from nuno.viewer.vertex_values import QUANTITIES, Quantity, check_quantity, colours_of
from nuno.world.drawing import Mode, draw

if TYPE_CHECKING:
    from nuno.viewer.marks import DrawnCamera

MODES = ("surface", "wireframe", "tetrahedra")


@dataclass(frozen=True, eq=False)
class Style:
    """The style in which a body is drawn.

    Attributes:
        mode: "surface", "wireframe" or "tetrahedra".
        explode: As ``nuno.draw`` takes it.
        slice_at: Likewise.
        color: In place of the body's own, or None.
        opacity: In (0, 1].
        visible: Whether it is drawn at all.
        color_by: "strain", "layer" or "contact": the quantity that colours its vertices, or None.
        color_range: The values of the first and the last colour, or None for the quantity's own.
    """

    mode: Mode = "surface"
    explode: float = 1.3
    slice_at: tuple[ArrayLike, ArrayLike] | None = None
    color: Color | None = None
    opacity: float = 1.0
    visible: bool = True
    color_by: Quantity | None = None
    color_range: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.mode, str) or self.mode not in MODES:
            raise InvalidInputError(f'mode must be "surface", "wireframe" or "tetrahedra", got {self.mode!r}')
        number("explode", self.explode, low=1.0)
        number("opacity", self.opacity, above=0.0, high=1.0)
        if self.color is not None:
            rgb(self.color)
        if self.color_range is not None:
            low, high = finite_array("color_range", self.color_range, (2,))
            if low >= high:
                raise InvalidInputError(f"color_range must increase, got {self.color_range!r}")

    def check(self, body: Body) -> None:
        """Check that the body can be drawn so.

        Raises:
            InvalidInputError: tetrahedra of a body that has none, a plane that leaves nothing, or a quantity that the
                body does not have.
        """
        if self.color_by is not None:
            check_quantity(body, self.color_by)
        draw(body, self.mode, explode=self.explode, slice_at=self.slice_at)

    def points(self, body: Body, vertices: np.ndarray) -> np.ndarray:
        """Return the vertices of ``nuno.draw``, (k, 3), when the body's are at (n, 3) [m]."""
        if not isinstance(body.shape, SoftShape) or self.mode == "wireframe":
            return vertices
        made = body.shape.tetrahedra()
        if self.mode == "surface":
            return made.skin_vertices(vertices)
        if self.slice_at is not None:
            return vertices
        corners = vertices[made.tets]
        away = corners.mean(axis=1, keepdims=True) - vertices.mean(axis=0)
        return (corners + (self.explode - 1.0) * away).reshape(-1, 3)

    def colors(self, body: Body, values: np.ndarray) -> np.ndarray:
        """Return the colours of ``points``, (k, 3) uint8, for values (n,) of the body's vertices."""
        assert self.color_by is not None
        low, high = self.color_range or (0.0, QUANTITIES[self.color_by][1])
        if isinstance(body.shape, SoftShape) and self.mode != "wireframe":
            made = body.shape.tetrahedra()
            if self.mode == "surface":
                values = made.skin_vertices(np.repeat(values[:, None], 3, axis=1))[:, 0]
            elif self.slice_at is None:
                values = values[made.tets].ravel()
        return colours_of(values, low, high)


@dataclass(eq=False)
class Styles:
    """The styles of a viewer, and what it marks.

    Attributes:
        usual: Of all bodies but those in ``own``.
        own: By body key.
        grips: Whether held points are marked.
        contacts: Whether contact forces are drawn.
        grip_forces: Whether the forces that grips bear are drawn.
        edges: Whether surfaces are drawn with their outlines: borders of cloths, sharp edges of solids.
        force_scale: Length of a force's arrow [m/N].
        cameras: Those whose frusta are drawn, by name.
    """

    usual: Style = Style()
    own: dict[str, Style] = field(default_factory=dict)
    grips: bool = True
    contacts: bool = False
    grip_forces: bool = False
    edges: bool = True
    force_scale: float = 0.02
    cameras: dict[str, DrawnCamera] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # one object for all bodies: what is drawn is made anew where a body's style is another
        self._solid = replace(self.usual, mode="surface") if self.usual.mode == "tetrahedra" else self.usual

    def of(self, body: Body) -> Style:
        """Return the style of a body; where the usual one is of tetrahedra and it has none, that of its surface."""
        own = self.own.get(body.key)
        if own is not None:
            return own
        return self.usual if isinstance(body.shape, SoftShape) else self._solid
