"""Static boxes: the boxes around a world's static bodies, where those are now."""

from __future__ import annotations

from operator import is_
from typing import TYPE_CHECKING

import numpy as np

from nuno.bodies.body import Body
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.world.world import World


class StaticBoxes:
    """A box in the frame of each static body, and the one around that along the world's axes.

    Args:
        world: The world.
        index: Which of a batch.

    Attributes:
        bodies: The bodies that others may touch, m of them, at the last ``follow``.
    """

    def __init__(self, world: World, index: int = 0) -> None:
        self._world, self._index = world, index
        self._version: int | None = None
        self.bodies: list[Body] = []
        self._where: list[np.ndarray] = []

    def follow(self) -> bool:
        """Take the boxes to where the bodies are now; return whether there may be other bodies than before."""
        renewed = self._version != self._world._collider_version
        if renewed:
            self._version = self._world._collider_version
            self.bodies = [b for b in self._world._bodies.values() if not b.is_dynamic and b.group]
            corners = np.array([_box(body) for body in self.bodies]).reshape(-1, 2, 3)
            self._halves = 0.5 * (corners[:, 1] - corners[:, 0])
            self._middles = corners[:, 0] + self._halves
            self._radii = np.linalg.norm(np.abs(self._middles) + self._halves, axis=1)
        poses = [body.pose() for body in self.bodies]
        where = [*(place for place, _ in poses), *(turn for _, turn in poses)]
        where = [own if own.ndim == 1 else own[self._index] for own in where]
        # a body that moves has other arrays from then on, never other numbers in the same
        if renewed or not all(map(is_, where, self._where)):
            self._where = where
            self._place()
        return renewed

    def _place(self) -> None:
        count = len(self.bodies)
        if not count:
            return
        self._places = np.concatenate(self._where[:count]).reshape(-1, 3)
        self._axes = quat.to_matrix(np.concatenate(self._where[count:]).reshape(-1, 4))
        centres = self._places + np.einsum("kij,kj->ki", self._axes, self._middles)
        reach = np.einsum("kij,kj->ki", np.abs(self._axes), self._halves)
        self._low, self._high = centres - reach, centres + reach

    def close_to(self, low: np.ndarray, high: np.ndarray, margin: float) -> list[int]:
        """Return which bodies' origins are within their boxes' reach and a margin of a box with corners (3,) [m]."""
        if not self.bodies:
            return []
        gaps = self._places - np.minimum(np.maximum(self._places, low), high)
        near = (gaps * gaps).sum(axis=1) < (self._radii + margin) ** 2
        return near.nonzero()[0].tolist()

    def hold_any(self, k: int, points: np.ndarray, low: np.ndarray, high: np.ndarray, margin: float) -> bool:
        """Return True if any of points is in the box of the k-th body or within a margin.

        Args:
            k: The body's number.
            points: (3, n) float [m], coordinates by rows.
            low: (3,) float [m], the least of them.
            high: (3,) float [m], the largest.
            margin: [m].
        """
        if (self._low[k] > high + margin).any() or (self._high[k] < low - margin).any():
            return False
        away = self._axes[k].T @ (points - self._places[k][:, None])
        away -= self._middles[k][:, None]
        return bool((np.abs(away) <= (self._halves[k] + margin)[:, None]).all(axis=0).any())


def _box(body: Body) -> tuple[np.ndarray, np.ndarray]:
    if body.shape.kind == "plane":  # endless, and all below it
        return np.array([-1e3, -1e3, -1e3]), np.array([1e3, 1e3, 0.0])
    vertices = body.local_vertices().reshape(-1, 3)
    return vertices.min(axis=0), vertices.max(axis=0)
