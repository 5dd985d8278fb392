"""SimulatedSenses: what the sensors and cameras of a simulated robot tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.errors import RobotModelError
from nuno.robot.interface import RobotInterface
from nuno.robot.readings import ImageReading, ImuReading
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.camera.camera import Camera
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.robot_state import RobotState
    from nuno.robot.sensors import Readings, Sensors
    from nuno.robot.simulated_cameras import SimulatedCameras
    from nuno.world.world import World


class SimulatedSenses(RobotInterface):
    """Sensors and cameras of ``SimulatedRobot``.

    Attributes:
        actual: The robot that is simulated, as it truly is.
        world: Where it is.
        sensors: Its sensors.
    """

    actual: Humanoid
    world: World
    sensors: Sensors
    _state: RobotState
    _readings: tuple[float, Readings] | None
    _cameras: SimulatedCameras

    def read(self) -> Readings:
        """Return what all sensors tell, read once a frame."""
        with self.world.lock:
            state = self._state
            if self._readings is None or self._readings[0] != state.time:
                self._readings = (state.time, self.sensors.read(state))
            return self._readings[1]

    @checked
    def read_wrench(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) [N] and torque (3,) [N m] of what lies beyond a sensor; see ``RobotInterface``.

        Raises:
            RobotModelError: the robot has no such sensor.
        """
        found = self.read().wrenches.get(frame)
        if found is None:
            raise RobotModelError(f"{self.actual.name!r} has no force sensor in {frame!r}")
        return found[:3].copy(), found[3:].copy()

    def read_imu(self) -> ImuReading:
        """Return what the inertial measurement unit tells.

        Raises:
            RobotModelError: the robot has none.
        """
        if "imu" not in self.actual.description.frames:
            raise RobotModelError(f"{self.actual.name!r} has no inertial measurement unit")
        read = self.read()
        return ImuReading(read.sampled["orientation"], read.orientation, read.angular_velocity, read.specific_force)

    @property
    def shown_cameras(self) -> tuple[str, ...]:
        """The cameras that images come of: all."""
        return self.camera_names

    def read_image(self, camera: str) -> ImageReading:
        """Return what a camera sees now, or saw last where its cameras have a rate; see ``CameraInterface``."""
        return self.read_images((camera,))[camera]

    def read_images(self, cameras: Sequence[str]) -> dict[str, ImageReading]:
        """Return what several cameras see at one time."""
        pictures = self._cameras.look([self._checked_camera(name) for name in cameras])
        return {name: ImageReading(own.time, own.camera, own.color.numpy()) for name, own in pictures.items()}

    def read_depth(self, camera: str) -> ImageReading:
        """Return how far what a camera sees is; see ``CameraInterface``."""
        picture = self._cameras.look((self._checked_camera(camera),))[camera]
        return ImageReading(picture.time, picture.camera, picture.depth.numpy())

    def camera_info(self, camera: str = "head") -> Camera:
        """Return a camera, with the pixels that its images have; see ``CameraInterface``."""
        return self._cameras.pixels(super().camera_info(camera), camera)
