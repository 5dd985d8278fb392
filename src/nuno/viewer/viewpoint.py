"""Views: where the page looks from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

FIELD = 45.0  # [deg] from the bottom to the top of the picture
FROM = np.array([0.72, -0.85, 0.45])  # where from, if nobody says: ahead of a robot that looks along x, to its right


@dataclass(frozen=True)
class View:
    """The viewpoint of a page.

    Attributes:
        eye: (x, y, z) [m].
        target: (x, y, z) [m], the middle of the picture, about which the mouse turns.
        field: From the bottom to the top of the picture [deg].
        reach: How far from the target shadows are drawn [m].
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    field: float = FIELD
    reach: float = 1.0

    @classmethod
    def around(cls, low: np.ndarray, high: np.ndarray, direction: np.ndarray = FROM) -> View:
        """Return a view in which all between two corners (3,) [m] is seen, from a ``direction`` (3,)."""
        middle, radius = (low + high) / 2.0, max(0.1, 0.5 * float(np.linalg.norm(high - low)))
        # a sphere fills the picture from sin(field / 2); things are seldom as large as the sphere around them
        away = 0.95 * radius / np.sin(np.radians(FIELD) / 2.0)
        eye = middle + away * direction / np.linalg.norm(direction)
        return cls(_triple(eye), _triple(middle), FIELD, radius)

    def command(self) -> dict[str, Any]:
        """Return the command that takes the page there."""
        return {"do": "view", "eye": self.eye, "target": self.target, "field": self.field, "reach": self.reach}


def _triple(point: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
