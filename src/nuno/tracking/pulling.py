"""Forces that bring vertices by their expected residuals until an image's time: the maximisation step."""

from __future__ import annotations

import numpy as np

BRAKE = 0.6
"""A pull for the first half of a span, and this share of it back in the second: of the velocity that it gives, most is
taken again, and some kept, for a cloth that lags behind moves too slowly."""
SETTLE = 0.08
"""[s] Time in which a residual falls to 1/e: noise of single images is averaged over it."""
STEADY = 1.0
"""Share of what a residual that is left asks for, as a steady force on what friction holds."""
STUCK = 0.1
"""[m/s] Speed below which a vertex that is off counts as held by friction."""
LEAK = 0.95
"""Share of a steady force that is left at the next image; of what moves, half."""
STEADIEST = 12.0
"""[m/s2] The most of a steady force, by which a cloth slides where friction is below 1.2."""
STRONGEST = 60.0
"""[m/s2] The most that a vertex is pulled by: six times its weight."""


def phases(span: float, frame: float) -> list[tuple[float, float]]:
    """Return durations [s] and accelerations [1/s2] that displace what is free by 1 within ``span`` [s].

    The first part is half of the span's frames, so the second may be up to twice as long, or more: the weaker it
    brakes, for it takes away a share of the velocity, and what it took too much would go the other way.
    """
    frames = int(np.floor(span / frame + 1e-6))
    if frames < 2:
        return [(span, 2.0 / span**2)]
    first = (frames // 2) * frame
    second = span - first
    brake = BRAKE * (first / second)
    way = 0.5 * first**2 + first * second - 0.5 * brake * second**2
    return [(first, 1.0 / way), (second, -brake / way)]


def gain(span: float) -> float:
    """Return the share of a residual that is taken off within ``span`` [s]."""
    return 1.0 - float(np.exp(-span / SETTLE))


def limited(forces: np.ndarray, masses: np.ndarray, strongest: float = STRONGEST) -> np.ndarray:
    """Return forces (..., n, 3) [N], none stronger than ``strongest`` [m/s2] on masses (..., n) [kg]."""
    most = strongest * masses[..., None]
    return forces * np.minimum(1.0, most / np.maximum(np.linalg.norm(forces, axis=-1, keepdims=True), 1e-30))
