"""Lamp: the light of a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.validation import check_fields, finite_array, number

DISC_POINTS = 24
"""Of a lamp that is no point; half shadows have so many steps, and pictures take so many times as long to shade."""


@dataclass(frozen=True)
class Lamp:
    """The light of a picture.

    Attributes:
        position: (x, y, z) [m].
        strength: What the lamp gives to a surface that faces it; 1 makes a white one white.
        sky: What comes from everywhere besides.
        shadows: Whether bodies throw them.
        radius: Of the level disc that shines [m]: the larger, the softer the shadows' edges. 0 is a point.
    """

    position: tuple[float, float, float] = (1.0, 1.5, 4.0)
    strength: float = 0.65
    sky: float = 0.35
    shadows: bool = True
    radius: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        finite_array("the lamp's position", self.position, (3,))
        for name in ("strength", "sky", "radius"):
            number(f"the lamp's {name}", getattr(self, name), low=0.0)

    def points(self) -> np.ndarray:
        """Return the points (n, 3) [m] of the disc that stand for it, each for the same area (Vogel 1979)."""
        place = finite_array("the lamp's position", self.position, (3,))
        radius = number("the lamp's radius", self.radius, low=0.0)
        if not (radius and self.shadows):
            return place[None]
        k = np.arange(DISC_POINTS)
        away, angle = radius * np.sqrt((k + 0.5) / DISC_POINTS), np.pi * (3.0 - np.sqrt(5.0)) * k
        return place + np.stack([away * np.cos(angle), away * np.sin(angle), 0.0 * away], axis=1)
