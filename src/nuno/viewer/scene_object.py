"""Scene objects: things that a viewer draws, as they were when it last looked."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from nuno.shapes.color import linear, rgb
from nuno.shapes.coordinates import Pose

NUMBERS = itertools.count(1)


class SceneObject:
    """A thing that is drawn: what it looks like, and where it is now.

    Args:
        path: Its place in the page's tree.
        kind: "mesh", "lines", "balls" or "arrows".
        points: (n, 3) float [m], in the frame of its pose.
        offset: (3,) [m] that its world is drawn away from its place.
        inner: Where its frame is in that of the body that carries it; None is the same.
        shape: What else the page needs to draw it.

    Attributes:
        number: Its own number, of no other scene object.
        pose: (7,) float32, position [m] and quaternion (w, x, y, z), or None where only its points move.
        points: (n, 3) float32 [m].
        colors: (n, 3) uint8, the colours of its points (sRGB), or None where all of it has one.
        recolored: Whether ``colors`` are other than at the look before.
        moved: Whether ``pose`` or ``points`` are other than at the look before.
    """

    def __init__(
        self, path: tuple[str, ...], kind: str, points: np.ndarray, *, offset: Any = (0.0, 0.0, 0.0),
        inner: Pose | None = None, **shape: Any,
    ) -> None:  # fmt: skip
        self.number = next(NUMBERS)
        self.path = path
        self.shape: dict[str, Any] = {"kind": kind, **shape}
        self.offset = np.asarray(offset, dtype=float)
        place, turn = (np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))) if inner is None else inner
        self.inner = np.concatenate([place, turn])
        self.pose: np.ndarray | None = None
        self.points = np.asarray(points, dtype=np.float32).reshape(-1, 3)
        self.moved = False
        self.colors: np.ndarray | None = None
        self.recolored = False

    def place(self, pose: np.ndarray) -> None:
        """Set where it is, (7,) float32."""
        if self.pose is None or not np.array_equal(pose, self.pose):
            self.pose, self.moved = pose, True

    def shift(self, points: np.ndarray) -> None:
        """Set its points (n, 3) [m]; of marks, n may be another than before."""
        now = np.asarray(points, dtype=np.float32).reshape(-1, 3)
        if now.shape != self.points.shape or not np.array_equal(now, self.points):
            self.points, self.moved = now, True

    def tint(self, colors: np.ndarray | None) -> None:
        """Set the colours of its points, (n, 3) uint8; None is its own."""
        same = colors is self.colors or (
            colors is not None and self.colors is not None and np.array_equal(colors, self.colors)
        )
        if not same:
            self.colors, self.recolored = colors, True

    def entrance(self) -> dict[str, Any]:
        """Return the command that brings it to the page as it is now."""
        return {
            "do": "enter", "id": self.number, "path": self.path, "points": self.points.ravel(), "pose": self.pose,
            "colors": None if self.colors is None else self.colors.ravel(), **self.shape,
        }  # fmt: skip


def light_of(color: Any) -> list[float]:
    """Return a colour as the page's materials take it, linear."""
    return [round(float(value), 4) for value in linear(rgb(color))]
