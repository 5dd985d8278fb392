"""Shapes made of several: an L, a chair, a hammer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from nuno.errors import InvalidInputError
from nuno.mesh.primitives import MeshArrays
from nuno.shapes import quaternion
from nuno.shapes.shape import Plane, Shape
from nuno.validation import finite_array

Part = tuple[Shape, tuple[float, ...], tuple[float, ...]]


@dataclass(frozen=True)
class Compound(Shape):
    """Several shapes, fixed to each other.

    Overlapping parts count twice in mass and inertia.

    Attributes:
        parts: (shape, position (3,) [m], quaternion (w, x, y, z)) of each, in the compound's own frame. A plain shape
            or a pair may stand for those at the origin, unturned. A part that is not convex counts as its hull when
            the body is dynamic.
    """

    parts: tuple[Part, ...]
    kind: ClassVar[str] = "compound"

    def __post_init__(self) -> None:
        given: Sequence[Any] = self.parts if isinstance(self.parts, tuple | list) else ()
        if not given:
            raise InvalidInputError("parts must be (shape, position, quaternion) of at least one shape, got none")
        object.__setattr__(self, "parts", tuple(_checked(k, part) for k, part in enumerate(given)))

    def mesh(self) -> MeshArrays:
        """Return the triangles of all parts, those inside others included."""
        points, faces, count = [], [], 0
        for shape, position, turn in self.parts:
            own, triangles = shape.mesh()
            points.append(quaternion.rotate(np.array(turn), own) + position)
            faces.append(triangles + count)
            count += len(own)
        vertices, triangles = np.concatenate(points), np.concatenate(faces).astype(np.int32)
        vertices.setflags(write=False)
        triangles.setflags(write=False)
        return vertices, triangles


def _checked(k: int, part: Any) -> Part:
    pieces = tuple(part) if isinstance(part, tuple | list) else (part,)
    shape = pieces[0] if pieces else None
    if not isinstance(shape, Shape) or isinstance(shape, Plane) or shape.is_cloth or len(pieces) > 3:
        raise InvalidInputError(
            f"parts[{k}] must be (shape, position, quaternion) of a box, sphere, cylinder, capsule, mesh or compound, "
            f"got {part!r}"
        )
    position = finite_array(f"parts[{k}] position", pieces[1] if len(pieces) > 1 else np.zeros(3), (3,))
    turn = quaternion.unit(f"parts[{k}] quaternion", pieces[2] if len(pieces) > 2 else quaternion.IDENTITY, (4,))
    return shape, tuple(position.tolist()), tuple(turn.tolist())
