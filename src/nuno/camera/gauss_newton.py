"""Small problems of least squares by the method of Gauss and Newton, with NumPy alone.

SciPy's `least_squares` does this and more, but takes half a second to load, an eighth of the time of a clear pick.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

STEP = 1e-5
"""Of numbers of about 1, for differences."""
ENOUGH = 1e-9
"""Share of the sum of squares by which a step has to lessen it for another to follow."""
SHORTEST = 1e-3
"""Of a step: a shorter share of it is not tried."""


def least_squares(
    residuals: Callable[[np.ndarray], np.ndarray], start: np.ndarray, steps: int = 20
) -> tuple[np.ndarray, float]:
    """Return where a sum of squares is least near a start, and the sum.

    Args:
        residuals: Returns (m,) float of numbers (n,) whose scale is about 1; m is n at least.
        start: (n,) float.
        steps: No more than so many; each is halved until the sum is less.
    """
    at, here = np.array(start, dtype=float), residuals(start)
    cost = float(here @ here)
    for _ in range(steps):
        jacobian = np.stack([(residuals(at + d) - here) / STEP for d in STEP * np.eye(len(at))], axis=1)
        step = np.linalg.lstsq(jacobian, -here, rcond=None)[0]
        share, before = 1.0, cost
        while share > SHORTEST:
            there = residuals(at + share * step)
            if there @ there < cost:
                at, here, cost = at + share * step, there, float(there @ there)
                break
            share *= 0.5
        if before - cost <= ENOUGH * before:
            break
    return at, cost
