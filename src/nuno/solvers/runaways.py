"""Warning of rigid bodies that are thrown: faster than anything in a robot's room."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body

logger = logging.getLogger(__name__)

FASTEST = 300.0
"""[m/s] What falls gets so fast in 4.6 km, and nothing that a robot throws does."""
_warned: set[str] = set()  # keys of bodies that were warned of, the same for their copies in imagined worlds


def warn_of_runaways(bodies: list[Body], velocities: np.ndarray, time: float) -> None:
    """Warn, once for a body and its copies, of what contacts, joints or grips throw.

    Args:
        bodies: Rigid bodies.
        velocities: (worlds, bodies, 3) their velocities [m/s].
        time: The time [s].
    """
    speeds = np.linalg.norm(velocities, axis=2)
    if speeds.max(initial=0.0) < FASTEST:
        return
    thrown = [(float(speeds[:, k].max()), body) for k, body in enumerate(bodies) if body.key not in _warned]
    speed, body = max(thrown, key=lambda each: each[0], default=(0.0, None))
    if body is None or speed < FASTEST:
        return
    # what throws one body throws those that hang on it
    _warned.update(own.key for fast, own in thrown if fast > 0.1 * FASTEST)
    logger.warning(
        "%r moves at %.3g m/s at t = %.3f s: something throws it, and what follows means nothing. Joints, grips, "
        "motors without a limit (max_effort) or contacts contradict each other: limit or release what does, let the "
        "bodies' contact be ignored, or go back to a state before (restore)",
        body.name, speed, time,
    )  # fmt: skip
