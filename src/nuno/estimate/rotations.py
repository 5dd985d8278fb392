"""Turns of a picked cloth about the vertical through the hand, which no simulation foretells.

How far a cloth turns on the table while it is dragged, and in the air below two fingers, depends on friction that
nobody knows: engines that agree on its shape differ by 10 to 30 degrees there. So every future is compared at several
turns, with a prior on them. A cloth that is turned about the hand's vertical looks as it does to a camera that is
turned the other way around, so no vertex is moved for it; what stands still, the table, is drawn from where the
camera is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError
from nuno.validation import finite_array

TURNS = tuple(float(np.radians(angle)) for angle in (-30, -20, -10, 0, 10, 20, 30))
"""[rad] At which a future is compared, counterclockwise seen from above."""
DEVIATION = float(np.radians(20))
"""[rad] Standard deviation of the normal prior."""
STILL = (0.0, 0.0, 0.0)


class Pose(NamedTuple):
    """A move of a future before it is compared.

    Attributes:
        angle: Of the turn about the hand's vertical [rad].
        shift: What is added then [m], for the hand may be elsewhere than it is told (`nuno.estimate.hand_error`).
    """

    angle: float = 0.0
    shift: tuple[float, float, float] = STILL


UNMOVED = Pose()


def checked_turns(turns: Sequence[float]) -> np.ndarray:
    """(t,) float [rad], turns to compare at; 0 must be among them.

    Raises:
        InvalidInputError: no numbers, or no 0.
    """
    angles = finite_array("turns", turns, ("t",))
    if 0.0 not in angles:
        raise InvalidInputError(f"turns must have 0 among them, got {list(turns)} rad")
    return angles


def log_prior(turns: ArrayLike) -> np.ndarray:
    """(t,) float, logarithms of the turns' probabilities, which add up to 1."""
    logs = -0.5 * (np.asarray(turns, dtype=float) / DEVIATION) ** 2
    return logs - np.log(np.exp(logs).sum())


def turn(points: ArrayLike, centre: ArrayLike, angle: float) -> np.ndarray:
    """Points (..., 3) turned by an angle [rad] about the vertical through a centre (3,)."""
    return np.asarray(centre) + (np.asarray(points) - centre) @ _about_vertical(angle).T


def view_of_turned(
    camera: Camera, centre: ArrayLike, angle: float, shift: tuple[float, float, float] = STILL
) -> Camera:
    """The camera that sees a body as ``camera`` sees it once it is turned, as `turn` does it, and shifted then [m]."""
    if angle == 0.0 and shift == STILL:
        return camera
    pose = camera.camera_to_world.copy()
    pose[:3, :3] = _about_vertical(-angle) @ pose[:3, :3]
    pose[:3, 3] = turn(pose[:3, 3] - shift, centre, -angle)
    return replace(camera, camera_to_world=pose)


def _about_vertical(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
