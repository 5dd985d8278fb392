"""A view of the table from far above: where the cloth covers it, by the renderer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from nuno.bodies.body import Body
from nuno.camera.camera import Camera
from nuno.camera.covered_fields import count_covered, look_up_covered
from nuno.camera.render import render_masks
from nuno.world.world import World

WIDTH = 0.9
"""[m] of the square that is seen, about the table's middle."""
FIELDS = 90
"""Pixels along a side: each is a square centimetre."""
DISTANCE = 50.0
"""[m] From there what is 0.3 m higher looks 0.6 % larger."""


class TopView:
    """The fields of a square about the table's middle that the cloth covers, in all worlds.

    Args:
        world: The batch.
        cloth: The cloth.
        without: Bodies that are not seen.
    """

    def __init__(self, world: World, cloth: Body, without: Sequence[Body] = ()) -> None:
        self._world, self._cloth, self._without = world, cloth, tuple(without)
        angle = 2.0 * np.arctan(0.5 * WIDTH / DISTANCE)
        self._camera = Camera.look_at((0.0, 0.0, DISTANCE), (0.0, 0.0, 0.0), angle, width=FIELDS, height=FIELDS)

    def covered(self) -> np.ndarray:
        """Return where the middle of a field is under the cloth: (worlds, x, y) bool, from -x and -y on."""
        return self._seen().numpy()[:, ::-1].swapaxes(1, 2)

    def area(self) -> np.ndarray:
        """Return the area that the cloth covers, (worlds,) [m2]."""
        return count_covered(self._seen()) * (WIDTH / FIELDS) ** 2

    def covered_at(self, places: np.ndarray) -> np.ndarray:
        """Return where places (worlds, k, 2) [m] are under the cloth, to the nearest field: (worlds, k) bool."""
        fields = np.clip(np.floor((places / WIDTH + 0.5) * FIELDS).astype(int), 0, FIELDS - 1)
        return look_up_covered(self._seen(), np.stack([FIELDS - 1 - fields[..., 1], fields[..., 0]], axis=-1))

    def _seen(self) -> wp.array:
        """Return the picture on the device, (worlds, rows from +y on, columns from -x on) bool."""
        masks = render_masks(self._world, self._camera, self._cloth, without=self._without)
        return masks.reshape((-1, FIELDS, FIELDS))
