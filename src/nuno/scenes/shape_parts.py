"""The shapes that a shape is made of."""

from __future__ import annotations

import numpy as np

from nuno.shapes import quaternion as quat
from nuno.shapes.compound import Compound
from nuno.shapes.coordinates import compose
from nuno.shapes.shape import Shape


def parts_of(shape: Shape) -> list[tuple[Shape, np.ndarray, np.ndarray]]:
    """Return the shapes that a shape is made of, compounds in compounds opened, with their places and turns."""
    if not isinstance(shape, Compound):
        return [(shape, np.zeros(3), quat.IDENTITY)]
    found = []
    for part, position, turn in shape.parts:
        outer = (np.array(position), np.array(turn))
        found += [(own, *compose(outer, (place, own_turn))) for own, place, own_turn in parts_of(part)]
    return found
