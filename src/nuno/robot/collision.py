"""Collision: where and when a robot that goes where it is sent would go through something static."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Collision:
    """A link that would go into a static body of the world.

    Attributes:
        link: The link's name.
        body: The body's name.
        time: When, on the world's clock [s].
        point: (3,) float, about where [m].
        joint: Pinocchio's index of the joint that carries the link.
    """

    link: str
    body: str
    time: float
    point: np.ndarray
    joint: int

    def __str__(self) -> str:
        x, y, z = self.point
        return f"{self.link} would run into {self.body!r} at t = {self.time:.2f} s, near ({x:.2f}, {y:.2f}, {z:.2f}) m"


@dataclass(frozen=True)
class Unbalance:
    """A zero moment point that is not under the soles: a robot with weight would tip over.

    Attributes:
        distance: How far outside the hull of the soles that stand it is, the most so far [m].
        time: Since when, on the world's clock [s].
    """

    distance: float
    time: float

    def __str__(self) -> str:
        return f"its zero moment point is {self.distance:.3f} m outside its soles since t = {self.time:.2f} s"
