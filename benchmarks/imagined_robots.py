"""Cost of robots in imagined worlds: ``python benchmarks/imagined_robots.py [--dynamics] [--same] [--device cuda:0]``.

Talos stands before a table with a towel of 0.6 m; its arms go to postures of their own in every world for 1 s, and
two corners of the towel are led. With ``--same`` the arms of all worlds go to the same postures, and only the towel is
led elsewhere. By turns with and without the robot, the same worlds otherwise; CPU seconds of all threads, which other
work on the machine changes little, and the wall clock. Without ``--dynamics`` the robot is kinematic.
"""

from __future__ import annotations

import argparse
import json
import logging
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

import nuno

ARMS = ("arm_left_2_joint", "arm_left_4_joint", "arm_right_2_joint", "arm_right_4_joint")


def room(with_robot: bool, dynamics: bool, cells: int, device: str) -> nuno.World:
    """The room, at rest."""
    world = nuno.World(device=device)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.7, 1.2, 0.02), name="table", position=(0.85, 0, 0.71)))
    towel = world.add(nuno.sheet((0.6, 0.6), (cells, cells), name="towel", position=(0.85, 0, 0.722)))
    world.attach(towel)
    if with_robot:
        nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
    world.run(0.1, progress=False)
    return world


def begin(world: nuno.World, worlds: int, cells: int, same: bool = False) -> nuno.World:
    """A batch on its way."""
    futures = world.imagine(worlds)
    n, span = cells + 1, futures.time + np.array([0.0, 1.0])
    up = np.random.default_rng(0).uniform(0.05, 0.2, (worlds, 3)) * (0, 0, 1.0)
    vertices = futures.find("towel").vertices
    for corner in (0, n * (n - 1)):
        start = vertices[:, corner]
        futures.grip("towel", np.array([corner]), to=nuno.Path(span, np.stack([start, start + up], axis=1)))
    if futures.drivers:
        robot = futures.robot
        names, now = list(robot.joint_names), robot.angle_vector()
        turn = np.random.default_rng(1).uniform(-0.2, 0.2, (1 if same else worlds, len(ARMS)))
        robot.angle_vector({name: now[:, names.index(name)] + turn[:, k] for k, name in enumerate(ARMS)}, 1.0)
    return futures


def measure(worlds: int, asked: argparse.Namespace) -> dict[str, Any]:
    """CPU and wall seconds of a simulated second, with and without robots."""
    dynamics, cells, seconds = asked.dynamics, asked.cells, asked.seconds
    rooms = {True: room(True, dynamics, cells, asked.device), False: room(False, dynamics, cells, asked.device)}
    cpu: dict[bool, list[float]] = {True: [], False: []}
    wall: dict[bool, list[float]] = {True: [], False: []}
    main: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(asked.repeats):
        for with_robot, world in rooms.items():
            futures = begin(world, worlds, cells, asked.same)
            futures.run(1.0 / 60.0, progress=False)
            clock, core, own = time.perf_counter(), time.process_time(), time.thread_time()
            futures.run(seconds, progress=False)
            main[with_robot].append((time.thread_time() - own) / seconds)
            cpu[with_robot].append((time.process_time() - core) / seconds)
            wall[with_robot].append((time.perf_counter() - clock) / seconds)
    row: dict[str, Any] = {
        "worlds": worlds,
        "dynamics": dynamics,
        "cells": cells,
        "same": asked.same,
        "device": asked.device,
    }
    for name, with_robot in (("with", True), ("without", False)):
        row[f"cpu_s_{name}"], row[f"wall_s_{name}"] = (statistics.median(own[with_robot]) for own in (cpu, wall))
        row[f"main_s_{name}"] = statistics.median(main[with_robot])
    ratios = [a / b - 1.0 for a, b in zip(cpu[True], cpu[False], strict=True)]
    return row | {"robots_share": statistics.median(ratios), "real_time_factor": worlds / row["wall_s_with"]}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--worlds", nargs="+", type=int)
    options.add_argument("--dynamics", action="store_true", help="robots with weight")
    options.add_argument("--same", action="store_true", help="the same commands in all worlds")
    options.add_argument("--cells", type=int, default=20)
    options.add_argument("--device", default="cpu")
    options.add_argument("--repeats", type=int, default=3)
    options.add_argument("--seconds", type=float, default=1.0, help="simulated, of a measurement")
    options.add_argument("--json", type=Path)
    asked = options.parse_args()
    logging.getLogger("nuno").setLevel(logging.ERROR)
    rows = []
    print(
        "| worlds | CPU s a simulated s, with robots | of it on the main thread | without | more by | wall s with | "
        "all worlds over real time |\n|---|---|---|---|---|---|---|"
    )
    for worlds in asked.worlds or ([8, 64] if asked.dynamics else [36]):
        row = measure(worlds, asked)
        rows.append(row)
        print(
            f"| {worlds} | {row['cpu_s_with']:.2f} | {row['main_s_with']:.2f} | {row['cpu_s_without']:.2f} | "
            f"{row['robots_share']:.0%} | {row['wall_s_with']:.2f} | {row['real_time_factor']:.2f} |", flush=True,
        )  # fmt: skip
        if asked.json:
            asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
