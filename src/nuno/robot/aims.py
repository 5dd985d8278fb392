"""Aims: what the whole-body control of robots is to bring about in a frame, as arrays over worlds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class FootAims:
    """The aims of the feet.

    Attributes:
        places: (worlds, feet, 3) of the soles [m].
        turns: (worlds, feet, 3, 3), rotation matrices.
        speeds: (worlds, feet, 6) [m/s, rad/s], along the world's axes, of feet in the air.
        accelerations: (worlds, feet, 6) [m/s2, rad/s2], likewise.
        bears: (worlds, feet) bool, whether they stand on the ground and bear.
        sinks: (worlds, feet) bool, whether they go down until they meet the ground, however far that is.
        ground: (2, worlds, feet, 6) velocities and accelerations [m/s, rad/s; m/s2, rad/s2] of the ground below them.
    """

    places: np.ndarray
    turns: np.ndarray
    speeds: np.ndarray
    accelerations: np.ndarray
    bears: np.ndarray
    sinks: np.ndarray
    ground: np.ndarray


@dataclass(frozen=True, eq=False)
class Aims:
    """The aims of a frame.

    Attributes:
        centres: (worlds, 3, 3) places, velocities and accelerations of the centres of mass [m, m/s, m/s2].
        q: (worlds, nq) postures, and the trunks' orientation.
        v: (worlds, nv) their velocities.
        a: (worlds, nv) their accelerations.
        feet: The feet.
        falls_freely: (worlds,) bool, whether the centre of mass has along the ground the acceleration that is given,
            wherever it is.
    """

    centres: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    feet: FootAims
    falls_freely: np.ndarray
