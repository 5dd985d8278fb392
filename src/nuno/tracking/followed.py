"""The result of following a cloth through one image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Followed:
    """The cloth after one image.

    Attributes:
        time: [s], the image's.
        vertices: (n, 3) float64 [m], where the cloth is then.
        visible: (n,) bool, which vertices the cameras see.
        used: Whether the image drew the cloth.
        reason: Why it did not: "dropped", "late", "instant", "empty", "hidden" or "lost"; None where it did.
        points: How many pixels showed the cloth.
        error: Mean length of the residuals that are left of the visible vertices [m]; NaN where none are.
        agreement: Intersection over union of the pixels that show the cloth and those that should; NaN likewise.
        forces: (n, 3) float64 [N], mean over the time since the image before of what drew the vertices.
        future: Which future was adopted.
        probabilities: (futures,), of the futures.
    """

    time: float
    vertices: np.ndarray
    visible: np.ndarray
    used: bool
    reason: str | None
    points: int
    error: float
    agreement: float
    forces: np.ndarray
    future: int
    probabilities: np.ndarray

    def __repr__(self) -> str:
        state = f"{1000 * self.error:.1f} mm off" if self.used else f"not used: {self.reason}"
        return f"<followed at {self.time:.3f} s, {int(self.visible.sum())} of {len(self.visible)} vertices, {state}>"
