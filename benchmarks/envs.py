"""Environment steps a second of the learning environments, by the number of worlds.

    python benchmarks/envs.py [--device cuda:0] [--tasks fold cover] [--worlds 1 16 256] [--cells 12] [--thorough]
        [--json FILE]
    python benchmarks/envs.py --host --device cpu [--worlds 4096]

A step is 5/32 s of a world: ten frames, with a cloth of 12 x 12 cells, two hands that act at random, its reward, its
observation, and the resets of the worlds whose episode ends. Kernels are compiled before the clock starts. Each row is
the mean over at least ten steps and two seconds. A CPU second is that of one core, which other work on the machine does
not change much. The columns "physics" and "score" are the parts of a step's time that go into the simulation and into
the reward. `--host` counts instead what a step and a reset take of the thread that calls them, without the kernels and
the filling of arrays, which a GPU does: with one substep, as what is on the host does not depend on them.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from nuno.envs import TASKS, ClothVectorEnv

WORLDS = {"cpu": (1, 4, 16, 64, 256), "cuda": (1, 16, 256, 1024, 4096, 8192)}
ON_DEVICE = ("invoke", "fill_", "clear", "deallocate")  # functions of Warp and the rasteriser: a GPU's work
WARM = 3  # steps before the clock starts
LEAST = 10, 2.0  # steps, and seconds


class Watch:
    """Sums up the seconds that a method of an object takes."""

    def __init__(self, owner: Any, name: str) -> None:
        self.seconds, call = 0.0, getattr(owner, name)

        def timed(*args: Any, **options: Any) -> Any:
            start = time.perf_counter()
            try:
                return call(*args, **options)
            finally:
                self.seconds += time.perf_counter() - start

        setattr(owner, name, timed)


def measure(task: str, worlds: int, cells: int, device: str, thorough: bool) -> dict[str, Any]:
    """One row of the table."""
    start = time.perf_counter()
    env = ClothVectorEnv(task, worlds, cells=(cells, cells), device=device, thorough=thorough)
    env.reset(seed=0)
    made = time.perf_counter() - start
    random = np.random.default_rng(0)

    def step() -> None:
        env.step(random.uniform(-1.0, 1.0, (worlds, env.single_action_space.shape[0])))

    for _ in range(WARM):
        step()
    watches = {"physics": Watch(env.world, "run"), "score": Watch(env._batch, "score")}
    steps, start, cpu = 0, time.perf_counter(), time.process_time()
    while steps < LEAST[0] or time.perf_counter() - start < LEAST[1]:
        step()
        steps += 1
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    dynamics = env.world.find("cloth")._dynamics
    return {
        "task": task, "worlds": worlds, "cells": cells, "device": device, "substeps": int(dynamics.substeps),
        "steps_per_second": worlds * steps / seconds, "steps_per_cpu_second": worlds * steps / cpu,
        "real_time_factor": worlds * steps / seconds * 5.0 / 32.0,
        "ms_a_step": 1e3 * seconds / steps, "made_in_s": made,
        **{name: watch.seconds / seconds for name, watch in watches.items()},
    }  # fmt: skip


def host_ms(call: Any, times: int = 5) -> float:
    """Milliseconds that a call takes of the host's thread, but for what a GPU would do."""
    profile = cProfile.Profile(time.thread_time)
    profile.enable()
    for _ in range(times):
        call()
    profile.disable()
    own = {key: values[2] for key, values in pstats.Stats(profile).stats.items()}  # type: ignore[attr-defined]
    return 1e3 * sum(seconds for key, seconds in own.items() if key[2] not in ON_DEVICE) / times


def measure_host(task: str, worlds: int, cells: int, device: str) -> dict[str, Any]:
    """Milliseconds of the host for a step and a reset of all worlds."""
    env = ClothVectorEnv(task, worlds, cells=(cells, cells), device=device, substeps=1)
    env.reset(seed=0)
    random = np.random.default_rng(0)
    actions = random.uniform(-1.0, 1.0, (WARM + 5, worlds, env.single_action_space.shape[0]))
    for each in actions[:WARM]:
        env.step(each)
    left = iter(actions[WARM:])
    return {"task": task, "worlds": worlds, "step_ms": host_ms(lambda: env.step(next(left))),
            "reset_ms": host_ms(env.reset, 2)}  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--device", default="cuda:0" if wp.get_cuda_device_count() else "cpu")
    options.add_argument("--tasks", nargs="+", default=["fold"], choices=list(TASKS))
    options.add_argument("--worlds", nargs="+", type=int)
    options.add_argument("--cells", type=int, default=12)
    options.add_argument("--thorough", action="store_true", help="repeat frames in which cloth crosses itself")
    options.add_argument("--host", action="store_true", help="count what the host does")
    options.add_argument("--json", type=Path)
    asked = options.parse_args()
    rows = []
    if asked.host:
        print("| task | worlds | host, ms a step | ms a reset of all |\n|---|---|---|---|")
        for task in asked.tasks:
            rows.append(measure_host(task, (asked.worlds or [4096])[0], asked.cells, asked.device))
            print(f"| {task} | {rows[-1]['worlds']:,} | {rows[-1]['step_ms']:.0f} | {rows[-1]['reset_ms']:.0f} |")
        if asked.json:
            asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
        return
    print(f"{wp.get_device(asked.device).name}, {asked.cells} x {asked.cells} cells")
    print("| task | worlds | steps a second | a CPU second | ms a step | simulated s a second | physics | score |")
    print("|---|---|---|---|---|---|---|---|")
    for task in asked.tasks:
        for worlds in asked.worlds or WORLDS[asked.device.split(":")[0]]:
            row = measure(task, worlds, asked.cells, asked.device, asked.thorough)
            rows.append(row)
            print(
                f"| {task} | {worlds:,} | {row['steps_per_second']:,.0f} | {row['steps_per_cpu_second']:,.0f} | "
                f"{row['ms_a_step']:.1f} | {row['real_time_factor']:,.1f} | "
                f"{row['physics']:.0%} | {row['score']:.0%} |", flush=True,
            )  # fmt: skip
    if asked.json:
        asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
