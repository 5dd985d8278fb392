"""Aims: what the whole-body control of a robot is to bring about in a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class FootAim:
    """The aim of a foot.

    Attributes:
        place: Pinocchio's placement of its sole.
        speed: (6,) [m/s, rad/s], along the world's axes, of a foot in the air.
        acceleration: (6,) [m/s2, rad/s2], likewise.
        bears: Whether it stands on the ground and bears.
        sinks: Whether it goes down until it meets the ground, however far that is.
    """

    place: Any
    speed: np.ndarray
    acceleration: np.ndarray
    bears: bool
    sinks: bool = False


@dataclass(frozen=True, eq=False)
class Aims:
    """The aims of a frame.

    Attributes:
        centre: (3, 3) place, velocity and acceleration of the centre of mass [m, m/s, m/s2].
        q: (nq,) posture, and the trunk's orientation.
        v: (nv,) its velocity.
        a: (nv,) its acceleration.
        feet: The feet.
        falls_freely: Whether the centre of mass has along the ground the acceleration that is given, wherever it is.
    """

    centre: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    feet: tuple[FootAim, ...]
    falls_freely: bool = False
