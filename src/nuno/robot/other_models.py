"""Other models of the same robot, such as scikit-robot's, whose joints are in another order: they meet by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nuno.validation import number


def is_model(value: Any) -> bool:
    """Return True if something is a model as scikit-robot has them: with joints that have names and angles."""
    joints = getattr(value, "joint_list", None)
    return isinstance(joints, list) and all(hasattr(own, "name") and hasattr(own, "joint_angle") for own in joints)


def angles_of_model(model: Any) -> dict[str, float]:
    """Return the angles of a model's joints by name [rad; m for slides]."""
    return {own.name: number(f"the angle of {own.name!r}", own.joint_angle()) for own in model.joint_list}


def show_on_model(model: Any, angles: Mapping[str, float]) -> None:
    """Set the joints of a model that are among some angles [rad; m for slides]; others stay."""
    for own in model.joint_list:
        if own.name in angles:
            own.joint_angle(angles[own.name])
