"""Static bodies as the rigid solver of their world was told of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.errors import BodyStateError
from nuno.shapes.coordinates import Pose

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.shapes.shape import Shape

SAME_SHAPE = 1e-12
"""[m] What doubles round where the same shape stands elsewhere."""


class ShapedBody(Protocol):
    """A static body, or the record of one, as the solver takes it."""

    @property
    def shape(self) -> Shape:
        """Its shape, before anything deformed it."""

    @property
    def friction(self) -> Any:
        """Coulomb's coefficient, a number or (worlds,)."""

    @property
    def group(self) -> int:
        """Bit mask of the collision groups that it is in."""

    @property
    def collides_with(self) -> int:
        """Bit mask of the groups that it touches."""

    @property
    def thickness(self) -> float:
        """[m]."""


@dataclass
class StaticPlace:
    """A static body as the rigid solver was told of it.

    Attributes:
        slot: Its slot.
        what: Shape, friction, groups and thickness; None of a body that the solver is yet to forget.
        deformed: Its vertices (worlds, n, 3) [m] where it was deformed, and the pose that they belong to.
        where: Its pose, as bytes; None where the solver has moved it since.
    """

    slot: int
    what: tuple[Any, ...] | None
    deformed: tuple[np.ndarray, Pose] | None
    where: tuple[bytes, bytes] | None

    def is_of(self, body: ShapedBody, deformed: tuple[np.ndarray, Pose] | None) -> bool:
        """Return True if this is what a body is, or was when it was saved, but for where it is."""
        return self.what == what_of(body) and same_deformation(self.deformed, deformed)


def what_of(body: ShapedBody) -> tuple[Any, ...]:
    """Return what the solver takes of a static body, besides its pose and how it was deformed."""
    return body.shape, np.asarray(body.friction).tobytes(), body.group, body.collides_with, body.thickness


def same_deformation(a: tuple[np.ndarray, Pose] | None, b: tuple[np.ndarray, Pose] | None) -> bool:
    """Return True if two bodies were deformed in the same way: the same vertices, and the pose that they belong to."""
    if a is None or b is None:
        return a is b
    return a[0] is b[0] and all(np.array_equal(x, y) for x, y in zip(a[1], b[1], strict=True))


def one_shape(body: Body) -> np.ndarray:
    """Return the vertices (n, 3) [m] of a deformed body in its own frame, where all worlds have deformed it alike.

    Raises:
        BodyStateError: it is deformed otherwise in some world.
    """
    vertices = body.local_vertices()
    own = vertices.reshape(-1, *vertices.shape[-2:])
    if np.abs(own - own[0]).max() > SAME_SHAPE:
        raise BodyStateError(
            f"{body.name!r} is deformed otherwise in each world, and a Rigid has one shape: attach it before the "
            "worlds part, or in a world alone (imagine(1, world=k))"
        )
    return own[0]
