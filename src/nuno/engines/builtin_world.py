"""The world of Nuno's own engine, as that sees it: protocols."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.dynamics.rigid_dynamics import RigidScene, RigidWorld
from nuno.engines.world_view import EngineWorld

if TYPE_CHECKING:
    from nuno.joints.grip import Grip


class FrameSteps(Protocol):
    """The bodies of a world in time, `nuno.world.stepping.Stepping` as the engine sees it."""

    last: list[Any]

    def run(self, time: float, stop: float) -> None:
        """Advance all dynamic bodies from ``time`` to ``stop`` [s]."""

    def wrench(self, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
        """Return force [N] and torque [N m], (worlds, 3) each, that a grip bore in the last frame."""

    def effort(self, joint: Grip) -> np.ndarray:
        """Return (worlds,), what acted along a joint's free direction in the last frame."""


class BuiltinWorld(EngineWorld, RigidWorld, Protocol):
    """A world as Nuno's own engine sees it; the members are those of `nuno.world.advancing.Advancing`."""

    @property
    def _rigid(self) -> RigidScene | None:
        """The scene that moves the rigid bodies, None where there are none."""

    @property
    def _stepping(self) -> FrameSteps:
        """The bodies in time, with what the last frame told."""

    def _bring_colliders(self) -> None:
        """Tell solvers of the static bodies that they touch."""

    def _bring_rigid(self) -> None:
        """Tell the rigid solver what has changed."""
