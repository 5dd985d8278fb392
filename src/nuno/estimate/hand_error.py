"""Errors of where the hand is told to be, and how likely they are: a measured hand is off by a centimetre or so.

A cloth in a hand that is elsewhere is seen elsewhere, so a future is compared where it was imagined and where it is
once it is moved along with the hand, across the view and up or down; along the line of sight little would change.
The same holds to first order for a camera that looks a little aside and for a table of another height, so these shifts
stand for such errors too. An error of a few centimetres, such as that of a table measured wrongly, is not expected, but
known to happen. How much of the cloth is lifted changes with it, so it is imagined: some guesses
(`nuno.estimate.hypotheses`) take it for true, with a small prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera
from nuno.estimate.rotations import log_prior

STEP = 1.5
"""Shifts by so many standard deviations are looked at."""
GROSS = 0.05
"""[m] An error of the hand's height that is a mistake."""
GROSS_SHARE = 0.02
"""Prior of a mistake beside that of none."""
SEEN_SHARE = 0.9
"""The same where the image after shows cloth at the hand's place, or none near it: of 397 cases with a hand told right
none did, of 115 with one told 5 cm wrong 81 (docs/reports/accuracy.md)."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Moves of futures before they are compared.

    Attributes:
        turns: (t,) float, about the hand's vertical [rad].
        shifts: (t, 3) float, added then [m].
        log_priors: (t,) float, logarithms of their probabilities, which add up to 1.
    """

    turns: np.ndarray
    shifts: np.ndarray
    log_priors: np.ndarray


def poses_of(camera: Camera, turns: np.ndarray, std: float) -> Poses:
    """Return all turns without a shift, and the shifts without a turn.

    Args:
        camera: The camera.
        turns: (t,) float [rad], 0 among them.
        std: Standard deviation of where the hand is, along each axis [m]; at 0 there are no shifts.
    """
    log_priors = log_prior(turns)
    if std == 0.0:
        return Poses(turns, np.zeros((len(turns), 3)), log_priors)
    across = camera.camera_to_world[:3, 0]
    moves = STEP * std * np.stack([across, -across, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    still = float(log_priors[turns == 0.0].max())
    log_priors = np.append(log_priors, np.full(len(moves), still - 0.5 * STEP**2))
    return Poses(
        np.append(turns, np.zeros(len(moves))), np.concatenate([np.zeros((len(turns), 3)), moves]),
        log_priors - np.logaddexp.reduce(log_priors),
    )  # fmt: skip
