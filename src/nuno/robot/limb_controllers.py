"""LimbControllers: the controllers of limbs by the names that scikit-robot's interfaces have for them."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

from nuno.errors import UnknownNameError


class LimbControllers:
    """The controllers of ``default_controller`` by limb; a limb that the robot lacks raises ``UnknownNameError``."""

    @abstractmethod
    def default_controller(self) -> list[dict[str, Any]]:
        """Return the controllers of the robot."""

    @property
    def larm_controller(self) -> dict[str, Any]:
        """The controller of the left arm."""
        return self._controller("larm_controller")

    @property
    def rarm_controller(self) -> dict[str, Any]:
        """The controller of the right arm."""
        return self._controller("rarm_controller")

    @property
    def lhand_controller(self) -> dict[str, Any]:
        """The controller of the left hand's fingers."""
        return self._controller("lhand_controller")

    @property
    def rhand_controller(self) -> dict[str, Any]:
        """The controller of the right hand's fingers."""
        return self._controller("rhand_controller")

    @property
    def head_controller(self) -> dict[str, Any]:
        """The controller of the head."""
        return self._controller("head_controller")

    @property
    def torso_controller(self) -> dict[str, Any]:
        """The controller of the torso."""
        return self._controller("torso_controller")

    @property
    def lleg_controller(self) -> dict[str, Any]:
        """The controller of the left leg."""
        return self._controller("lleg_controller")

    @property
    def rleg_controller(self) -> dict[str, Any]:
        """The controller of the right leg."""
        return self._controller("rleg_controller")

    @property
    def fullbody_controller(self) -> dict[str, Any]:
        """The controller of all joints, of a robot whose limbs are not known."""
        return self._controller("fullbody_controller")

    def _controller(self, name: str) -> dict[str, Any]:
        known = {own["controller_type"]: own for own in self.default_controller()}
        if name not in known:
            raise UnknownNameError("controller", name, list(known))
        return known[name]
