"""CPU seconds of some scenes, this version and another by turns, so that other work on the machine changes neither.

    python benchmarks/compare_versions.py OTHER [--scenes picks hang ...] [--rounds 3] [--device cpu] [--json FILE]
                                          [--caches FOLDER]

OTHER is the src folder of another checkout (git worktree add ../other COMMIT). Each run is a process of its own, which
warms up for two frames. Kernels that both compile otherwise from the same Python text need a cache each (--caches), for
Warp tells them apart by that text. On CUDA the seconds are by the clock, as the processor waits.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

HERE = Path(__file__).resolve().parents[1] / "src"


def picks(device: str, worlds: int = 36) -> tuple[Any, float]:
    """36 picks of a 30 x 30-cell cloth at 20 substeps, 3 s."""
    import nuno

    world = nuno.World(device=device, substeps=20)
    world.add(nuno.box((1.2, 0.8, 0.04), name="table", position=(0, 0, 0.68)))
    world.add(nuno.plane(name="floor"))
    world.add(nuno.sheet((0.6, 0.6), cells=(30, 30), name="cloth", position=(0, 0, 0.702)))
    futures = world.imagine(worlds)
    cloth = futures.find("cloth")
    futures.attach(cloth, nuno.Cloth(area_density=0.2, bending_rigidity=5e-5, air_drag=1.5, thickness=0.004))
    line = np.linspace(0, 30, 6).round().astype(int)
    vertices = np.array([j * 31 + i for j in line for i in line])[np.arange(worlds) % 36]
    start = np.asarray(cloth.vertices)[0][vertices]
    keys = np.stack([start, start + np.array([0, 0, 0.4])], axis=1)
    futures.grip(cloth, vertices[:, None], to=nuno.Path((0.1, 1.6), keys, None, "minimum_jerk"))
    return futures, 3.0


def picks_by_rule(device: str) -> tuple[Any, float]:
    """16 picks of a 20 x 20-cell cloth at default substeps, whose coordinates are doubles, 1.5 s."""
    import nuno

    world = nuno.World(device=device)
    world.add(nuno.box((1.2, 0.8, 0.04), name="table", position=(0, 0, 0.68)))
    world.add(nuno.sheet((0.4, 0.4), cells=(20, 20), name="cloth", position=(0, 0, 0.702)))
    futures = world.imagine(16)
    cloth = futures.find("cloth")
    futures.attach(cloth, nuno.Cloth(area_density=0.2, bending_rigidity=5e-5, air_drag=1.5, thickness=0.004))
    line = np.linspace(0, 20, 4).round().astype(int)
    vertices = np.array([j * 21 + i for j in line for i in line])
    start = np.asarray(cloth.vertices)[0][vertices]
    keys = np.stack([start, start + np.array([0, 0, 0.3])], axis=1)
    futures.grip(cloth, vertices[:, None], to=nuno.Path((0.1, 1.0), keys, None, "minimum_jerk"))
    return futures, 1.5


def hang(device: str) -> tuple[Any, float]:
    """A cloth of 32 x 32 cells by two corners, with self-contact, 3 s."""
    import nuno

    world = nuno.World(device=device)
    cloth = world.add(nuno.sheet((1.0, 1.0), cells=(32, 32), position=(0, 0, 2.0)))
    rail = world.add(nuno.box((0.02, 0.02, 0.02), position=(0, 0, 2.6)))
    world.attach(cloth, nuno.Cloth(area_density=0.2))
    world.grip(cloth, [0, 32], to=rail)
    return world, 3.0


def softcube(device: str) -> tuple[Any, float]:
    """A soft cube of 10 x 10 x 10 cells that falls on a floor, 2 s."""
    import nuno

    world = nuno.World(device=device)
    world.add(nuno.plane())
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(10, 10, 10), position=(0, 0, 0.15)))
    world.attach(cube, nuno.Soft(youngs_modulus=5e4, density=1000.0))
    return world, 2.0


def boxes(device: str) -> tuple[Any, float]:
    """A hundred rigid boxes that fall in stacks, 2 s."""
    import nuno

    world = nuno.World(device=device)
    world.add(nuno.plane())
    for k in range(100):
        place = (0.13 * (k % 5), 0.13 * (k // 5 % 5), 0.1 + 0.12 * (k // 25))
        world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=place)), nuno.Rigid(mass=1.0))
    return world, 2.0


def box_on_towel(device: str) -> tuple[Any, float]:
    """A box of 1 kg on a towel on a table, 2 s."""
    import nuno

    world = nuno.World(device=device)
    world.add(nuno.box((1.2, 0.8, 0.04), position=(0, 0, 0.68)))
    towel = world.add(nuno.sheet((0.4, 0.4), cells=(20, 20), position=(0, 0, 0.702)))
    world.attach(towel, nuno.Cloth(area_density=0.2))
    world.attach(world.add(nuno.box((0.1, 0.1, 0.1), position=(0, 0, 0.756))), nuno.Rigid(mass=1.0))
    return world, 2.0


def two_towels(device: str) -> tuple[Any, float]:
    """Two towels at rest on each other on a table, 0.5 s."""
    import nuno

    world = nuno.World(device=device)
    world.add(nuno.box((1.0, 1.0, 0.02), position=(0, 0, -0.01)))
    for k in range(2):
        place = (0.003 * k, 0.002 * k, 0.003 + 0.005 * k)
        world.attach(world.add(nuno.sheet((0.3, 0.2), cells=(24, 16), position=place)))
    return world, 0.5


def standing_robots(device: str) -> tuple[Any, float]:
    """64 worlds of Talos with dynamics, whose arms move, before a table with a towel, 0.25 s."""
    from imagined_robots import begin, room

    return begin(room(True, True, 20, device), 64, 20), 0.25


def kinematic_robot(device: str) -> tuple[Any, float]:
    """Talos without dynamics, whose arm moves, 60 s frame by frame."""
    import nuno

    world = nuno.World(device=device)
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    robot.angle_vector({f"arm_left_{k}_joint": -0.3 for k in (1, 2, 4)}, 70.0)
    return _Ticks(world), 60.0


class _Ticks:
    """A world that is stepped frame by frame, as whoever waits for a robot steps it."""

    def __init__(self, world: Any) -> None:
        self._world = world

    def run(self, seconds: float, progress: bool = False) -> None:
        for _ in range(round(seconds * 60.0)):
            self._world.run(1.0 / 60.0, progress=progress)


SCENES: dict[str, Callable[[str], tuple[Any, float]]] = {
    made.__name__: made
    for made in (
        picks,
        picks_by_rule,
        hang,
        softcube,
        boxes,
        box_on_towel,
        two_towels,
        standing_robots,
        kinematic_robot,
    )
}


def run_one(scene: str, device: str) -> None:
    """Print the seconds of one scene, with the version that is imported."""
    import warp as wp

    world, seconds = SCENES[scene](device)
    for _ in range(2):
        world.run(1.0 / 60.0, progress=False)
    wp.synchronize()
    clock = time.process_time if device == "cpu" else time.perf_counter
    start = clock()
    world.run(seconds, progress=False)
    wp.synchronize()
    print("seconds", clock() - start)


def main() -> None:
    """Run every scene with both versions by turns, and print medians and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--caches", type=Path, help="folder with a kernel cache for each (default: one for both)")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        run_one(options.scenes[0], options.device)
        return
    if not (options.other / "nuno").is_dir():
        sys.exit(f"no package nuno in {options.other}: give the src folder of another checkout")
    spent: dict[str, tuple[list[float], list[float]]] = {scene: ([], []) for scene in options.scenes}
    for scene, times in tqdm([(scene, spent[scene]) for _ in range(options.rounds) for scene in options.scenes]):
        for name, source, own in zip(("other", "here"), (options.other, HERE), times, strict=True):
            command = [sys.executable, __file__, str(options.other), "--one", "--scenes", scene]
            paths = [str(source.resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
            environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
            if options.caches is not None:
                environment["WARP_CACHE_PATH"] = str(options.caches.resolve() / name)
            done = subprocess.run(
                [*command, "--device", options.device], env=environment, capture_output=True, text=True
            )  # fmt: skip
            if done.returncode:
                sys.exit(f"{scene} with {source} failed:\n{done.stderr}")
            own.append(float(done.stdout.split("seconds")[-1]))
    print(f"{'scene':14}{'before [s]':>12}{'now [s]':>12}{'ratio':>8}")
    rows = []
    for scene, (before, now) in spent.items():
        rows.append({"scene": scene, "before_s": before, "now_s": now})
        a, b = statistics.median(before), statistics.median(now)
        print(f"{scene:14}{a:12.3f}{b:12.3f}{b / a:8.3f}")
    if options.json:
        options.json.write_text(json.dumps({"device": options.device, "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
