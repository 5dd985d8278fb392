"""Robot: a robot model with the geometry of its links, and which of them run into each other."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from nuno.robot.link_geometry import Geometry
from nuno.robot.robot_model import RobotModel


class Robot(RobotModel):
    """A robot model whose links have shapes."""

    def self_collisions(self) -> list[tuple[str, str]]:
        """Return the pairs of links that run into each other, of those that the SRDF lets collide.

        Without an SRDF all pairs count but neighbours; pairs that overlap in the posture never count.
        """
        return self.geometry.collisions(self.configuration())

    @cached_property
    def geometry(self) -> Any:
        """The meshes of the links (``nuno.robot.link_geometry.Geometry``), which are read on first use."""
        return Geometry(self)
