"""FoldPictures: a fold as somebody sees it who stands on the other side of the table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.head_cameras import HeadCameras
from nuno.robot.robot_model import standing_place
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.tasks.look_at_camera import look_at_camera

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.bodies.body import Body

AHEAD, ASIDE, ABOVE = 1.15, -0.85, 0.6
"""[m] From the cloth to the camera, as the robot sees it."""
LIFTED = 0.12
"""[m] Over the cloth, what the camera looks at."""
WIDTH, HEIGHT, FOCAL = 480, 400, 620.0
"""[px]"""


class FoldPictures:
    """Pictures of a robot and a cloth; a ``watch`` for ``play_fold``.

    Args:
        robot: The robot.
        cloth: The cloth, where it lies before.

    Attributes:
        pictures: (h, w, 3) uint8 by moment.
    """

    def __init__(self, robot: SimulatedRobot, cloth: Body) -> None:
        self._looks = HeadCameras(robot.links, (), samples=2)
        yaw = standing_place(robot.robot)[2]
        middle = np.asarray(cloth.vertices).mean(axis=0)
        c, s = math.cos(yaw), math.sin(yaw)
        eye = middle + np.array((c * AHEAD - s * ASIDE, s * AHEAD + c * ASIDE, ABOVE))
        self.camera = look_at_camera(eye, middle + np.array((0.0, 0.0, LIFTED)), WIDTH, HEIGHT, FOCAL)
        self.pictures: dict[str, np.ndarray] = {}

    def __call__(self, moment: str) -> None:
        """Take a picture."""
        self.pictures[moment] = self._looks.look_from(self.camera).color.numpy()

    def figure(self) -> Figure:
        """Return all pictures side by side, with their moments."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(2.4 * len(self.pictures), 2.25), layout="constrained", facecolor="white")
        for k, (moment, picture) in enumerate(self.pictures.items()):
            axes = figure.add_subplot(1, len(self.pictures), k + 1)
            axes.imshow(picture)
            axes.set_title(moment, fontsize=9)
            axes.set_axis_off()
        return figure
