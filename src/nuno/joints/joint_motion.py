"""Positions and rates of hinges and sliders, of one joint or of many at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose


def positions_of(slides: Any, own: Pose, other: Pose) -> np.ndarray:
    """Return how far joints are from where they were made (...,): hinges from -pi to pi [rad], sliders [m].

    Args:
        slides: (...,) bool, or one for all: whether it is a slider.
        own: Places (..., 3) [m] and quaternions (..., 4) of the joints' frames in their bodies, z along the axis.
        other: The same in what the bodies are joined to.
    """
    turn = quat.multiply(quat.inverse(other[1]), own[1])
    turn = np.where(turn[..., :1] < 0.0, -turn, turn)
    along = quat.rotate(quat.inverse(other[1]), own[0] - other[0])[..., 2]
    return np.where(slides, along, 2.0 * np.arctan2(turn[..., 3], turn[..., 0]))


def velocities_of(slides: Any, velocity: np.ndarray, spin: np.ndarray, other: Pose) -> np.ndarray:
    """Return the rates of ``positions_of`` (...,) [rad/s; m/s].

    Args:
        slides: As there.
        velocity: (..., 3) [m/s], of the bodies where the joints are, less that of what they are joined to.
        spin: (..., 3) [rad/s], likewise.
        other: As there.
    """
    axis = quat.rotate(other[1], np.broadcast_to((0.0, 0.0, 1.0), velocity.shape))
    motion = np.where(np.asarray(slides)[..., None], velocity, spin)
    return np.asarray(np.einsum("...x,...x->...", motion, axis))
