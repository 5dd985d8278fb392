"""The gravity that a robot's models reckon with, which is that of its world and may change."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def take_gravity(model: Any, gravity: Sequence[float]) -> bool:
    """Let one of Pinocchio's models have a gravity (3,) [m/s2]; return whether it had another."""
    if model.gravity.linear.tolist() == [*gravity]:
        return False
    model.gravity.linear = np.array(gravity, dtype=float)
    return True
