"""Many worlds of one task as a Gymnasium VectorEnv: they are stepped together, as one batch."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.envs.cloth_batch import BOUND, ClothBatch
from nuno.envs.cloth_task import ClothTask
from nuno.envs.gymnasium_package import gymnasium
from nuno.envs.tasks import make_task
from nuno.errors import BodyStateError, InvalidInputError
from nuno.numbers.device_array import DeviceArray
from nuno.validation import count, finite_array

AutoresetMode = gymnasium.vector.AutoresetMode
HOLD = 4
"""Control steps for which the score must be high enough with open hands: what slides off a bar has not been hung."""


class ClothVectorEnv(gymnasium.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """Worlds with a cloth and two hands, for learning code.

    World k of a batch that is reset with ``seed`` goes through the same episodes, to the bit, as a single `ClothEnv`
    that is reset with ``seed + k`` and given the same actions, whatever the other worlds do.

    Args:
        task: "spread", "fold", "hang" or "cover", or a task of one's own.
        num_envs: Worlds.
        autoreset_mode: When a world whose episode ended begins the next one: in the next step (Gymnasium's default), in
            the same step, or never by itself (``reset(options={"reset_mask": mask})`` resets some).
        render_mode: "rgb_array" or None.
        width: Of pictures [px].
        height: Of pictures [px].
        thorough: Whether frames in which a cloth may pass through itself are gone through again with more substeps, as
            in any other world. It takes ten times as long, and more, where hands pull at a heap; without it, what has
            passed through itself stays so until the episode ends.
        options: Of a named task: ``cells``, ``substeps``, ``device``, ``material``.

    Raises:
        UnknownNameError: there is no such task.
        InvalidInputError: a mode or a number that cannot be used.
    """

    def __init__(
        self, task: str | ClothTask = "fold", num_envs: int = 1, *, autoreset_mode: Any = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None, width: int = 240, height: int = 180, thorough: bool = False,
        **options: Any,
    ) -> None:  # fmt: skip
        if render_mode not in (None, "rgb_array"):
            raise InvalidInputError(f"render_mode must be 'rgb_array' or None, got {render_mode!r}")
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError as error:
            modes = [mode.value for mode in AutoresetMode]
            raise InvalidInputError(f"autoreset_mode must be one of {modes}, got {autoreset_mode!r}") from error
        self.metadata = {"render_modes": ["rgb_array"], "render_fps": 6, "autoreset_mode": self.autoreset_mode}
        self.num_envs = count("num_envs", num_envs)
        self.render_mode, self._picture = render_mode, (count("width", width), count("height", height))
        self.task = make_task(task, **options)
        self._batch = ClothBatch(self.task, self.num_envs, render_mode is not None, thorough)
        spaces = gymnasium.spaces
        self.single_observation_space = spaces.Box(-BOUND, BOUND, (self._batch.size,), np.float32)
        self.single_action_space = spaces.Box(-1.0, 1.0, (4 * self.task.hands,), np.float32)
        batched = gymnasium.vector.utils.batch_space
        self.observation_space = batched(self.single_observation_space, self.num_envs)
        self.action_space = batched(self.single_action_space, self.num_envs)
        self._random: list[np.random.Generator] = []
        self._steps = np.zeros(self.num_envs, dtype=int)
        self._held = np.zeros(self.num_envs, dtype=int)
        self._score = np.zeros(self.num_envs)
        self._ended = np.zeros(self.num_envs, dtype=bool)

    @property
    def world(self) -> Any:
        """The batch: cameras, contacts and the like of all worlds at once."""
        return self._batch.world

    @property
    def hands(self) -> np.ndarray:
        """(num_envs, hands, 3) [m], where the hands are."""
        return self._batch.pickers.positions.copy()

    @property
    def vertices(self) -> np.ndarray:
        """(num_envs, n, 3) [m], where the cloth is."""
        return self._batch.vertices

    @property
    def episode_steps(self) -> np.ndarray:
        """(num_envs,) int, the steps that each world's episode has taken."""
        return self._steps.copy()

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: World k draws from ``seed + k``, or from the k-th of a list; None goes on with what it drew from.
            options: "reset_mask", (num_envs,) bool: the worlds that are reset; all others stay as they are.

        Returns:
            Observations (num_envs, n), and "score" of each world that was reset.

        Raises:
            InvalidInputError: as many seeds or values of a mask as there are not worlds.
        """
        mask = np.ones(self.num_envs, dtype=bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"])
            if mask.shape != (self.num_envs,) or mask.dtype != bool or not mask.any():
                raise InvalidInputError(
                    f"reset_mask must be ({self.num_envs},) bool and reset a world, got {mask.dtype} {mask.shape}"
                )
        self._seed(seed, mask)
        infos = self._begin(mask)
        return self._batch.observe(self._steps), infos

    def step(self, actions: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Run all worlds for 5/32 s.

        Args:
            actions: (num_envs, 8) in [-1, 1]: of each hand its motion along x, y and z over 5 cm, and above 0 that it
                is closed.

        Returns:
            Observations (num_envs, n); rewards (num_envs,), by which the score has grown; where the task is solved;
            where the horizon is reached; and "score" and "success" of each world.

        Raises:
            BodyStateError: before the first reset, or, without autoreset, a world's episode has ended.
            InvalidInputError: actions of another shape, or not finite.
        """
        given = finite_array("actions", actions, (self.num_envs, 4 * self.task.hands))
        if not self._random:
            raise BodyStateError("reset the environment before its first step")
        ended = self._ended.copy()
        if self.autoreset_mode is AutoresetMode.DISABLED and ended.any():
            worlds = np.flatnonzero(ended).tolist()
            raise BodyStateError(f"the episodes of worlds {worlds} have ended: reset them (options: reset_mask)")
        self._batch.act(given)
        self._steps += 1
        score = self._batch.score()
        rewards = np.where(ended, 0.0, score - self._score)
        self._held = np.where(self._batch.solved(score) & ~ended, self._held + 1, 0)
        terminations = self._held >= HOLD
        truncations = (self._steps >= self.task.horizon) & ~terminations & ~ended
        self._score = score
        infos = self._masked({"score": score, "success": terminations}, ~ended)
        if self.autoreset_mode is AutoresetMode.NEXT_STEP:
            infos = self._joined(infos, self._begin(ended))
        self._ended = terminations | truncations
        observations = self._batch.observe(self._steps)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._ended.any():
            observations, infos = self._with_final(observations, infos)
        return observations, rewards, terminations, truncations, infos

    def render(self) -> tuple[np.ndarray, ...] | None:  # type: ignore[override]
        """Return a picture (height, width, 3) uint8 of each world; None without a render mode."""
        return None if self.render_mode is None else tuple(self._batch.draw(*self._picture))

    def device_state(self) -> dict[str, DeviceArray]:
        """Return "positions" and "velocities" of the cloth, (num_envs, n) of vec3 on the device.

        The arrays are the same ones at each call, filled anew, so that ``torch.from_dlpack`` is called once.
        """
        return self.world.state("cloth", copy=False)

    def start_of_script(self) -> list[Any]:
        """Return the waypoints of the task's script from where the worlds are now."""
        return self.task.script(self.vertices, self._batch.places)

    def _seed(self, seed: int | list[int | None] | None, mask: np.ndarray) -> None:
        seeds: list[int | None] = [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            seeds = [int(seed) + k for k in range(self.num_envs)]
        elif seed is not None:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise InvalidInputError(f"seed must be a number or {self.num_envs} of them, got {len(seeds)}")
        if not self._random:
            self._random = [gymnasium.utils.seeding.np_random(own)[0] for own in seeds]
            return
        for k, own in enumerate(seeds):
            if own is not None and mask[k]:
                self._random[k] = gymnasium.utils.seeding.np_random(own)[0]

    def _begin(self, mask: np.ndarray) -> dict[str, Any]:
        """Begin an episode in some worlds; return what is told of them."""
        worlds = np.flatnonzero(mask)
        if not len(worlds):
            return {}
        self._batch.begin(worlds, [self.task.start(self._random[k]) for k in worlds])
        self._steps[worlds], self._held[worlds], self._ended[worlds] = 0, 0, False
        self._score = np.where(mask, self._batch.score(), self._score)
        return self._masked({"score": self._score}, mask)

    def _with_final(self, observations: np.ndarray, infos: dict[str, Any]) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin anew where an episode has just ended; the infos keep what was seen at its end."""
        ended = self._ended.copy()
        final = np.full(self.num_envs, None, dtype=object)
        for k in np.flatnonzero(ended):
            final[k] = observations[k]
        of_end = self._masked({name: infos[name] for name in ("score", "success")}, ended)
        going = self._masked({name: infos[name] for name in ("score", "success")}, ~ended)
        infos = {"final_obs": final, "_final_obs": ended.copy(), "final_info": of_end, "_final_info": ended.copy()}
        infos = self._joined(self._joined(infos, going), self._begin(ended))
        return self._batch.observe(self._steps), infos

    def _masked(self, values: dict[str, np.ndarray], mask: np.ndarray) -> dict[str, Any]:
        """Return values as Gymnasium's infos: zero where they are not told, with a mask each."""
        if not mask.any():
            return {}
        masked = {name: np.where(mask, value, np.zeros_like(value)) for name, value in values.items()}
        return masked | {f"_{name}": mask.copy() for name in values}

    def _joined(self, infos: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
        """Return infos of some worlds together with those of others."""
        joined = dict(infos)
        for name, value in others.items():
            if name.startswith("_"):
                joined[name] = infos.get(name, False) | value
            else:
                joined[name] = np.where(others[f"_{name}"], value, infos[name]) if name in infos else value
        return joined
