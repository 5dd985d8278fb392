"""The four tasks of benchmarks/planning.py: their rooms, hands, costs, fixed plans and criteria.

A square cloth of 0.3 m lies on a table of 0.9 m, whose top is z = 0. Two hands are points that hold two of its corners.
Six numbers say where they are: their middle, and half of what is between them, which is never longer than half of the
flat cloth's distance. Each seed draws the room anew, and the true cloth's bending and friction, of which imagination
knows nothing: it takes the nominal material.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np

from nuno import Cloth, Knots, Path, Rigid, World, box, capsule, cylinder, sheet
from nuno.envs.top_view import TopView

SIDE, TABLE, LIFT = 0.3, 0.9, 0.002  # [m] of the cloth, of the table, of a flat cloth above it
REACH = 0.03  # [m] from where a hand closes to the vertex that it takes
STEP = 1.0 / 60.0  # [s] between keys of the hands' paths
TAUT = 10.0  # [1/J] what elastic energy costs when hands open: 0.1 J throws the cloth at 3 m/s
CLEAR = 0.03  # [m] above the table, from which on a vertex is off it


class Task(ABC):
    """A task: a true world, two hands, and what is imagined with them.

    Args:
        seed: Of the room.
        device: Where all runs.

    Attributes:
        world: The true one.
        imagined: Simulated seconds of all futures so far, those of ``cost`` included [s].
    """

    name: ClassVar[str]
    cells: ClassVar[int] = 16
    pairs: ClassVar[tuple[tuple[int, int], ...]] = ((2, 3),)  # corners that the hands hold, stage by stage
    horizon: ClassVar[float] = 2.4  # [s] of a stage
    every: ClassVar[float] = 0.8  # [s] between plans
    settle: ClassVar[float] = 0.4  # [s] after the horizon, with open hands, before a cost is read
    samples: ClassVar[int] = 24
    iterations: ClassVar[int] = 2
    spread: ClassVar[tuple[float, ...]] = (0.05, 0.05, 0.04, 0.01, 0.01, 0.01)  # [m]
    lowest: ClassVar[tuple[float, ...]] = (-0.4, -0.42, 0.006, -0.15, -0.15, -0.05)  # [m]
    highest: ClassVar[tuple[float, ...]] = (0.4, 0.42, 0.5, 0.15, 0.15, 0.05)

    def __init__(self, seed: int, device: str = "cpu") -> None:
        self.random = np.random.default_rng(seed)
        self.world = World(device=device, frame_rate=64.0)
        self.world.add(box((TABLE, TABLE, 0.02), name="table", position=(0.0, 0.0, -0.01), friction=0.5))
        self.cloth = self.world.add(sheet((SIDE, SIDE), (self.cells, self.cells), name="cloth", position=(0, 0, LIFT)))
        self.flat = np.array(self.cloth.vertices, dtype=float)
        n = self.cells
        self.corners = np.array([0, n, n * (n + 1), (n + 1) * (n + 1) - 1])  # -x -y, +x -y, -x +y, +x +y
        bending, friction = 2.0 ** self.random.uniform(-1.0, 1.0), self.random.uniform(0.7, 1.3)
        self.nominal = Cloth()
        self.true = Cloth(
            bending_rigidity=bending * self.nominal.bending_rigidity, friction=friction * self.nominal.friction
        )
        self.world.attach(self.cloth, self.true)
        self.held: list[Any] = []
        self.pair = np.array([0, 1])
        self.imagined = 0.0
        self.furnish()

    def furnish(self) -> None:
        """Draw what is in the room, and how the cloth lies."""
        place, turn = self.random.uniform(-0.04, 0.04, 2) + np.array((0.0, -0.14)), self.random.uniform(-0.3, 0.3)
        c, s = np.cos(turn), np.sin(turn)
        lying = np.array(self.flat)
        lying[:, :2] = self.flat[:, :2] @ np.array([[c, s], [-s, c]]) + place
        self.world.set_vertices(self.cloth, lying)

    @abstractmethod
    def fixed(self, seen: np.ndarray, stage: int) -> np.ndarray:
        """Return knots (k, 6) of a stage; of this seed's room they know only the corners that were seen (4, 3)."""

    @abstractmethod
    def cost(self, world: World) -> np.ndarray:
        """Return how far from its end each world is (worlds,), after hands are open and it has settled."""

    @abstractmethod
    def figures(self) -> dict[str, float]:
        """Return what the criterion is about, of the true world at rest."""

    @abstractmethod
    def is_solved(self, figures: dict[str, float]) -> bool:
        """Return whether the criterion is met."""

    # Hands

    def vertices(self, world: World) -> np.ndarray:
        """Where the cloth is, (worlds, n, 3) [m]."""
        return np.asarray(world.find("cloth").vertices, dtype=float).reshape(world.world_count, -1, 3)

    def now(self, world: World) -> np.ndarray:
        """Open the hands, which take hold anew at once, and return their middle and half of their distance, (6,)."""
        self.release()
        a, b = self.vertices(world)[0, self.pair]
        return np.concatenate([0.5 * (a + b), 0.5 * (b - a)])

    def act(self, world: World, motion: Knots) -> None:
        """Let the hands hold the pair of vertices and go the motion."""
        self.release()
        if world.world_count > 1:
            world.set_material("cloth", self.nominal)
            self.believe(world)
        times = np.linspace(0.0, motion.seconds, max(2, round(motion.seconds / STEP) + 1))
        way = motion.at(times)
        first, second = self.pair
        most = 0.5 * float(np.linalg.norm(self.flat[first] - self.flat[second]))
        half = way[..., 3:]
        half = half * np.minimum(1.0, most / np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-9))
        for vertex, sign in zip(self.pair, (-1.0, 1.0), strict=True):
            path = Path(world.time + times, way[..., :3] + sign * half)
            self.held.append(world.grip("cloth", np.array([vertex]), to=path))
        if world.world_count > 1:
            self.imagined += world.world_count * motion.seconds

    def believe(self, futures: World) -> None:  # noqa: B027
        """Give futures what is nominal beside the cloth's material."""

    def come(self) -> None:  # noqa: B027
        """Bring the hands to the pair of vertices; hands that are points are there."""

    def carried_out(self) -> float:
        """Open the hands, let the true world settle, and return its cost, of the same terms as in imagination."""
        taut = float(np.asarray(self.cloth.elastic_energy))
        self.release()
        self.world.run(self.settle, progress=False)
        return float(self.cost(self.world)[0]) + TAUT * taut

    def judge(self, futures: World) -> np.ndarray:
        """Open the hands, let all settle, and return the cost of each future; cloth that is taut before snaps away."""
        taut = np.asarray(futures.find("cloth").elastic_energy)  # [J]
        self.release()
        futures.run(self.settle)
        self.imagined += futures.world_count * self.settle
        return self.cost(futures) + TAUT * taut

    def release(self) -> None:
        """Open the hands."""
        for grip in self.held:
            grip.release()
        self.held = []

    def look(self) -> np.ndarray:
        """Return where the corners are, (4, 3) [m]."""
        return self.vertices(self.world)[0, self.corners]

    def nearest(self, place: np.ndarray) -> int:
        """Return the vertex that a hand takes at a place [m], -1 for none within reach."""
        away = np.linalg.norm(self.vertices(self.world)[0] - place, axis=-1)
        return int(away.argmin()) if away.min() <= REACH else -1


