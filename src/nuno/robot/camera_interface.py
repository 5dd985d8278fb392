"""CameraInterface: the cameras of a robot as its driver offers them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nuno.camera.camera import Camera
from nuno.errors import RobotModelError, UnknownNameError
from nuno.robot.joint_interface import JointInterface
from nuno.robot.readings import ImageReading
from nuno.validation import checked


class CameraInterface(JointInterface):
    """A robot with cameras: those of its description, by name ("head", "head_left" ...)."""

    # What a robot with cameras must bring

    def read_image(self, camera: str) -> ImageReading:
        """Return a fresh image of a camera, in colour.

        Raises:
            UnknownNameError: the robot has no such camera.
            RobotModelError: no images come of it.
            RobotTimeoutError: none came in time.
        """
        raise RobotModelError(f"{self.robot.name!r} shows no images of {self._checked_camera(camera)!r}")

    def read_depth(self, camera: str) -> ImageReading:
        """Return a fresh depth image of a camera; raises as ``read_image``."""
        raise RobotModelError(f"{self.robot.name!r} shows no depths of {self._checked_camera(camera)!r}")

    def read_images(self, cameras: Sequence[str]) -> dict[str, ImageReading]:
        """Return fresh images of several cameras, by name, of one time where the robot takes them so."""
        return {name: self.read_image(name) for name in cameras}

    @property
    def shown_cameras(self) -> tuple[str, ...]:
        """The cameras that images come of."""
        return ()

    # What programs use

    @property
    def camera_names(self) -> tuple[str, ...]:
        """The robot's cameras."""
        return tuple(self.robot.description.cameras)

    def image(self, camera: str = "head") -> np.ndarray:
        """Return what a camera sees now, (h, w, 3) uint8, red, green and blue; see ``read_image``."""
        return self.read_image(camera).image

    def depth(self, camera: str = "head") -> np.ndarray:
        """Return how far what a camera sees is along its axis, (h, w) float32 [m], inf where nothing is."""
        return self.read_depth(camera).image

    @checked
    def camera_info(self, camera: str = "head") -> Camera:
        """Return a camera: its pixels by the description, and where it is now by the joints' readings.

        Raises:
            UnknownNameError: the robot has no such camera.
        """
        name = self._checked_camera(camera)
        self.update_robot_state()
        return self.robot.camera(name)

    # Inside

    def _checked_camera(self, camera: str) -> str:
        if camera not in self.robot.description.cameras:
            raise UnknownNameError("camera", camera, list(self.robot.description.cameras))
        return camera
