"""The gravity that a robot's models reckon with, which is that of its world and may change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nuno.errors import WalkError

EARTH = (0.0, 0.0, -9.81)
"""[m/s2]"""


def take_gravity(model: Any, gravity: Sequence[float]) -> bool:
    """Let one of Pinocchio's models have a gravity (3,) [m/s2]; return whether it had another."""
    if model.gravity.linear.tolist() == [*gravity]:
        return False
    model.gravity.linear = np.array(gravity, dtype=float)
    return True


def walking_gravity(gravity: Sequence[float]) -> float:
    """Return with what acceleration [m/s2] a gravity (3,) [m/s2] presses a robot that walks on the floor.

    Raises:
        WalkError: there is none, or it is not along -z.
    """
    x, y, z = (float(part) for part in gravity)
    if x or y or not z < 0.0:
        raise WalkError(
            f"walks need a gravity along -z, and the world's is ({x:g}, {y:g}, {z:g}) m/s2: set world.gravity, as "
            "(0, 0, -9.81), or move the robot's joints alone"
        )
    return -z
