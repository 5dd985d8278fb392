"""A stand-in for the cloth solver, vertices that fall or follow their grips: for tests of the world."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import nuno.bodies.shape_topology
import nuno.dynamics.dynamics


def topology_of(shape):
    """Return what a sheet or a cloth mesh is made of."""
    return SimpleNamespace(
        **{name: getattr(shape, name) for name in ("cells", "size", "rest", "faces") if hasattr(shape, name)}
    )


class Colliders:
    """Remembers the bodies."""

    made = 0

    @classmethod
    def from_bodies(cls, bodies, world_count, device, *, pair_friction):
        """Take the bodies."""
        Colliders.made += 1
        for body in bodies:
            assert np.isfinite(body.vertices).all()
            assert np.ndim(body.friction) <= 1
        return SimpleNamespace(
            names=[b.name for b in bodies], friction=[b.friction for b in bodies], pairs=pair_friction
        )


class FreeFall:
    """Unit masses under gravity and forces, one explicit step a frame."""

    diverging = False
    self_contact = True
    substeps = 1
    missed = np.zeros(1, dtype=bool)
    resolution = None
    sums = None
    memory_bytes = 0

    def __init__(self, topology, material, positions, velocities, *, device, gravity, frame_rate, substeps, friction):
        self.gravity, self.frame = np.array(gravity, dtype=np.float32), 1.0 / frame_rate
        self.set_state(positions, np.zeros_like(positions) if velocities is None else velocities)
        self.friction, self.grips, self.forces, self.colliders = friction, [], None, None
        self.runs = []
        # never fast: no figures of a run, and as thick as may be
        self.frame_rate, self.state = frame_rate, SimpleNamespace(notes=None)
        self.scalars = np.full((len(self.x), 8), 1e6)
        self.guarded = np.zeros(len(self.x), dtype=int)  # nor crossed

    def download(self, array, count):
        """No figures."""
        return np.zeros((len(self.x), count))

    def world_bytes(self):
        """Next to nothing."""
        return 0, 0

    def make_room(self):
        """It has no lists."""
        return False

    def positions(self, some=None):
        """(worlds, n, 3), of all particles or of ``some``, (worlds, n)."""
        return self.x.copy() if some is None else np.take_along_axis(self.x, some[..., None], axis=1)

    def velocities(self):
        """(worlds, n, 3)."""
        return self.v.copy()

    def velocities_apart(self):
        """Their x, y and z, (worlds, n) each."""
        return tuple(np.moveaxis(self.v, -1, 0))

    def bounds(self):
        """(worlds, 3) each."""
        return self.x.min(axis=1), self.x.max(axis=1)

    def speeds(self):
        """(worlds,) and (worlds, 3)."""
        return np.linalg.norm(self.v, axis=-1).max(axis=1), np.ptp(self.v, axis=1)

    def set_state(self, positions, velocities):
        """Take a state."""
        self.x, self.v = positions.astype(np.float32), velocities.astype(np.float32)

    def save_state(self):
        """Copy everything."""
        return {
            "local": self.x.copy(),
            "origin": np.zeros((len(self.x), 3), np.float32),
            "velocities": self.v.copy(),
        }

    def load_state(self, state):
        """Take what ``save_state`` gave."""
        assert all(array.dtype == np.float32 for array in state.values())
        self.x, self.v = state["local"].copy(), state["velocities"].copy()

    keep = save_state
    put_back = load_state

    def sum_impulses(self, on):
        """Meet no shape."""

    def set_colliders(self, colliders):
        """Take the colliders."""
        self.colliders = colliders

    def set_grips(self, grips):
        """Take the grips."""
        self.grips = list(grips)

    def forget_grips(self):
        """Be told that others will come."""

    def set_forces(self, forces):
        """Take the forces."""
        self.forces = forces

    def run(self, time, duration, substeps=None):
        """Fall."""
        self.runs.append((time, duration))
        whole = int(duration / self.frame + 1e-6)
        for k in range(whole):
            self.step(time + k * self.frame, self.frame)
        if duration - whole * self.frame > 1e-9:
            self.step(time + whole * self.frame, duration - whole * self.frame)

    def step(self, time, duration):
        """One explicit step."""
        force = 0.0 if self.forces is None else self.forces
        self.v = self.v + np.float32(duration) * (self.gravity + force)
        self.x = self.x + np.float32(duration) * self.v
        for grip in self.grips:
            k = np.clip(np.searchsorted(grip.times, time + duration), 0, len(grip.times) - 1)
            corners = grip.vertices
            if corners is None:  # the nearest vertex
                heaviest = np.argmax(grip.barycentric, axis=-1)[..., None]
                corners = np.take_along_axis(grip.corners, heaviest, axis=-1)[..., 0]
            for world, chosen in enumerate(corners):
                valid = chosen >= 0
                self.x[world, chosen[valid]] = grip.positions[world, valid, k]
        if FreeFall.diverging:
            self.x[0, 0] = np.nan

    def finite(self):
        """(worlds,) bool."""
        return np.isfinite(self.x).all(axis=(1, 2))


@pytest.fixture
def free_fall(monkeypatch):
    """Let worlds use the stand-in."""
    monkeypatch.setattr(nuno.dynamics.dynamics, "backend", lambda: (FreeFall, Colliders))
    monkeypatch.setattr(nuno.bodies.shape_topology, "_cloth_topology", topology_of)
    monkeypatch.setattr(FreeFall, "diverging", False)
    # it never touches itself
    monkeypatch.setattr(
        "nuno.contact.self.crossed_faces.crossed_worlds", lambda solver: np.zeros(len(solver.x), dtype=bool)
    )
    return FreeFall
