"""Ride: how far what bears a robot's feet has carried it, and how that moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.shapes import quaternion as quat


@dataclass(frozen=True, eq=False)
class Ride:
    """The way that static bodies on paths have carried a robot that stands on them, and how they go on.

    What is wanted of the robot stays where it was commanded; a ride leads from there to where its ground has gone. The
    ground's turn about the upright axis counts, its tilt does not.

    Attributes:
        shift: (3,) [m], and
        yaw: [rad], of the motion (a turn about the world's upright axis, then the shift) that has added up.
        pivot: (3,) [m], of the ground under the soles now.
        speed: (3,) [m/s], of the ground at the pivot.
        spin: [rad/s], about the upright axis.
        acceleration: (3,) [m/s2], of the ground at the pivot.
    """

    shift: np.ndarray
    yaw: float
    pivot: np.ndarray
    speed: np.ndarray
    spin: float
    acceleration: np.ndarray

    @property
    def moves(self) -> bool:
        """Return True while the ground moves."""
        return self.spin != 0.0 or bool(self.speed.any() or self.acceleration.any())

    def carried(self, q: np.ndarray) -> np.ndarray:
        """Return a configuration (nq,) that is wanted, seen from the ground, in the world."""
        found = q.copy()
        x, y, z, w = q[3:7].tolist()
        turn = about_upright(self.yaw)
        found[:3] = quat.rotate(turn, q[:3]) + self.shift
        found[3:7] = np.roll(quat.multiply(turn, np.array([w, x, y, z])), -1)
        return found

    def speeds(self, places: np.ndarray) -> np.ndarray:
        """Return the velocities (..., 3) [m/s] of the ground as it would be at places (..., 3) [m]."""
        return self.speed + np.cross((0.0, 0.0, self.spin), places - self.pivot)

    def twists(self, places: np.ndarray) -> np.ndarray:
        """Return velocities and accelerations (2, ..., 6) of the ground at places (..., 3) along the world's axes."""
        found = np.zeros((2, *places.shape[:-1], 6))
        found[0, ..., :3], found[0, ..., 5], found[1, ..., :3] = self.speeds(places), self.spin, self.acceleration
        return found


def about_upright(angle: float) -> np.ndarray:
    """Return the rotation about the world's upright axis by an angle [rad]."""
    return quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(angle))
