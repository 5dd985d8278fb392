"""Fold: a cloth that lies flat is to be folded in half."""

from __future__ import annotations

import numpy as np

from nuno.envs.cloth_task import ABOVE, SIDE, ClothTask, Start, Waypoint, moved, waypoints
from nuno.envs.top_view import TopView


class FoldTask(ClothTask):
    """The score compares where the two halves are, by the vertices that meet in a perfect fold.

    It is 1 - d / d0, where d is their mean distance and d0 that of the flat cloth, times the covered area over half of
    the cloth's own (at most 1): a heap is no fold.
    """

    name = "fold"
    done_at = 0.85

    def start(self, random: np.random.Generator) -> Start:
        """Return the flat cloth, moved by up to 5 cm and turned by up to 0.3 rad."""
        place = random.uniform(-0.05, 0.05, size=2)
        flat = self.flat(place, random.uniform(-0.3, 0.3))
        return Start(flat, moved(flat[self.corners[:2]], 0.0, 0.0, ABOVE), np.array([*place, 0.0]))

    def score(self, vertices: np.ndarray, places: np.ndarray, view: TopView) -> np.ndarray:
        """Return how well the halves lie on each other."""
        nx, ny = self.cells
        grid = vertices.reshape(len(vertices), ny + 1, nx + 1, 3)
        near, far = grid[:, : (ny + 1) // 2], grid[:, ::-1][:, : (ny + 1) // 2]
        squared = sum((near[..., k] - far[..., k]) ** 2 for k in range(3))
        apart = np.sqrt(squared).reshape(len(vertices), -1)
        apart = np.ascontiguousarray(apart).mean(axis=1)  # summed in the same order for any number of worlds
        rows = np.arange((ny + 1) // 2)
        flat = SIDE * (ny - 2 * rows).mean() / ny
        return np.clip(1.0 - apart / flat, 0.0, 1.0) * np.minimum(view.area() / (0.5 * SIDE**2), 1.0)

    def script(self, vertices: np.ndarray, places: np.ndarray) -> list[Waypoint]:
        """Return a way on which hands take the corners of one side and lay them on the others, in an arc."""
        start, goal = vertices[:, self.corners[:2]], vertices[:, self.corners[2:]]
        middle, low = moved(0.5 * (start + goal), 0.0, 0.0, 0.5 * SIDE), moved(goal, 0.0, 0.0, 0.012)
        quarter = moved(start + 0.15 * (goal - start), 0.0, 0.0, 0.36 * SIDE)
        return waypoints(
            (start, False), (start, True), (quarter, True), (middle, True), (low, True), (low, False),
            (moved(goal, 0.0, 0.0, 0.1), False),
        )  # fmt: skip
