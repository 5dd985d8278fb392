"""The prior of a lift: how far sideways a hand goes that lifts a cloth, before any image of it is seen.

Who picks a cloth up to hold it lifts it: up, and somewhat to a side. So a point of the cloth that is under the hand now
is a likelier pick than one from which the hand would have gone sideways only. How far sideways hands go in proportion
to how high they go is not known; the density per area of table, (1 + (d / s)^2)^-2 with d the way sideways and
s half of the way up, is broad and has a heavy tail (that of Student's t with two degrees of freedom in the plane): half
of all hands end farther away than s, a fifth farther than 2 s, a tenth farther than 3 s. It was fitted to nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from nuno.camera.rectangle import ClothRectangle

SIDEWAYS = 0.5
"""Of the way up: half of all hands are taken to go no farther sideways."""
UP_FIRST = 0.2
"""Of hands go up first and sideways then, not straight: a guess, as the next is. 0.1 to 0.5 rank about as well."""
FARTHER = 2.0
"""Times as far sideways goes half of these hands: who turns sideways in the air means to."""
LOWEST = 0.2
"""[m] A hand that is not as high counts as if it were: who drags a cloth over the table does not lift it."""
HAND_STD = 0.01
"""[m] Standard deviation of where a hand is, along each axis, where it is not told."""
TOUCH = 0.01
"""[m] Where a path begins tells no better than this where the cloth was touched."""


def log_prior_of_start(rectangle: ClothRectangle, uv: ArrayLike, start: ArrayLike, std: float) -> np.ndarray:
    """(k,) float, logarithms of how likely each candidate is where a hand's path begins, 0 straight below it.

    The hand may have gone sideways by half of how high it was by then; and it is known to its standard deviation only.

    Args:
        rectangle: The cloth before.
        uv: (k, 2) float, the candidates as fractions of the sides from corner C00.
        start: (3,) the first point of the path [m].
        std: Standard deviation of where a hand is [m].
    """
    begin, start = _places(rectangle, uv), np.asarray(start, dtype=float)
    away = np.linalg.norm(start[:2] - begin[:, :2], axis=1)
    up = np.maximum(start[2] - begin[:, 2], 0.0)
    return np.asarray(-2.0 * np.log1p((away / np.hypot(SIDEWAYS * up, max(std, TOUCH))) ** 2))


def log_prior_of_lift(rectangle: ClothRectangle, uv: ArrayLike, hand: ArrayLike, sideways: float) -> np.ndarray:
    """(k,) float, logarithms of how likely a hand that picked each candidate ends where it did, 0 straight above it.

    Args:
        rectangle: The cloth before.
        uv: (k, 2) float, the candidates as fractions of the sides from corner C00.
        hand: (3,) where the picked point is now [m].
        sideways: s as a share of the height of the lift, above 0.
    """
    begin, hand = _places(rectangle, uv), np.asarray(hand, dtype=float)
    away = np.linalg.norm(hand[:2] - begin[:, :2], axis=1)
    up = np.maximum(hand[2] - begin[:, 2], LOWEST)
    return np.asarray(-2.0 * np.log1p((away / (sideways * up)) ** 2))


def log_priors_of_ways(rectangle: ClothRectangle, uv: ArrayLike, hand: ArrayLike, sideways: float | None) -> np.ndarray:
    """(2, k) float, as `log_prior_of_lift` of hands that went straight, and of those that went up first.

    Args:
        rectangle: The cloth before.
        uv: (k, 2) float, the candidates as fractions of the sides from corner C00.
        hand: (3,) where the picked point is now [m].
        sideways: Of those that went straight; None: all candidates are alike, however the hand went.
    """
    if sideways is None:
        return np.zeros((2, len(np.asarray(uv))))
    straight = log_prior_of_lift(rectangle, uv, hand, sideways)
    # a density that is as much wider is lower everywhere, by the square of that
    up_first = log_prior_of_lift(rectangle, uv, hand, FARTHER * sideways) - 2.0 * np.log(FARTHER)
    return np.stack([straight, up_first])


def _places(rectangle: ClothRectangle, uv: ArrayLike) -> np.ndarray:
    """(k, 3) float, where points (k, 2) of the cloth lie, in fractions of its sides [m]."""
    fractions = np.asarray(uv, dtype=float)
    along, across = (rectangle.corners[k] - rectangle.corners[0] for k in (1, 3))
    return np.asarray(rectangle.corners[0] + fractions[:, :1] * along + fractions[:, 1:] * across)
