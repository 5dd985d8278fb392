"""One world of a task as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.envs.cloth_task import ClothTask
from nuno.envs.gymnasium_package import gymnasium
from nuno.envs.vector_env import AutoresetMode, ClothVectorEnv


class ClothEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """A world with a cloth and two hands; see `ClothVectorEnv`, which steps many of them in little more time.

    Args:
        task: "spread", "fold", "hang" or "cover", or a task of one's own.
        render_mode: "rgb_array" or None.
        options: As of `ClothVectorEnv`.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 6}  # noqa: RUF012  (Gymnasium's)

    def __init__(self, task: str | ClothTask = "fold", *, render_mode: str | None = None, **options: Any) -> None:
        mode = AutoresetMode.DISABLED
        self.batch = ClothVectorEnv(task, 1, autoreset_mode=mode, render_mode=render_mode, **options)
        self.render_mode = render_mode
        self.observation_space = self.batch.single_observation_space
        self.action_space = self.batch.single_action_space

    @property
    def world(self) -> Any:
        """The world."""
        return self.batch.world

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin a new episode; return what is observed, and "score"."""
        super().reset(seed=seed)
        observations, infos = self.batch.reset(seed=seed)
        return observations[0], _own(infos)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Run the world for 5/32 s; see `ClothVectorEnv.step`."""
        seen, rewards, terminations, truncations, infos = self.batch.step(np.asarray(action)[None])
        return seen[0], float(rewards[0]), bool(terminations[0]), bool(truncations[0]), _own(infos)

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return a picture (height, width, 3) uint8; None without a render mode."""
        pictures = self.batch.render()
        return None if pictures is None else pictures[0]


def _own(infos: dict[str, Any]) -> dict[str, Any]:
    return {name: value[0].item() for name, value in infos.items() if not name.startswith("_")}
