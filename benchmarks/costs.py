"""What things cost around a step: ``python benchmarks/costs.py [--device cpu] [--json FILE]``.

A room of 1,000 static boxes beside one attached cloth (ratio of step times, paired runs), attaching a cloth of about
1,000 vertices, importing the package in a fresh process, and the first answer with an empty kernel cache.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from nuno import Cloth, World, box, plane, sheet


def room(boxes: int, device: str) -> World:
    """A cloth that falls onto a table, in a room of so many boxes, none of which it touches."""
    world = World(device=device)
    world.add(plane(name="floor"))
    world.add(box((1.0, 1.0, 0.04), name="table", position=(0.0, 0.0, 0.48)))
    rng = np.random.default_rng(0)
    for _ in range(boxes):
        angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(1.5, 6.0)
        at = (distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.0, 2.5))
        world.add(box(rng.uniform(0.05, 0.4, 3), position=at))
    cloth = world.add(sheet((0.6, 0.6), cells=(30, 30), name="cloth", position=(0.0, 0.0, 0.55)))
    world.attach(cloth, Cloth())
    world.run(0.2, progress=False)
    return world


def boxes_ratio(device: str, repeats: int) -> dict[str, Any]:
    """Step time with 1,000 boxes over that without, from paired runs."""
    empty, full = room(0, device), room(1000, device)
    walls: dict[str, list[float]] = {"empty": [], "full": []}
    for _ in range(repeats):
        for name, world in (("empty", empty), ("full", full)):
            start = time.perf_counter()
            world.run(0.5, progress=False)
            wp.synchronize_device(device)
            walls[name].append(time.perf_counter() - start)
    ratios = [b / a for a, b in zip(walls["empty"], walls["full"], strict=True)]
    return {
        "frame_ms_without": round(1000 * statistics.median(walls["empty"]) / 30, 3),
        "frame_ms_with_1000_boxes": round(1000 * statistics.median(walls["full"]) / 30, 3),
        "median_ratio": round(statistics.median(ratios), 3),
    }


def attach(device: str, repeats: int) -> dict[str, Any]:
    """Milliseconds to attach a sheet of 31 x 33 vertices: a size not seen before, and one seen before."""
    world = World(device=device)
    new, again = [], []
    for k in range(repeats):
        cloth = world.add(sheet((0.6 + 0.001 * k, 0.64), cells=(30, 32), position=(0.0, 0.0, 1.0)))
        for times in (new, again):
            start = time.perf_counter()
            world.attach(cloth, Cloth())
            wp.synchronize_device(device)
            times.append(1000 * (time.perf_counter() - start))
            world.detach(cloth)
    return {"first_ms": round(statistics.median(new), 2), "again_ms": round(statistics.median(again), 2)}


def fresh(code: list[str], repeats: int, **environment: str) -> float:
    """Median wall seconds of a command in a fresh process."""
    walls = []
    for _ in range(repeats):
        start = time.perf_counter()
        subprocess.run([sys.executable, *code], check=True, env=os.environ | environment, capture_output=True)
        walls.append(time.perf_counter() - start)
    return round(statistics.median(walls), 3)


def main() -> None:
    """Measure all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--case", type=Path, default=Path("examples/pick-case"))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    wp.config.log_level = wp.LOG_ERROR
    report: dict[str, Any] = {"device": options.device}
    report["import"] = {
        "python_s": fresh(["-c", "pass"], options.repeats),
        "import_nuno_s": fresh(["-c", "import nuno"], options.repeats),
    }
    report["boxes"] = boxes_ratio(options.device, options.repeats)
    report["attach"] = attach(options.device, options.repeats)
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as out:
        command = ["-m", "nuno", "pick", str(options.case), "--out", out, "--device", options.device]
        report["first_run"] = {
            "empty_kernel_cache_s": fresh(command, 1, WARP_CACHE_PATH=cache),
            "warm_kernel_cache_s": fresh(command, 1, WARP_CACHE_PATH=cache),
        }
    for part, values in report.items():
        print(part, values)
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
