"""Cover: a cloth is to be drawn over a box that stands behind it."""

from __future__ import annotations

import numpy as np

from nuno.bodies.make_bodies import box
from nuno.envs.cloth_task import ABOVE, SIDE, ClothTask, Start, Waypoint, moved, waypoints
from nuno.envs.top_view import TopView
from nuno.world.world import World

BOX = 0.12
"""[m], the side of the box."""
TALL = 0.06
"""[m], its height."""
POINTS = 12
"""Along a side of the box: so many points of it are looked at."""


class CoverTask(ClothTask):
    """The score is the share of the box that is covered, seen from above."""

    name = "cover"
    done_at = 0.99

    def furnish(self, world: World) -> None:
        """Put the box on the table."""
        world.add(box((BOX, BOX, TALL), name="object", position=(0.0, 0.22, 0.5 * TALL), color=(0.8, 0.35, 0.2)))

    def start(self, random: np.random.Generator) -> Start:
        """Return the flat cloth before the box; both are moved by up to 4 cm, the cloth turned by up to 0.2 rad."""
        flat = self.flat((random.uniform(-0.04, 0.04), -0.12 + random.uniform(-0.04, 0.04)), random.uniform(-0.2, 0.2))
        place = np.array((random.uniform(-0.04, 0.04), 0.22 + random.uniform(-0.04, 0.04), 0.5 * TALL))
        return Start(flat, moved(flat[self.corners[2:]], 0.0, 0.0, ABOVE), place)

    def score(self, vertices: np.ndarray, places: np.ndarray, view: TopView) -> np.ndarray:
        """Return the share of the box's points over which the cloth lies."""
        s = (np.arange(POINTS) + 0.5) / POINTS - 0.5
        points = BOX * np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2)
        return view.covered_at(places[:, None, :2] + points).mean(axis=1)

    def script(self, vertices: np.ndarray, places: np.ndarray) -> list[Waypoint]:
        """Return a way on which hands take the corners that are nearest to the box, over it and down behind it."""
        start = vertices[:, self.corners[2:]]
        over = self.pair_at(places)
        before, above = moved(over, 0.0, -0.15, TALL + 0.08), moved(over, 0.0, 0.5 * SIDE, TALL + 0.05)
        down = moved(over, 0.0, 0.5 * SIDE, -0.5 * TALL + 0.012)
        return waypoints(
            (start, False), (start, True), (before, True), (above, True), (down, True), (down, False),
            (moved(down, 0.0, 0.0, 0.1), False),
        )  # fmt: skip
