"""Footing: which feet truly bear a robot, and how far from where they are wanted they do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.pinocchio import pin

if TYPE_CHECKING:
    from nuno.robot.capture_step import CaptureStep
    from nuno.robot.ride import Ride

STANDS = 1e-3
"""[m] Above the lowest sole of the wanted posture, up to which a foot is to bear."""
FIRM = 0.02
"""Share of the robot's weight with which a foot presses at least when it bears."""
GOES_DOWN = -1e-3
"""[m/s] Of a wanted sole that is about to land: what it meets then is ground."""
RESTS = 2e-3
"""[m] By which a foot that bears nothing may have left the ground that it stood on."""
FORGETS = 0.12
"""[s] In which a foot that was lifted comes back to where it is wanted,"""
FLAT = 0.1
"""[rad] By which a sole may be tilted whose height tells that of the ground."""
ADOPTS = 0.2
"""[s] and in which a tilted sole's tilt is taken for the ground's, and the centre of mass goes along with the feet."""


@dataclass(frozen=True, eq=False)
class Soles:
    """Soles of robots, as they are and as they are wanted, in each of some worlds.

    Attributes:
        places: (worlds, feet, 3) [m], where they are.
        turns: (worlds, feet, 3, 3), rotation matrices.
        wanted_places: (worlds, feet, 3) [m], where they are wanted.
        wanted_turns: (worlds, feet, 3, 3), likewise.
        sinking: (worlds, feet) [m/s], vertical velocities that are wanted.
        pressed: (worlds, feet) [N], with what they press on the ground.
    """

    places: np.ndarray
    turns: np.ndarray
    wanted_places: np.ndarray
    wanted_turns: np.ndarray
    sinking: np.ndarray
    pressed: np.ndarray


@dataclass(frozen=True, eq=False)
class Footing:
    """The feet of a robot that balances, as they are found at the end of each frame.

    A foot that lands earlier or later than planned, or higher, bears from when it presses on something; the motion
    that is wanted of the robot goes along with the feet that bear.

    Attributes:
        bears: Of each foot, whether it presses on ground that it is to stand on.
        offsets: (feet, 3) [m], how far each foot is from where it is wanted; forgotten while it is in the air.
        tilts: (feet, 3) [rad], rotation vectors of the ground under the soles, as far as that is known.
        centre: (3,) [m], by how much the centre of mass goes along.
        step: The step that catches the robot, or None.
        frames: For how many frames it was out of balance.
        rise: [m], by how much the ground that soles lay flat on last is higher than where they are wanted.
        ride: How far moving ground has carried the robot; None where none ever did.
    """

    bears: tuple[bool, ...]
    offsets: np.ndarray
    tilts: np.ndarray
    centre: np.ndarray
    step: CaptureStep | None = None
    frames: int = 0
    rise: float = 0.0
    ride: Ride | None = None


def are_planned(heights: np.ndarray) -> np.ndarray:
    """Return which feet are to stand, (worlds, feet) bool, by the heights of wanted soles (worlds, feet) [m]."""
    return np.asarray(heights < heights.min(axis=1, keepdims=True) + STANDS)


def planned_footings(heights: np.ndarray) -> list[Footing]:
    """Return the footings of robots of which nothing is known, by the heights of wanted soles (worlds, feet) [m]."""
    nothing = np.zeros((heights.shape[1], 3))
    return [Footing(tuple(own), nothing, nothing, np.zeros(3)) for own in are_planned(heights).tolist()]


def found_footings(
    before: Sequence[Footing], soles: Soles, weight: float, spans: np.ndarray, leans: np.ndarray
) -> list[Footing]:
    """Return the footings at the end of a frame, without steps, of each world.

    Args:
        before: Those at its beginning.
        soles: The soles.
        weight: Of the robot [N].
        spans: (worlds,) of the frame [s].
        leans: (worlds, 3) [m], by which the centre of mass is to go besides, where the robot carries something.
    """
    planned = are_planned(soles.wanted_places[:, :, 2])
    stood, all_offsets = np.array([own.bears for own in before]), np.array([own.offsets for own in before])
    all_tilts, centres = np.array([own.tilts for own in before]), np.array([own.centre for own in before])
    away = soles.places - soles.wanted_places
    presses = (soles.pressed > FIRM * weight) & (planned | (soles.sinking < GOES_DOWN))
    # one that bears nothing, as the weight is on the other, still stands where it is
    bears = presses | (stood & planned & (np.abs(away[:, :, 2] - all_offsets[:, :, 2]) < RESTS))
    adopts = np.array([1.0 - math.exp(-span / ADOPTS) for span in spans.tolist()])[:, None]
    forgets = np.array([math.exp(-span / FORGETS) for span in spans.tolist()])[:, None]
    kept = np.where(bears, 1.0, forgets)[:, :, None]
    offsets, tilts = np.where(presses[:, :, None], away, all_offsets * kept), all_tilts * kept
    found, tilted = soles.turns @ soles.wanted_turns.swapaxes(-1, -2), np.zeros_like(tilts)
    for w, k in np.argwhere(presses).tolist():
        tilted[w, k, :2] = pin.log3(found[w, k])[:2]
    tilts = np.where(presses[:, :, None], all_tilts + adopts[:, None] * (tilted - all_tilts), tilts)
    count = bears.sum(axis=1)[:, None]
    middle = np.where(bears[:, :, None], offsets, 0.0).sum(axis=1) / np.maximum(count, 1)
    centres = np.where(count > 0, centres + adopts * (middle + leans - centres), centres)
    level = presses & (np.abs(tilted[:, :, :2]).max(axis=2) < FLAT)
    lowest = np.where(level, away[:, :, 2], np.inf).min(axis=1)
    rises = np.where(level.any(axis=1), lowest, [own.rise for own in before]).tolist()
    return [
        Footing(tuple(own), offset, tilt, centre, rise=rise)
        for own, offset, tilt, centre, rise in zip(bears.tolist(), offsets, tilts, centres, rises, strict=True)
    ]
