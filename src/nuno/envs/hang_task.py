"""Hang: a cloth that lies before a bar is to hang over it."""

from __future__ import annotations

import numpy as np

from nuno.bodies.make_bodies import capsule
from nuno.envs.cloth_task import ABOVE, SIDE, ClothTask, Start, Waypoint, moved, waypoints
from nuno.envs.top_view import TopView
from nuno.world.world import World

HEIGHT = 0.3
"""[m] of the bar above the table."""
CLEAR = 0.03
"""[m] above the table from which on a vertex counts as lifted."""


class HangTask(ClothTask):
    """The score is the share of vertices that are off the table, more where they are as many on both sides of the bar.

    With the lifted share u and the share s of vertices behind the bar, it is u (1 + 3 b) / 4, b = 4 s (1 - s).
    """

    name = "hang"
    horizon = 40
    done_at = 0.85

    def furnish(self, world: World) -> None:
        """Put the bar over the table, along x."""
        turned = (np.cos(np.pi / 4), 0.0, np.sin(np.pi / 4), 0.0)
        bar = capsule(
            0.02, 0.6, name="bar", position=(0.0, 0.1, HEIGHT), quaternion=turned, friction=0.8, color=(0.6, 0.6, 0.62)
        )
        world.add(bar)

    def start(self, random: np.random.Generator) -> Start:
        """Return the flat cloth before the bar, moved by up to 4 cm and turned by up to 0.2 rad."""
        flat = self.flat((random.uniform(-0.04, 0.04), -0.12 + random.uniform(-0.04, 0.04)), random.uniform(-0.2, 0.2))
        return Start(flat, moved(flat[self.corners[2:]], 0.0, 0.0, ABOVE), np.array((0.0, 0.1, HEIGHT)))

    def score(self, vertices: np.ndarray, places: np.ndarray, view: TopView) -> np.ndarray:
        """Return how much of the cloth is lifted, and how evenly it is shared by the bar."""
        lifted = (vertices[..., 2] > CLEAR).mean(axis=1)
        behind = (vertices[..., 1] > places[:, None, 1]).mean(axis=1)
        return lifted * (1.0 + 3.0 * 4.0 * behind * (1.0 - behind)) / 4.0

    def script(self, vertices: np.ndarray, places: np.ndarray) -> list[Waypoint]:
        """Return a way on which hands take the far corners over the bar, and half of the cloth's length down again."""
        start = vertices[:, self.corners[2:]]
        bar = self.pair_at(places)
        above, behind = moved(bar, 0.0, -0.08, 0.12), moved(bar, 0.0, 0.1, 0.08)
        down = moved(bar, 0.0, 0.04, 0.03 - 0.5 * SIDE)
        return waypoints(
            (start, False), (start, True), (above, True), (behind, True), (down, True), (down, True),
            (down, True), (down, False), (moved(down, 0.0, 0.1, 0.0), False),
        )  # fmt: skip
