"""Readings: what a robot tells of itself, with the time at which it was so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera


@dataclass(frozen=True, eq=False)
class JointState:
    """Joints as their encoders and motors tell, in any order.

    Attributes:
        time: [s] of the robot's clock.
        names: Of the joints, m of them.
        positions: (m,) float [rad; m for slides].
        velocities: (m,) float [rad/s; m/s].
        efforts: (m,) float [N m; N].
    """

    time: float
    names: tuple[str, ...]
    positions: np.ndarray
    velocities: np.ndarray
    efforts: np.ndarray


@dataclass(frozen=True, eq=False)
class ImuReading:
    """An inertial measurement unit, in its own frame.

    Attributes:
        time: [s] of the robot's clock.
        quaternion: (4,) float, (w, x, y, z), from its frame to the world's.
        angular_velocity: (3,) float [rad/s].
        linear_acceleration: (3,) float [m/s2]; at rest it is that of gravity, upwards.
    """

    time: float
    quaternion: np.ndarray
    angular_velocity: np.ndarray
    linear_acceleration: np.ndarray


@dataclass(frozen=True, eq=False)
class ImageReading:
    """An image of one of the robot's cameras.

    Attributes:
        time: When it was taken [s] of the robot's clock.
        camera: The camera: its pixels, and where it was as far as the robot's joints tell.
        image: (h, w, 3) uint8, red, green and blue; of depths (h, w) float32 [m], inf where nothing is.
    """

    time: float
    camera: Camera
    image: np.ndarray
