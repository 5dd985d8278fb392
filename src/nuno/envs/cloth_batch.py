"""The worlds of a learning environment: one batch, in which single worlds begin anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from nuno.bodies.make_bodies import sphere
from nuno.camera.camera import Camera
from nuno.envs.cloth_task import SIDE, TABLE, ClothTask, Start
from nuno.envs.pickers import Pickers
from nuno.envs.top_view import TopView

FRAMES = 10
"""Frames of a control step: 5/32 s. As many lie between two looks at whether cloth passes through itself, by the clock
of the world (`nuno.world.impacts`): so episodes are alike whenever they begin."""
STEP = 0.05
"""[m] A hand goes at most so far along each axis in a control step."""
KEY_POINTS = 5
"""Along a side: so many of the cloth's vertices are observed."""
LOW, HIGH = np.array((-0.44, -0.44, 0.004)), np.array((0.44, 0.44, 0.5))
"""[m] The space in which hands move."""
BOUND = 10.0
"""[m], [m/s] Observations are cut at it, so that what fell off the table drives no learner mad."""
COLORS = ("orange", "green")


class ClothBatch:
    """Worlds of one task, their hands, and what is observed of them.

    Args:
        task: The task.
        world_count: Worlds.
        with_hands: Whether hands are drawn in pictures.
        thorough: Whether frames in which the cloth may pass through itself are gone through again, with more substeps.

    Attributes:
        task: The task.
        world: The batch.
        cloth: Its cloth.
        pickers: The hands.
        places: (worlds, 3) [m], ``Start.place`` of each world's episode.
    """

    def __init__(self, task: ClothTask, world_count: int, with_hands: bool = False, thorough: bool = False) -> None:
        self.task = task
        single = task.world()
        self._marks = []
        for k in range(task.hands if with_hands else 0):
            mark = sphere(0.012, name=f"hand {k}", color=COLORS[k % 2], group=0, collides_with=0, position=(0, 0, 0.3))
            self._marks.append(single.add(mark).key)
        self._start = single.save()
        self.world = single.imagine(world_count)
        self.world._quiet = not thorough
        self.cloth = self.world.find("cloth")
        marks = [body for body in self.world.bodies if body.key in self._marks]
        self._view = TopView(self.world, self.cloth, marks)
        self._object = next((body for body in self.world.bodies if body.name == "object"), None)
        self.pickers = Pickers(self.world, self.cloth, task.hands, LOW, HIGH)
        self.places = np.zeros((world_count, 3))
        nx, ny = task.cells
        rows, columns = (np.rint(np.linspace(0, n, KEY_POINTS)).astype(int) for n in (ny, nx))
        key = (rows[:, None] * (nx + 1) + columns).ravel()
        self._key: Any = wp.array(key, dtype=int, device=self.world.device)

    @property
    def seconds(self) -> float:
        """[s] of a control step."""
        return FRAMES / self.world.frame_rate

    @property
    def vertices(self) -> np.ndarray:
        """(worlds, n, 3) float64 [m], of the cloth."""
        return self.cloth.surface()[0].reshape(self.world.world_count, -1, 3)

    def begin(self, worlds: np.ndarray, starts: list[Start]) -> None:
        """Let some worlds (k,) begin an episode each; the others keep every bit."""
        if not len(worlds):
            return
        self.world.reset(worlds, self._start)
        shapes = np.zeros((self.world.world_count, len(starts[0].vertices), 3))
        shapes[worlds] = [start.vertices for start in starts]
        count = self.world.world_count
        self.world.set_vertices(self.cloth, shapes if count > 1 else shapes[0], worlds=worlds)
        self.places[worlds] = [start.place for start in starts]
        if self._object is not None:
            self.world.set_pose(self._object, self.places if count > 1 else self.places[0], worlds=worlds)
        self.pickers.put(np.array([start.hands for start in starts]), worlds)

    def act(self, actions: np.ndarray) -> None:
        """Run a control step.

        Args:
            actions: (worlds, 4 hands), of each hand its motion along x, y and z over `STEP`, and above 0 that it is
                closed.
        """
        each = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0).reshape(self.world.world_count, -1, 4)
        self.pickers.act(STEP * each[..., :3], each[..., 3] > 0.0, self.seconds, self.vertices)

    def observe(self, steps: np.ndarray) -> np.ndarray:
        """Return what is observed, (worlds, size) float32, after so many steps (worlds,) of each episode."""
        count = self.world.world_count
        state = self.world.state(self.cloth)
        seen = [self._at_key_points(state[name]) for name in ("positions", "velocities")]
        parts = (*seen, self.pickers.positions, self.pickers.held >= 0, self.places, 1.0 - steps / self.task.horizon)
        values = np.concatenate([np.asarray(part, dtype=np.float32).reshape(count, -1) for part in parts], axis=1)
        return np.clip(values, -BOUND, BOUND, out=values)

    def _at_key_points(self, array: Any) -> np.ndarray:
        """Return what an array (worlds, n) of vec3 has of the observed vertices, which alone leave the device."""
        every: Any = None
        chosen: Any = wp.indexedarray(array, [every, self._key])
        found: np.ndarray = chosen.numpy()
        return found

    @property
    def size(self) -> int:
        """The number of values that are observed of a world."""
        return 6 * KEY_POINTS**2 + 4 * self.task.hands + 4

    def score(self) -> np.ndarray:
        """Return the task's score of each world, (worlds,)."""
        return self.task.score(self.vertices, self.places, self._view)

    def solved(self, score: np.ndarray) -> np.ndarray:
        """Return where the task is solved, (worlds,) bool: the score is high enough, and all hands are open."""
        return (score >= self.task.done_at) & (self.pickers.held < 0).all(axis=1)

    def draw(self, width: int, height: int) -> np.ndarray:
        """Return pictures of all worlds, (worlds, height, width, 3) uint8."""
        from nuno.camera.picture import Chequer, Lamp, take_picture

        for k, key in enumerate(self._marks):
            mark = next(body for body in self.world.bodies if body.key == key)
            places = self.pickers.positions[:, k]
            self.world.set_pose(mark, places if len(places) > 1 else places[0])
        camera = Camera.look_at((0.0, -1.0, 0.85), (0.0, 0.03, 0.05), 0.62, width=width, height=height)
        lamp = Lamp(position=(0.4 * TABLE, -1.0, 2.0), radius=0.0)
        checks = {self.cloth: Chequer(SIDE / 6.0, (0.35, 0.55, 0.85))}
        picture = take_picture(self.world, camera, lamp=lamp, background=(0.92, 0.93, 0.95), patterns=checks, samples=2)
        return picture.color.numpy().reshape(self.world.world_count, height, width, 3)
