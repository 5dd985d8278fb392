"""Protocols around a body: what it asks of its dynamics and its world, and what dynamics ask of the body they move."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, Protocol

import numpy as np

from nuno.bodies.body_motion import BodyMotion
from nuno.bodies.resolution import Resolution
from nuno.materials import Material
from nuno.shapes.coordinates import Pose
from nuno.shapes.shape import Shape


class MovedBody(Protocol):
    """A body as the dynamics see it that move it."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def shape(self) -> Shape:
        """Its shape, before anything deformed it."""

    @property
    def _quaternion(self) -> np.ndarray:
        """The orientation that it was last given."""

    def _rigid_vertices(self, pose: Pose) -> np.ndarray:
        """Return its vertices at a pose, undeformed by it."""


class BodyDynamics(Protocol):
    """Dynamics as a body sees them; `nuno.dynamics.dynamics.Dynamics` says what each member is."""

    @property
    def is_rigid(self) -> bool:
        """True where they are those of a rigid body."""

    @property
    def copies_vertices(self) -> bool:
        """True where ``vertices`` returns an array that nobody else has."""

    @property
    def material(self) -> Material:
        """The material."""

    @property
    def resolution(self) -> Resolution | None:
        """The stiffness that the substeps make of the material."""

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s]."""

    def pose(self, body: MovedBody) -> Pose:
        """Return where the body is."""

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere as a whole."""

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves as a whole."""

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J]."""


class BodyWorld(Protocol):
    """A world as its bodies see it; the members are those of `nuno.world.simulation.Simulation`."""

    @property
    def lock(self) -> AbstractContextManager[Any]:
        """The lock that is held while the world is read."""

    @property
    def world_count(self) -> int:
        """Worlds in the batch."""

    def _check_between_frames(self, what: str) -> None:
        """Refuse a change in the midst of a run."""

    def _check_worlds(self, what: str, axes: tuple[int, ...]) -> None:
        """Refuse values for another number of worlds."""

    def _body_changed(self, key: str) -> None:
        """Be told that a body was moved, or its friction or groups changed."""


class WorldSettings(Protocol):
    """A world as dynamics see it: how many it is, where it is, and how time passes in it."""

    @property
    def world_count(self) -> int:
        """Worlds in the batch."""

    @property
    def device(self) -> str:
        """The device that dynamics run on."""

    @property
    def gravity(self) -> tuple[float, float, float]:
        """[m/s2]."""

    @property
    def frame_rate(self) -> float:
        """[1/s]."""

    @property
    def substeps(self) -> int | None:
        """Substeps of a frame that were given, or None."""

    @property
    def time(self) -> float:
        """[s]."""
