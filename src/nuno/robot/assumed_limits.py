"""Limits of joints whose URDF gives none that can be used: zero or none at all, as generators of URDFs leave them."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from nuno.errors import UnknownNameError

logger = logging.getLogger(__name__)

HINGE_SPEED, SLIDE_SPEED = np.pi, 0.5
"""[rad/s], [m/s] Of joints whose URDF says nothing of it: below what hobby servos and grippers reach."""
JOINTS = 6
"""Rows of a velocity that come before the joints': the base's."""


def assume_limits(model: Any, name: str, is_slide: np.ndarray, given: Mapping[str, float]) -> None:
    """Set velocity limits from a table, and those that a URDF has as zero or not at all; of efforts zero is none.

    The log says once which joints.

    Args:
        model: Pinocchio's, which is changed.
        name: The robot's.
        is_slide: (n,) bool, of the joints.
        given: Velocity limits by joint [rad/s; m/s for slides].

    Raises:
        UnknownNameError: a limit for a joint that is not there.
    """
    joints = list(model.names)[2:]
    speeds, efforts = np.array(model.velocityLimit[JOINTS:]), np.array(model.effortLimit[JOINTS:])
    for joint, speed in given.items():
        if joint not in joints:
            raise UnknownNameError("joint", joint, joints)
        speeds[joints.index(joint)] = speed
    missing = ~(np.isfinite(speeds) & (speeds > 0.0))
    speeds[missing] = np.where(is_slide, SLIDE_SPEED, HINGE_SPEED)[missing]
    without = ~(efforts > 0.0)
    efforts[without] = np.inf
    model.velocityLimit = np.concatenate([model.velocityLimit[:JOINTS], speeds])
    model.effortLimit = np.concatenate([model.effortLimit[:JOINTS], efforts])
    if missing.any():
        logger.warning(
            "the URDF of %r limits the velocity of %d joints to zero or not at all, the first is %r: %.3g rad/s and "
            "%.3g m/s are assumed; velocity_limits in a table of robots (nuno.describe_robot) says better",
            name, missing.sum(), joints[int(missing.argmax())], HINGE_SPEED, SLIDE_SPEED,
        )  # fmt: skip
    if without.any():
        logger.warning(
            "the URDF of %r limits the effort of %d joints to zero, the first is %r: they count as unlimited",
            name, without.sum(), joints[int(without.argmax())],
        )  # fmt: skip