class Flatten(Task):
    """A cloth that was picked up at a point, lifted and dropped is to lie flat."""

    name = "flatten"
    pairs = ((0, 3), (2, 1), (0, 1), (2, 3))
    horizon, every, settle = 1.5, 0.75, 0.3
    spread = (0.03, 0.03, 0.03, 0.03, 0.03, 0.01)
    lowest = (-0.3, -0.3, 0.006, -0.22, -0.22, -0.05)
    highest = (0.3, 0.3, 0.3, 0.22, 0.22, 0.05)

    def furnish(self) -> None:
        """Pick the cloth up at some vertex, lift it by 0.25 m and drop it."""
        vertex = int(self.random.integers(len(self.flat)))
        turn = self.random.uniform(-np.pi, np.pi)
        c, s = np.cos(turn), np.sin(turn)
        self.world.set_vertices(self.cloth, self.flat @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
        start = self.vertices(self.world)[0, vertex]
        lift = [start, start + np.array((0.0, 0.0, 0.25))]
        way = Path(self.world.time + np.array([0.0, 0.75]), lift, None, "minimum_jerk")
        grip = self.world.grip(self.cloth, np.array([vertex]), to=way)
        self.world.run(1.0, progress=False)
        grip.release()
        self.world.run(1.0, progress=False)

    def fixed(self, seen: np.ndarray, stage: int) -> np.ndarray:
        """Draw two corners apart along the line on which they lie, 0.1 m up, and lay them down."""
        a, b = self.pairs[stage]
        middle, across = 0.5 * (seen[a] + seen[b]), (seen[b] - seen[a]) * (1.0, 1.0, 0.0)
        flat = float(np.linalg.norm(self.flat[self.corners[a]] - self.flat[self.corners[b]]))
        half = 0.5 * flat * across / max(float(np.linalg.norm(across)), 1e-6)
        return np.array([[*middle[:2], z, *half] for z in (0.1, 0.1, 0.006)])

    def cost(self, world: World) -> np.ndarray:
        """Return the vertices' root mean square distance [m] from the flat cloth that fits best (Kabsch, 1976)."""
        flat = self.flat - self.flat.mean(axis=0)
        lies = self.vertices(world)
        lies = lies - lies.mean(axis=1, keepdims=True)
        left, _, right = np.linalg.svd(np.einsum("wni,nj->wij", lies, flat))
        sign = np.ones((len(lies), 3))
        sign[:, 2] = np.linalg.det(left @ right)
        turned = flat @ np.swapaxes((left * sign[:, None]) @ right, 1, 2)
        return np.sqrt(((lies - turned) ** 2).sum(axis=2).mean(axis=1))

    def figures(self) -> dict[str, float]:
        """Return the area that the cloth covers, seen from above, over its own."""
        return {"covered": float(TopView(self.world, self.cloth).area()[0]) / SIDE**2}

    def is_solved(self, figures: dict[str, float]) -> bool:
        """It covers 90 % of its own area."""
        return figures["covered"] >= 0.9


class Hang(Task):
    """A cloth that lies before a rod is to hang over it."""

    name = "hang"
    settle = 0.6

    def furnish(self) -> None:
        """Draw the rod's place and height."""
        super().furnish()
        self.rod = np.array((0.0, 0.1 + self.random.uniform(-0.08, 0.08), 0.3 + self.random.uniform(-0.05, 0.05)))
        turned = (np.cos(np.pi / 4), 0.0, np.sin(np.pi / 4), 0.0)
        self.world.add(capsule(0.02, 0.6, name="rod", position=self.rod, quaternion=turned, friction=0.8))

    def fixed(self, seen: np.ndarray, stage: int) -> np.ndarray:
        """Go over a rod at y = 0.1 m, z = 0.3 m, and half of the cloth's length down behind it."""
        half = (0.5 * SIDE, 0.0, 0.0)
        return np.array([(0.0, y, z, *half) for y, z in ((0.02, 0.42), (0.2, 0.38), (0.14, 0.18), (0.14, 0.18))])

    def parts(self, world: World) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the share of vertices off the table, the share behind the rod, and the middle's distance from it."""
        lies = self.vertices(world)
        away = np.linalg.norm((lies.mean(axis=1) - self.rod)[:, 1:], axis=1)
        return (lies[..., 2] > CLEAR).mean(axis=1), (lies[..., 1] > self.rod[1]).mean(axis=1), away

    def cost(self, world: World) -> np.ndarray:
        """Return what is not lifted and not shared evenly by the rod, and a little for the distance from it."""
        lifted, behind, away = self.parts(world)
        return 1.0 - 0.25 * lifted * (1.0 + 12.0 * behind * (1.0 - behind)) + away

    def figures(self) -> dict[str, float]:
        """Return the shares."""
        lifted, behind, _ = self.parts(self.world)
        return {"off the table": float(lifted[0]), "behind": float(behind[0])}

    def is_solved(self, figures: dict[str, float]) -> bool:
        """Nothing is on the table, and a quarter or more hangs on each side."""
        return figures["off the table"] == 1.0 and 0.25 <= figures["behind"] <= 0.75


class Cover(Task):
    """A cloth is to be laid over a box that stands behind it."""

    name = "cover"
    size, tall = 0.12, 0.06  # [m]

    def furnish(self) -> None:
        """Draw the box's place."""
        super().furnish()
        self.place = np.array((self.random.uniform(-0.12, 0.12), 0.14 + self.random.uniform(-0.06, 0.06)))
        standing = (*self.place, 0.5 * self.tall)
        self.world.add(box((self.size, self.size, self.tall), name="box", position=standing, friction=0.5))

    def fixed(self, seen: np.ndarray, stage: int) -> np.ndarray:
        """Go over a box at (0, 0.14) m, 0.15 m beyond its middle, and down behind it."""
        half, y = (0.5 * SIDE, 0.0, 0.0), 0.14 + 0.5 * SIDE
        return np.array([(0.0, *place, *half) for place in ((0.0, 0.14), (y, 0.12), (y, 0.015), (y, 0.015))])

    def covered(self, world: World) -> np.ndarray:
        """Return the share of the box's top over which the cloth lies, (worlds,)."""
        s = (np.arange(12) + 0.5) / 12 - 0.5
        points = self.place + self.size * np.stack(np.meshgrid(s, s), axis=-1).reshape(-1, 2)
        view = TopView(world, world.find("cloth"))
        return view.covered_at(np.broadcast_to(points, (world.world_count, *points.shape))).mean(axis=1)

    def cost(self, world: World) -> np.ndarray:
        """Return what is not covered, and a little for the distance of the cloth's middle from the box's."""
        away = np.linalg.norm(self.vertices(world).mean(axis=1)[:, :2] - self.place, axis=1)
        return 1.0 - self.covered(world) + away

    def figures(self) -> dict[str, float]:
        """Return the share."""
        return {"covered": float(self.covered(self.world)[0])}

    def is_solved(self, figures: dict[str, float]) -> bool:
        """99 % of the box are covered."""
        return figures["covered"] >= 0.99


class Pull(Task):
    """A cloth is to be pulled from under a cup, which stays."""

    name = "pull"
    cells = 12
    pairs = ((1, 3),)
    horizon, every, settle = 0.3, 0.15, 0.25
    samples = 12
    spread = (0.08, 0.01, 0.02, 0.005, 0.005, 0.005)
    lowest = (0.0, -0.1, 0.003, -0.01, 0.1, -0.02)
    highest = (0.75, 0.1, 0.1, 0.01, 0.15, 0.02)
    radius, tall, mass, slip = 0.035, 0.09, 0.25, 0.3  # [m], [m], [kg], friction of the cup

    def furnish(self) -> None:
        """Draw the cup's place, mass and friction, and let it come to rest on the cloth."""
        place = self.random.uniform(-0.05, 0.05, 2)
        cup = cylinder(self.radius, self.tall, name="cup", position=(*place, 0.5 * self.tall + 2.0 * LIFT))
        mass, slip = self.random.uniform(0.15, 0.4), self.random.uniform(0.2, 0.4)
        self.world.attach(self.world.add(cup), Rigid(mass=mass, friction=slip))
        self.world.run(0.3, progress=False)
        self.stood = np.array(self.world.find("cup").position)

    def believe(self, futures: World) -> None:
        """Give the cup its nominal mass and friction."""
        futures.set_material("cup", Rigid(mass=self.mass, friction=self.slip))

    def fixed(self, seen: np.ndarray, stage: int) -> np.ndarray:
        """Pull level and evenly, 0.5 m in 0.3 s."""
        return np.array([(0.5 * SIDE + far, 0.0, 0.005, 0.0, 0.5 * SIDE, 0.0) for far in (0.5 / 3, 1.0 / 3, 0.5)])

    def parts(self, world: World) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return how far the cup went [m], its tilt [rad], and the share of the cloth within 1 cm of its foot."""
        cup = world.find("cup")
        place, turn = np.reshape(cup.position, (-1, 3)), np.reshape(cup.quaternion, (-1, 4))
        tilt = np.arccos(np.clip(1.0 - 2.0 * (turn[:, 1] ** 2 + turn[:, 2] ** 2), -1.0, 1.0))
        near = np.linalg.norm(self.vertices(world)[..., :2] - place[:, None, :2], axis=-1) < self.radius + 0.01
        return np.linalg.norm(place - self.stood, axis=1), tilt, near.mean(axis=1)

    def cost(self, world: World) -> np.ndarray:
        """Return metres moved, and for tilt and for cloth that is under the cup."""
        moved, tilt, under = self.parts(world)
        return moved + 0.2 * tilt + 5.0 * under

    def figures(self) -> dict[str, float]:
        """Return the same of the true world."""
        moved, tilt, under = self.parts(self.world)
        return {"moved": float(moved[0]), "tilt": float(tilt[0]), "under": float(under[0])}

    def is_solved(self, figures: dict[str, float]) -> bool:
        """The cup stands within 5 cm of where it stood, upright to 15 degrees, and no cloth is under it."""
        return figures["moved"] <= 0.05 and figures["tilt"] <= np.radians(15.0) and figures["under"] == 0.0


TASKS = {task.name: task for task in (Flatten, Hang, Cover, Pull)}
