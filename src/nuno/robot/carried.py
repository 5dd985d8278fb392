"""The load that a robot carries: its mass and its place, from the forces on the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.pinocchio import pin

if TYPE_CHECKING:
    from nuno.robot.robot import Robot

LIGHT = 0.05
"""[kg] Less than this is not counted."""
SMOOTH = 0.1
"""[s] In which a force on a link is taken for that of a load: what is swung pulls to and fro."""
NEGLIGIBLE = 1e-3
"""[N, N m] Smaller ones are forgotten."""


@dataclass(frozen=True, eq=False)
class Carried:
    """A load.

    Attributes:
        mass: [kg].
        place: (3,) [m], its centre in the world, as high as the links that bear it.
    """

    mass: float
    place: np.ndarray

    def seen_from(self, robot: Robot) -> tuple[float, np.ndarray]:
        """Return mass [kg] and place (3,) [m] in the frame of the base link, as ``plan_walk`` takes a load."""
        base = pin.XYZQUATToSE3(robot.configuration()[:7])
        return self.mass, np.asarray(base.actInv(self.place))


def carried_by(robot: Robot, data: Any, q: np.ndarray, loads: np.ndarray | None, gravity: float) -> Carried | None:
    """Return the load that forces on the joints, in their own frames, amount to; None where there is none.

    Args:
        robot: The robot.
        data: Pinocchio's, changed here.
        q: (nq,) where it is.
        loads: (njoints, 6) [N, N m], or None.
        gravity: [m/s2].
    """
    if loads is None:
        return None
    pin.forwardKinematics(robot.model, data, q)
    down, weighted = 0.0, np.zeros(3)
    for place, force in zip(data.oMi, loads, strict=True):
        if not force.any():
            continue
        there = place.act(pin.Force(force))
        upright = float(there.linear[2])
        down -= upright
        # where a force along z has that moment, as high as the joint
        weighted += (there.angular[1], -there.angular[0], -upright * place.translation[2])
    if down < LIGHT * gravity:
        return None
    return Carried(down / gravity, weighted / down)


def smoothed(before: np.ndarray | None, now: np.ndarray | None, span: float) -> np.ndarray | None:
    """Return loads (njoints, 6) [N, N m] after a frame of ``span`` [s], which follow those of now; None of none."""
    if before is None and now is None:
        return None
    was = 0.0 if before is None else before
    found = was + (1.0 - np.exp(-span / SMOOTH)) * ((0.0 if now is None else now) - was)
    return found if np.abs(found).max() > NEGLIGIBLE else None
