"""The tasks of benchmarks/planning_tasks.py in the hands of Talos: what its arms do where those take points for hands.

The robot stands behind the table, 0.72 m below its top, and looks along -y at rod, box and cloth. The six numbers of a
motion say where the two held points of the cloth go, as before; inverse kinematics makes joint angles of them, and the
driver of the robot, or of its copies, goes through these.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from planning_tasks import Cover, Task

import nuno
from nuno import Coordinates, Humanoid, Knots, SimulatedRobot, World
from nuno.robot.placement import quaternion_of

TOP = 0.72  # [m] of the table's top above the floor
ABOVE = 0.043  # [m] of a hand's frame above the vertex that it holds; at 0.036 leaning fingers met the table
KEYS = 0.2  # [s] between postures
MISS = 2e-3  # [m] by which a hand may miss its place
UNREACHED = 1.0  # what a motion costs of which no posture is within reach
SIDES = {"right": -1.0, "left": 1.0}


class Arms(Task):
    """A task whose hands are those of Talos."""

    dynamics: ClassVar[bool] = False
    stands: ClassVar[float] = 0.65  # [m] from the table's middle, of the robot

    def furnish(self) -> None:
        """Draw the room, and let the robot stand there with its hands above the table."""
        super().furnish()
        self.world.add(nuno.plane(name="floor", position=(0.0, 0.0, -TOP)))
        model = Humanoid("talos")
        model.stand((0.0, self.stands, -TOP), -0.5 * np.pi)
        self.stance = (*model.description.feet, model.model.names[1])
        ahead, down = np.array((0.0, -1.0, 0.0)), np.array((0.0, 0.0, -1.0))
        turned = np.stack([ahead, np.cross(down, ahead), down], axis=1)
        self.turn, self.back = quaternion_of(turned), -ABOVE * down
        start = {f"{side}_hand": Coordinates((sign * 0.15, 0.2, 0.15), self.turn) for side, sign in SIDES.items()}
        found = model.reach(start, stance=self.stance)
        assert found, found.reason
        self.robot = SimulatedRobot(model, self.world, dynamics=self.dynamics)
        self.unreached = np.zeros(1)

    def come(self) -> None:
        """Bring the hands from above to the pair of vertices."""
        first, second = self.look_at_pair()
        for up in (0.1, 0.0):
            over = np.concatenate([0.5 * (first + second) + (0.0, 0.0, up), 0.5 * (second - first)])
            angles, _ = self.postures(over[None, None])
            self.robot.angle_vector(angles[0, 0], 1.0)
            self.robot.wait_interpolation()

    def look_at_pair(self) -> np.ndarray:
        """Return where the pair of vertices is (2, 3) [m]."""
        return self.vertices(self.world)[0, self.pair]

    def act(self, world: World, motion: Knots) -> None:
        """Let the hands hold the pair of vertices and go the motion."""
        self.release()
        futures = world.world_count > 1
        if futures:
            world.set_material("cloth", self.nominal)
            self.believe(world)
        count = max(2, round(motion.seconds / KEYS))
        times = np.linspace(0.0, motion.seconds, count + 1)[1:]
        ways = np.reshape(motion.at(times), (world.world_count, count, 6))
        angles, self.unreached = self.postures(ways)
        robot = world.robot if futures else self.robot
        robot.angle_vector_sequence(angles if futures else list(angles[0]), np.diff(times, prepend=0.0).tolist())
        for vertex, side in zip(self.pair, SIDES, strict=True):
            link = self.robot.hands[f"{side}_hand"].body.name
            self.held.append(world.grip("cloth", np.array([vertex]), to=world.find(link)))
        if futures:
            self.imagined += world.world_count * motion.seconds

    def postures(self, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return angles (worlds, k, n) of a batch of ways (worlds, k, 6), and the share out of reach (worlds,)."""
        first, second = self.pair
        most = 0.5 * float(np.linalg.norm(self.flat[first] - self.flat[second]))
        half = ways[..., 3:]
        half = half * np.minimum(1.0, most / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9))
        start = self.robot.actual.configuration()
        model = self.robot.actual.copy()
        angles, missed = np.zeros((*ways.shape[:2], len(model.joint_names))), np.zeros(len(ways))
        for w, (way, apart) in enumerate(zip(ways[..., :3], half, strict=True)):
            model.take_configuration(start)
            for k, (middle, off) in enumerate(zip(way, apart, strict=True)):
                targets = {
                    f"{side}_hand": Coordinates(middle + sign * off + self.back, self.turn)
                    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True)
                }
                found = model.reach(
                    targets, stance=self.stance, tolerance=MISS, angle_tolerance=0.02, attempts=1,
                    check_collisions=False,
                )  # fmt: skip
                missed[w] += not found
                angles[w, k] = model.angle_vector()
        return angles, missed / ways.shape[1]

    def judge(self, futures: World) -> np.ndarray:
        """Return the cost of each future, with what was out of reach."""
        return super().judge(futures) + UNREACHED * self.unreached


class ArmCover(Arms, Cover):
    """Cover, by Talos."""


class DynamicCover(ArmCover):
    """Cover, by Talos with dynamics."""

    dynamics, samples, iterations = True, 6, 1
    stands = 0.58  # from 0.65 m its trunk leans so far that a joint gives all it can, and hands end up 3 to 9 cm off


DYNAMIC_TASKS: dict[str, type[Task]] = {task.name: task for task in (DynamicCover,)}
ARM_TASKS: dict[str, type[Task]] = {task.name: task for task in (ArmCover,)}
