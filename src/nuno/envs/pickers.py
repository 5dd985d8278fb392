"""Pickers: hands that are points, which close on the nearest vertex of a cloth within reach and carry it."""

from __future__ import annotations

import numpy as np

from nuno.bodies.body import Body
from nuno.shapes.path import Path
from nuno.world.world import World

REACH = 0.03
"""[m] from a vertex at which a picker that closes takes hold of it."""
TAUT = 1.02
"""Two pickers stay within so many times the flat distance of what they hold: they do not tear the cloth."""


class Pickers:
    """The hands of all worlds of a batch.

    Args:
        world: The batch.
        cloth: What they pick.
        count: Hands of a world.
        low: (3,) [m], the lower corner of the space in which they move.
        high: (3,) [m], the upper one.

    Attributes:
        positions: (worlds, hands, 3) float64 [m].
        held: (worlds, hands) int, the vertex that a hand holds, -1 for none.
    """

    def __init__(self, world: World, cloth: Body, count: int, low: np.ndarray, high: np.ndarray) -> None:
        self._world, self._cloth, self._low, self._high = world, cloth, low, high
        self._flat = cloth.shape.mesh()[0]
        self.positions = np.zeros((world.world_count, count, 3))
        self.held = np.full((world.world_count, count), -1)

    def put(self, positions: np.ndarray, worlds: np.ndarray) -> None:
        """Put the hands of some worlds (k,) to places (k, hands, 3) [m], open."""
        self.positions[worlds] = positions
        self.held[worlds] = -1

    def act(self, motion: np.ndarray, close: np.ndarray, seconds: float, vertices: np.ndarray) -> None:
        """Open or close the hands, and run the worlds while they move.

        A hand that closes goes to the vertex that it takes. All worlds take their grips anew, so that none depends on
        what hands do in others.

        Args:
            motion: (worlds, hands, 3) [m], how far each hand goes.
            close: (worlds, hands) bool, whether it is closed.
            seconds: How long [s].
            vertices: (worlds, n, 3) [m], where the cloth is.
        """
        self._choose(close, vertices)
        rows = np.arange(len(self.held))[:, None]
        holds = (self.held >= 0)[..., None]
        start = np.where(holds, vertices[rows, self.held], self.positions)
        goal = self._near_enough(np.clip(start + motion, self._low, self._high))
        times = self._world.time + np.array([0.0, seconds])
        grips = [
            self._world.grip(self._cloth, self.held[:, h : h + 1], to=Path(times, np.stack([a, b], axis=1)))
            for h, (a, b) in enumerate(zip(start.swapaxes(0, 1), goal.swapaxes(0, 1), strict=True))
        ]
        self._world.run(seconds)
        for grip in grips:
            grip.release()
        self.positions = goal

    def _choose(self, close: np.ndarray, vertices: np.ndarray) -> None:
        self.held[~close] = -1
        for h in range(self.held.shape[1]):
            free = close[:, h] & (self.held[:, h] < 0)
            if not free.any():
                continue
            apart = vertices[free] - self.positions[free, h, None]
            away = np.sqrt(np.einsum("wnk,wnk->wn", apart, apart))
            for other in np.delete(self.held[free], h, axis=1).T:
                away[other >= 0, other[other >= 0]] = np.inf
            nearest = away.argmin(axis=1)
            self.held[free, h] = np.where(away.min(axis=1) <= REACH, nearest, -1)

    def _near_enough(self, goal: np.ndarray) -> np.ndarray:
        """Return goals (worlds, hands, 3) with hands that hold the cloth drawn together where they would tear it."""
        for a in range(goal.shape[1]):
            for b in range(a):
                i, j = self.held[:, a], self.held[:, b]
                most = TAUT * np.linalg.norm(self._flat[i] - self._flat[j], axis=-1)
                apart = goal[:, a] - goal[:, b]
                size = np.linalg.norm(apart, axis=-1)
                over = np.where((i >= 0) & (j >= 0) & (size > most), 1.0 - most / np.maximum(size, 1e-9), 0.0)
                shift = 0.5 * over[:, None] * apart
                goal[:, a] -= shift
                goal[:, b] += shift
        return goal
