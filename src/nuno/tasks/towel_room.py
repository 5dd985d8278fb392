"""A room to try picking in: a robot at a table with a towel on it, simulated, seen through the robot's own cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import box, plane, sheet
from nuno.camera.picture import Chequer
from nuno.camera.table import Table
from nuno.errors import BodyStateError
from nuno.joints.held_points import held_points
from nuno.materials import Cloth
from nuno.robot.head_cameras import STEREO, HeadCameras
from nuno.robot.humanoid import Humanoid
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.tasks.hand_beads import put_beads
from nuno.tasks.pick_towel import TRUNK
from nuno.world.world import World

TABLE = Table(0.72, (0.42, 0.6), (0.77, 0.0), 0.04)
TOWEL = (0.4, 0.3)
"""[m]"""
CELLS = (36, 27)
"""Finer than any mesh of the estimate, and of no multiple of its grid: the points that are picked are no vertices."""
CHEQUER = Chequer(0.1, "#dfe6ee")
READY = {"left_hand": (0.3, 0.5, 0.9), "right_hand": (0.3, -0.5, 0.9)}
"""[m] Where the hands wait: above the table and beside what the cameras see."""


@dataclass(eq=False)
class TowelRoom:
    """A robot at a table with a towel, the "real" world of the closed loop.

    Attributes:
        world: The world, in which nothing is known to the robot but what its driver and its cameras tell.
        driver: The robot's driver, whose cameras see the room.
        towel: The towel; it is cloth.
        cameras: The driver's eyes; for a judge, who may look from elsewhere with them.
        lay: (n, 3) [m], the towel's vertices when the room was made.
    """

    world: World
    driver: SimulatedRobot
    towel: Body
    cameras: HeadCameras
    lay: np.ndarray

    def held(self) -> np.ndarray:
        """Return where, on the towel as it lay, the hands truly hold it: (3,) [m]; for a judge, not for the robot.

        Raises:
            BodyStateError: no hand holds it.
        """
        return self._mean_held(self.lay)

    def held_at(self) -> np.ndarray:
        """Return where what the hands truly hold is now: (3,) [m]; for a judge, not for the robot.

        Raises:
            BodyStateError: no hand holds it.
        """
        return self._mean_held(self.towel.vertices)

    def _mean_held(self, vertices: np.ndarray) -> np.ndarray:
        grips = [grip for hand in self.driver.hands.values() for grip in hand.grips if grip.body is self.towel]
        if not grips:
            raise BodyStateError("no hand holds the towel")
        return np.concatenate([held_points(grip, 0, vertices) for grip in grips]).mean(axis=0)


def make_room(
    material: Cloth, *, position: tuple[float, float] = (0.545, 0.01), yaw: float = 0.1, device: str = "auto",
    noise: float = 2.0, color: str = "#3f6fb5", chequer: Chequer | None = CHEQUER, seed: int = 0,
) -> TowelRoom:  # fmt: skip
    """Put Talos at a table with a towel.

    Args:
        material: Of the towel.
        position: x, y of the towel's middle [m].
        yaw: Of its longer side from the y axis [rad].
        device: As of ``World``.
        noise: Of the pictures [levels].
        color: Of the towel.
        chequer: Its pattern; None is plain.
        seed: Of the noise.
    """
    world = World(device=device)
    half, centre = TABLE.half_extents, TABLE.centre
    assert half is not None and centre is not None
    size = (2.0 * half[0], 2.0 * half[1], TABLE.thickness)
    world.add(plane(name="floor", color="#b9b2a6"))
    world.add(box(size, name="table", color="#a9825a", position=(*centre, TABLE.height - 0.5 * TABLE.thickness)))
    thick = float(np.asarray(material.thickness).max())
    towel = sheet(TOWEL, cells=CELLS, name="towel", color=color, position=(*position, TABLE.height + 0.5 * thick))
    towel.rotate(0.5 * np.pi + yaw, "z", wrt="world")
    world.add(towel)
    world.attach(towel, material)
    robot = Humanoid("talos")
    robot.reach(READY, stance=TRUNK)
    links = robot.copy().enter(world)
    put_beads(links)
    patterns = {} if chequer is None else {towel: chequer}
    cameras = HeadCameras(links, STEREO, patterns=patterns, samples=2, noise=noise, seed=seed)
    driver = SimulatedRobot(robot, world, links=links, cameras=cameras)
    return TowelRoom(world, driver, towel, cameras, towel.vertices)
