"""Proximal policy optimisation of stable-baselines3 on a learning environment, for some minutes.

    python benchmarks/train_envs.py [--task fold] [--worlds 64] [--minutes 3] [--cells 12] [--device cuda:0]
        [--learner cuda] [--out FOLDER]

It needs stable-baselines3, which brings PyTorch and is in no extra: pip install stable-baselines3. The table has, for
each rollout, the time [s], environment steps so far, the mean score at the ends of the last episodes (as many as there
are worlds, 200 at least) and the share that was solved. Kernels are compiled before the clock starts. In the end the
policy, without its noise, is tried on new episodes beside the script and chance. The folder gets the learning curve,
train_TASK.json and train_TASK.png.
"""

# ruff: noqa: D102
from __future__ import annotations

import argparse
import json
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from nuno.envs import TASKS, ClothVectorEnv, ScriptedPolicy

ROLLOUT = 32  # steps of each world between two updates


class Adapter(VecEnv):  # its methods are stable-baselines3's
    """A batch in the interface of stable-baselines3, whose worlds begin anew in the step that ends an episode."""

    def __init__(self, env: ClothVectorEnv, seed: int = 0) -> None:
        self.render_mode = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.env, self._seed, self._actions = env, seed, np.zeros(0)
        self.ended: deque[tuple[float, bool]] = deque(maxlen=max(200, env.num_envs))

    def reset(self) -> np.ndarray:
        return self.env.reset(seed=self._seed)[0]

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        observations, rewards, terminations, truncations, infos = self.env.step(self._actions)
        ended = terminations | truncations
        told: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(ended):
            told[k] = {"terminal_observation": infos["final_obs"][k], "TimeLimit.truncated": bool(truncations[k])}
            self.ended.append((infos["final_info"]["score"][k], bool(terminations[k])))
        return observations, rewards.astype(np.float32), ended, told

    def close(self) -> None:
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.env, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **options: Any) -> list[Any]:
        return [getattr(self.env, method_name)(*arguments, **options)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


class Clock(BaseCallback):
    """Prints a row after each rollout, and ends the training when its time is over."""

    def __init__(self, batch: Adapter, seconds: float) -> None:
        super().__init__()
        self.batch, self.seconds, self.start = batch, seconds, time.perf_counter()
        self.rows: list[dict[str, float]] = []

    def _on_step(self) -> bool:
        return time.perf_counter() - self.start < self.seconds

    def _on_rollout_end(self) -> None:
        passed = time.perf_counter() - self.start
        score, solved = np.mean(self.batch.ended, axis=0) if self.batch.ended else (np.nan, np.nan)
        row = {"s": passed, "steps": self.num_timesteps, "score": float(score), "solved": float(solved)}
        self.rows.append(row)
        print(f"| {passed:.0f} | {self.num_timesteps:,} | {score:.3f} | {solved:.0%} |", flush=True)


def evaluate(env: ClothVectorEnv, act: Callable[[np.ndarray], np.ndarray]) -> tuple[float, float]:
    """Mean score at the ends of one new episode in each world, and the share that is solved."""
    observations, _ = env.reset(seed=10_000)
    score, solved, ended = (np.zeros(env.num_envs) for _ in range(3))
    while not ended.all():
        observations, _, terminations, truncations, infos = env.step(act(observations))
        for k in np.flatnonzero((terminations | truncations) & (ended == 0)):
            score[k], solved[k], ended[k] = infos["final_info"]["score"][k], terminations[k], 1
    return float(score.mean()), float(solved.mean())


def plot(file: Path, rows: list[dict[str, float]], found: dict[str, tuple[float, float]], title: str) -> None:
    """The learning curve as a picture, with what the script reaches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2, 3.4), layout="constrained")
    axes = figure.subplots()
    for name, style in (("score", "-"), ("solved", "--")):
        axes.plot([row["steps"] for row in rows], [row[name] for row in rows], style, label=f"{name}, with noise")
    last = rows[-1]["steps"]
    axes.plot([last, last], found["learned"], "o", color="black", label="score and solved, without noise")
    axes.axhline(found["script"][0], color="gray", linestyle=":", label="score of the script")
    axes.set(xlabel="environment steps", ylim=(0.0, 1.02), title=title)
    axes.legend(loc="lower right", fontsize="small")
    figure.savefig(file, dpi=100)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--task", default="fold", choices=list(TASKS))
    options.add_argument("--worlds", type=int, default=64)
    options.add_argument("--minutes", type=float, default=3.0, help="of training; the rest takes half a minute more")
    options.add_argument("--cells", type=int, default=12)
    options.add_argument("--device", default="cuda:0" if wp.get_cuda_device_count() else "cpu")
    options.add_argument("--learner", default="cpu", help="the device of PyTorch on which the network learns")
    options.add_argument("--out", type=Path, help="a folder for the learning curve, JSON and PNG")
    asked = options.parse_args()
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    cells = (asked.cells, asked.cells)
    env = ClothVectorEnv(asked.task, asked.worlds, cells=cells, device=asked.device, autoreset_mode="SameStep")
    batch = Adapter(env)
    batch.reset()
    env.step(np.zeros((asked.worlds, 8)))
    print(f"{asked.worlds:,} worlds on {wp.get_device(asked.device).name}, made in {time.perf_counter() - start:.1f} s")
    size = max(256, asked.worlds * ROLLOUT // 16)
    model = PPO(
        "MlpPolicy", batch, n_steps=ROLLOUT, batch_size=size, n_epochs=10, learning_rate=1e-3, gamma=0.97,
        device=asked.learner, seed=0, policy_kwargs={"log_std_init": -0.5},
    )  # fmt: skip
    clock = Clock(batch, 60.0 * asked.minutes)
    print("| s | environment steps | score | solved |\n|---|---|---|---|")
    model.learn(10**9, callback=clock)
    random, script = np.random.default_rng(0), ScriptedPolicy(env)
    found = {
        "learned": evaluate(env, lambda seen: model.predict(seen, deterministic=True)[0]),
        "script": evaluate(env, lambda _: script.act()),
        "random": evaluate(env, lambda _: random.uniform(-1.0, 1.0, (asked.worlds, 8))),
    }
    print("| policy | score | solved |\n|---|---|---|")
    for name, (score, solved) in found.items():
        print(f"| {name} | {score:.3f} | {solved:.0%} |")
    last = clock.rows[-1]
    print(f"{last['steps'] / last['s']:,.0f} environment steps a second, updates included")
    if asked.out:
        asked_for = {name: value for name, value in vars(asked).items() if name != "out"}
        told = {"asked": asked_for, "rows": clock.rows, "found": found}
        (asked.out / f"train_{asked.task}.json").write_text(json.dumps(told, indent=1), encoding="utf-8")
        plot(asked.out / f"train_{asked.task}.png", clock.rows, found, f"{asked.task}: PPO, {asked.worlds:,} worlds")


if __name__ == "__main__":
    main()
