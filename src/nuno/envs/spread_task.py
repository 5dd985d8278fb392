"""Spread: a cloth that was dropped is to lie over as much of the table as it can."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from nuno.envs.cloth_task import SIDE, ClothTask, Start, Waypoint, moved, waypoints
from nuno.envs.top_view import TopView
from nuno.shapes.path import Path

SHAPES = 8
"""Shapes from which episodes begin, turned and moved at random."""
DROP = 0.25
"""[m] from which the cloths were dropped."""


class SpreadTask(ClothTask):
    """The score is the area that the cloth covers, over its own."""

    name = "spread"
    horizon = 40
    done_at = 0.9

    @cached_property
    def dropped(self) -> np.ndarray:
        """(shapes, n, 3) [m]: cloths that were held at one vertex each, lifted and dropped."""
        batch = self.world().imagine(SHAPES)
        cloth = batch.find("cloth")
        held = np.random.default_rng(0).integers(len(self.flat((0, 0), 0.0)), size=(SHAPES, 1))
        start = cloth.vertices[np.arange(SHAPES), held[:, 0]]
        path = Path([0.0, 0.75], np.stack([start, moved(start, 0.0, 0.0, DROP)], axis=1), interpolation="minimum_jerk")
        grip = batch.grip(cloth, held, to=path)
        batch.run(1.0)
        grip.release()
        batch.run(1.0)
        shapes = np.array(cloth.vertices)
        shapes[..., :2] -= shapes[..., :2].mean(axis=1, keepdims=True)
        shapes.setflags(write=False)
        return shapes

    def start(self, random: np.random.Generator) -> Start:
        """Return one of the dropped shapes, turned and moved."""
        shape, angle = self.dropped[random.integers(SHAPES)], random.uniform(-np.pi, np.pi)
        c, s = np.cos(angle), np.sin(angle)
        turned = shape @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        turned[:, :2] += random.uniform(-0.05, 0.05, size=2)
        return Start(turned, np.array([(-0.2, 0.0, 0.15), (0.2, 0.0, 0.15)]), np.zeros(3))

    def score(self, vertices: np.ndarray, places: np.ndarray, view: TopView) -> np.ndarray:
        """Return the area that is covered, over the cloth's own (at most 1)."""
        return np.minimum(view.area() / SIDE**2, 1.0)

    def script(self, vertices: np.ndarray, places: np.ndarray) -> list[Waypoint]:
        """Return a way on which hands take two opposite corners and draw them apart, then the other two."""
        goal = np.broadcast_to(self.flat((0.0, 0.0), 0.0), vertices.shape)
        still = np.zeros((len(vertices), 2, 3))
        ways = []
        for pair in (self.corners[[0, 3]], self.corners[[2, 1]], self.corners[[0, 1]], self.corners[[2, 3]]):
            aim = 1.01 * goal[:, pair]
            ways += [Waypoint(moved(still, 0.0, 0.0, 0.1), False, pair), Waypoint(still, False, pair)]
            ways += waypoints((moved(aim, 0.0, 0.0, 0.1), True), (aim, True), (moved(aim, 0.0, 0.0, 0.1), False))
        return ways
