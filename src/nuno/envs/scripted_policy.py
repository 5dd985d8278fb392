"""The scripted baseline of a task: hands that go from waypoint to waypoint."""

from __future__ import annotations

import numpy as np

from nuno.envs.cloth_batch import STEP
from nuno.envs.cloth_task import Waypoint
from nuno.envs.vector_env import ClothVectorEnv

NEAR = 0.01
"""[m] from a waypoint at which the next one follows."""
STUCK = 0.003
"""[m] A hand that has moved less in a step, though it should, will not come nearer: the next waypoint follows too."""


class ScriptedPolicy:
    """The task's script as a policy: it knows where all vertices are.

    Args:
        env: The environment, of which it knows the worlds.
    """

    def __init__(self, env: ClothVectorEnv) -> None:
        self._env = env
        self._ways: list[Waypoint] = []
        self._next = np.zeros(env.num_envs, dtype=int)
        self._before = np.full(env.hands.shape, np.inf)

    def act(self) -> np.ndarray:
        """Return actions (num_envs, 8), and begin anew in worlds whose episode has begun."""
        fresh = self._env.episode_steps == 0
        if fresh.any():
            self._begin(fresh)
        hands, last = self._env.hands, len(self._ways) - 1
        left = np.abs(self._places() - hands).max(axis=(1, 2))
        step = np.abs(hands - self._before).max(axis=(1, 2))
        self._next = np.where(fresh, 0, np.minimum(self._next + ((left < NEAR) | (step < STUCK)), last))
        self._before = hands
        motion = np.clip((self._places() - hands) / STEP, -1.0, 1.0)
        close = np.where(np.array([way.closed for way in self._ways])[self._next], 1.0, -1.0)
        each = np.broadcast_to(close[:, None, None], (*motion.shape[:2], 1))
        return np.concatenate([motion, each], axis=2).reshape(self._env.num_envs, -1).astype(np.float32)

    def _begin(self, fresh: np.ndarray) -> None:
        """Take the script anew in some worlds (num_envs,) bool."""
        ways = self._env.start_of_script()
        kept = self._ways or ways
        self._ways = [
            Waypoint(np.where(fresh[:, None, None], new.places, old.places), new.closed, new.vertices)
            for new, old in zip(ways, kept, strict=True)
        ]
        self._before = np.where(fresh[:, None, None], np.inf, self._before)

    def _places(self) -> np.ndarray:
        """Return where the hands of each world go next, (num_envs, hands, 3) [m]."""
        vertices, found = self._env.vertices, np.empty_like(self._before)
        for k, way in enumerate(self._ways):
            here = self._next == k
            offset = 0.0 if way.vertices is None else vertices[here][:, way.vertices]
            found[here] = way.places[here] + offset
        return found
