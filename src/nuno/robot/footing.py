"""Footing: which feet truly bear a robot, and how far from where they are wanted they do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.pinocchio import pin

if TYPE_CHECKING:
    from nuno.robot.capture_step import CaptureStep

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
ADOPTS = 0.2
"""[s] and in which a tilted sole's tilt is taken for the ground's, and the centre of mass goes along with the feet."""


@dataclass(frozen=True, eq=False)
class Soles:
    """Soles of a robot, as they are and as they are wanted.

    Attributes:
        places: Where they are.
        wanted: Where they are wanted.
        sinking: (feet,) [m/s], vertical velocities that are wanted.
        pressed: (feet,) [N], with what they press on the ground; None where that is not known yet.
    """

    places: Sequence[Any]
    wanted: Sequence[Any]
    sinking: np.ndarray
    pressed: np.ndarray | None


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
    """

    bears: tuple[bool, ...]
    offsets: np.ndarray
    tilts: np.ndarray
    centre: np.ndarray
    step: CaptureStep | None = None
    frames: int = 0


def found_footing(before: Footing | None, soles: Soles, weight: float, span: float, lean: Any = 0.0) -> Footing:
    """Return the footing at the end of a frame, without a step.

    Args:
        before: That at its beginning; None where nothing is known.
        soles: The soles.
        weight: Of the robot [N].
        span: Of the frame [s].
        lean: (3,) [m], by which the centre of mass is to go besides, where the robot carries something.
    """
    count = len(soles.places)
    lowest = min(own.translation[2] for own in soles.wanted)
    planned = [bool(own.translation[2] < lowest + STANDS) for own in soles.wanted]
    if before is None:
        nothing = np.zeros((count, 3))
        return Footing(tuple(planned), nothing, nothing, np.zeros(3))
    pressed = np.full(count, np.inf) if soles.pressed is None else soles.pressed
    heights = [there.translation[2] - own.translation[2] for there, own in zip(soles.places, soles.wanted, strict=True)]
    presses = [
        bool(force > FIRM * weight and (plan or speed < GOES_DOWN))
        for force, plan, speed in zip(pressed, planned, soles.sinking, strict=True)
    ]
    # one that bears nothing, as the weight is on the other, still stands where it is
    bears = tuple(
        own or (was and plan and abs(height - offset) < RESTS)
        for own, was, plan, height, offset in zip(
            presses, before.bears, planned, heights, before.offsets[:, 2], strict=True
        )
    )
    adopts = 1.0 - math.exp(-span / ADOPTS)
    kept = np.where(bears, 1.0, math.exp(-span / FORGETS))[:, None]
    offsets, tilts = before.offsets * kept, before.tilts * kept
    for k, bearing in enumerate(presses):
        if bearing:
            offsets[k] = soles.places[k].translation - soles.wanted[k].translation
            tilt = pin.log3(soles.places[k].rotation @ soles.wanted[k].rotation.T)
            tilts[k] = before.tilts[k] + adopts * (np.array([tilt[0], tilt[1], 0.0]) - before.tilts[k])
    centre = before.centre
    if any(bears):
        centre = centre + adopts * (offsets[list(bears)].mean(axis=0) + lean - centre)
    return Footing(bears, offsets, tilts, centre)
