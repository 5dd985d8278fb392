"""The protocol of static shapes' tables and of sums over a frame, as solvers of particles see them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from nuno.coupled.bounded_particles import Particles
from nuno.coupled.coupled_passes import Layout
from nuno.state.cloth_state import Shapes


class ShapeTables(Protocol):
    """Static and kinematic shapes on a device; `nuno.tables.colliders.Colliders` says what each member is."""

    shapes: Shapes
    keys: tuple[str, ...]
    min_radius: float

    def begin(self, time: float, dt: float) -> None:
        """Be told that a launch begins at ``time`` with substeps of ``dt`` [s]."""


class FrameSums(Protocol):
    """Sums over a frame of what shapes gave a body; `nuno.solvers.shape_impulses.ShapeImpulses` has them."""

    def begin(self) -> None:
        """Begin the sums of a frame."""

    def finish(self, index: int) -> None:
        """Do the last parts of a substep, and add up what the shapes gave in it."""

    def add_bounds(self, layout: Layout, particles: Particles) -> None:
        """Add what shapes gave particles while rows were solved that press on them."""

    def given(self) -> dict[str, np.ndarray]:
        """Return what each shape gave the body in the last frame, (worlds, 3) [N s], by the key of its body."""

    def set_given(self, given: dict[str, np.ndarray]) -> None:
        """Take what `given` returns from now on, until the next frame."""
