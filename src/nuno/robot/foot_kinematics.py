"""FootKinematics: centres of mass and soles of robots of one model, as arrays over worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.robot import Robot

WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class FootKinematics:
    """Centres of mass and soles, and their motion, in each of some worlds.

    Attributes:
        centres: (worlds, 3, 3) places, velocities and accelerations of the centres of mass [m, m/s, m/s2].
        places: (worlds, feet, 3) of the soles [m].
        turns: (worlds, feet, 3, 3) rotation matrices of the soles.
        speeds: (worlds, feet, 6) [m/s, rad/s], along the world's axes.
        accelerations: (worlds, feet, 6) [m/s2, rad/s2], likewise.
    """

    centres: np.ndarray
    places: np.ndarray
    turns: np.ndarray
    speeds: np.ndarray
    accelerations: np.ndarray


class FeetAndCentre:
    """Works out the kinematics of a robot's feet and centre of mass, once where it is asked for the same motion again.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        self._asked: list[Any] = []
        self._found: FootKinematics | None = None

    def copy(self) -> FeetAndCentre:
        """Return another one of the same robot."""
        made = FeetAndCentre.__new__(FeetAndCentre)
        made._model, made._feet, made._data = self._model, self._feet, self._model.createData()
        made._asked, made._found = [], None
        return made

    def of(
        self, q: Sequence[np.ndarray], v: Sequence[np.ndarray], a: Sequence[np.ndarray]
    ) -> FootKinematics:  # fmt: skip
        """Return the kinematics in configurations (nq,), with velocities and accelerations (nv,), of each world.

        Arrays that are the same objects as at the last call are taken to be unchanged.
        """
        asked = [*q, *v, *a]
        if self._found is None or len(asked) != len(self._asked) or any(map(_differ, asked, self._asked)):
            self._found, self._asked = self._work_out(q, v, a), asked
        return self._found

    def _work_out(
        self, q: Sequence[np.ndarray], v: Sequence[np.ndarray], a: Sequence[np.ndarray]
    ) -> FootKinematics:  # fmt: skip
        model, data, feet = self._model, self._data, self._feet
        worlds, count = len(q), len(feet)
        centres = np.empty((worlds, 3, 3))
        places, turns = np.empty((worlds, count, 3)), np.empty((worlds, count, 3, 3))
        speeds, accelerations = np.empty((worlds, count, 6)), np.empty((worlds, count, 6))
        # Pinocchio's own, in which it always has what it found last
        soles = [data.oMf[foot] for foot in feet]
        own = data.com[0], data.vcom[0], data.acom[0]
        for w, motion in enumerate(zip(q, v, a, strict=True)):
            pin.centerOfMass(model, data, *motion)
            centres[w] = own
            for k, (foot, sole) in enumerate(zip(feet, soles, strict=True)):
                pin.updateFramePlacement(model, data, foot)
                places[w, k], turns[w, k] = sole.translation, sole.rotation
                speeds[w, k] = pin.getFrameVelocity(model, data, foot, WORLD_AXES).vector
                accelerations[w, k] = pin.getFrameClassicalAcceleration(model, data, foot, WORLD_AXES).vector
        return FootKinematics(centres, places, turns, speeds, accelerations)


def _differ(one: Any, other: Any) -> bool:
    return one is not other
