"""Cost of walks that begin in imagined worlds: ``python benchmarks/imagined_walks.py [--dynamics] [--worlds 16 64]``.

Talos stands on a floor. In a batch of copies all are sent 0.3 m ahead, then, in another, each to a place of its own.
CPU seconds of all threads, medians: planning the walks, coming to rest, and a simulated second of walking, of arms that
move, and of standing.
"""

from __future__ import annotations

import argparse
import logging
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import nuno

SPAN = 0.25
"""[s] That are simulated of each."""


def seconds_of(does: Callable[[], Any]) -> float:
    """CPU seconds that something takes."""
    start = time.process_time()
    does()
    return time.process_time() - start


def measure(world: nuno.World, worlds: int, places: np.ndarray) -> dict[str, float]:
    """CPU seconds by what takes them; places (worlds, 2) are new in every call, as known walks cost nothing."""
    found = {}
    for name, ways in (("alike", places[:1].repeat(worlds, axis=0)), ("own", places)):
        futures = world.imagine(worlds)
        found[f"plan, {name}"] = seconds_of(lambda futures=futures, ways=ways: futures.robot.go_pos(*ways.T))
        found[f"walk, {name}"] = seconds_of(lambda futures=futures: futures.run(SPAN, progress=False)) / SPAN
        found[f"stop, {name}"] = seconds_of(lambda futures=futures: futures.robot.go_stop())
        del futures
    for name in ("stand", "arm"):
        futures = world.imagine(worlds)
        if name == "arm":
            futures.robot.angle_vector({"arm_left_4_joint": -1.0}, 0.5)
        found[name] = seconds_of(lambda futures=futures: futures.run(SPAN, progress=False)) / SPAN
    return found


def main() -> None:
    """Measure, and print a row for each number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--dynamics", action="store_true")
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    logging.getLogger("nuno").setLevel(logging.ERROR)
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=asked.dynamics)
    world.run(0.1, progress=False)
    random = np.random.default_rng(0)
    for worlds in asked.worlds:
        rows = []
        for _ in range(asked.repeats + 1):  # the first compiles
            places = np.stack([random.uniform(0.29, 0.31, worlds), np.zeros(worlds)], axis=1)
            rows.append(measure(world, worlds, places))
        middle = {name: statistics.median(row[name] for row in rows[1:]) for name in rows[0]}
        print(worlds, ", ".join(f"{name} {value:.2f}" for name, value in middle.items()), flush=True)


if __name__ == "__main__":
    main()
