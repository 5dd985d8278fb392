"""ClothFrame: places on and over a flat rectangular cloth, in fractions of its sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body

CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
"""u, v of the corners, in their order."""
SKEW = 0.03
"""Share of the longer side by which the corners may fail to be a level rectangle: what is measured in an image does."""


@dataclass(frozen=True, eq=False)
class ClothFrame:
    """The frame of a rectangular cloth that lies flat and level.

    A place in it is (u, v, h): fractions of the sides from the first corner to the second and to the fourth, and the
    height above the cloth's middle surface [m].

    Attributes:
        corners: (4, 3) float [m], anticlockwise seen from above.

    Raises:
        InvalidInputError: not finite, or no level rectangle.
    """

    corners: np.ndarray

    def __post_init__(self) -> None:
        corners = finite_array("the cloth's corners", self.corners, (4, 3))
        a, b, c, d = corners
        longer = max(float(np.linalg.norm(b - a)), float(np.linalg.norm(d - a)), 1e-9)
        wrong = max(np.linalg.norm(a + c - b - d), np.ptp(corners[:, 2]), abs((b - a) @ (d - a)) / longer)
        if wrong > SKEW * longer:
            raise InvalidInputError(
                f"the cloth must lie flat, its corners in a level rectangle; they are {1000.0 * wrong:.0f} mm off one"
            )
        if np.cross(b - a, d - a)[2] < 0.0:
            corners = corners[[0, 3, 2, 1]]
        corners.setflags(write=False)
        object.__setattr__(self, "corners", corners)

    @classmethod
    def of(cls, cloth: Body, first: int = 0) -> ClothFrame:
        """Return the frame of a sheet where it is now.

        Args:
            cloth: A sheet of a single world.
            first: Which corner is to be the first: 0 is the sheet's own, others follow anticlockwise.

        Raises:
            InvalidInputError: no sheet, or it does not lie flat.
        """
        vertices = np.asarray(cloth.vertices)
        if vertices.ndim != 2:
            raise InvalidInputError(f"the cloth must be of a single world, not of a batch of {len(vertices)}")
        own = cls(cloth.at(*CORNERS.T).positions(vertices, cloth.faces))
        return cls(np.roll(own.corners, -first, axis=0))

    @property
    def axes(self) -> np.ndarray:
        """(2, 3) float [m], the sides along u and v."""
        return np.stack([self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]])

    @property
    def size(self) -> np.ndarray:
        """(2,) float [m], the lengths of the sides along u and v."""
        return np.linalg.norm(self.axes, axis=1)

    def to_cloth(self, points: ArrayLike) -> np.ndarray:
        """Return the places (..., 3) of points (..., 3) [m]."""
        away = np.asarray(points, dtype=float) - self.corners[0]
        flat = away[..., :2] @ np.linalg.inv(self.axes[:, :2])
        return np.concatenate([flat, away[..., 2:] - flat @ self.axes[:, 2:]], axis=-1)

    def to_world(self, places: ArrayLike) -> np.ndarray:
        """Return the points (..., 3) [m] of places (..., 3)."""
        own = np.asarray(places, dtype=float)
        return self.corners[0] + own[..., :2] @ self.axes + own[..., 2:] * np.array([0.0, 0.0, 1.0])
