"""What coordinates as doubles cost beside floats: the same scene with both, by turns in one process.

    python benchmarks/doubles.py [--device cuda:0] [--only 128]

A cloth that hangs from two corners and a soft cube that lands; on CUDA also a cloth of 128 x 128 cells lifted from a
table. Milliseconds a frame of 1/60 s are medians of three turns: by the clock on CUDA, on the CPU by its busy time.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from lift import lifted

import nuno
from nuno.state import double_positions

TURNS, SECONDS, LEAD = 3, 0.5, 4.0 / 60.0
"""How often each is timed, for how long, and what runs before [s]."""
DOUBLES, FLOATS = double_positions.DOUBLE_RATE, float("inf")
"""From how many substeps a second on coordinates are doubles."""


def hanging(device: str, worlds: int, contact: bool) -> nuno.World:
    """A cloth of 30 x 30 cells held at two corners, level at first."""
    world = nuno.World(device=device, substeps=40)
    body = world.add(nuno.sheet((1.0, 1.0), cells=(30, 30), name="body", position=(0.0, 0.0, 1.5)))
    if not contact:
        world.ignore_contact(body, body)
    world.attach(body, nuno.Cloth(area_density=0.2, air_drag=1.0))
    for corner in (0, 30):
        world.grip(body, [corner], to=body.vertices[corner])
    return world.imagine(worlds) if worlds > 1 else world


def landing(device: str, worlds: int, cells: int) -> nuno.World:
    """A soft cube that falls on the floor."""
    world = nuno.World(device=device, substeps=26)
    world.add(nuno.plane())
    body = world.add(nuno.soft_box((0.2, 0.2, 0.2), cells=(cells,) * 3, name="body", position=(0.0, 0.0, 0.15)))
    world.attach(body, nuno.Soft(density=1000.0, youngs_modulus=5e4, poisson_ratio=0.3, damping=0.005))
    return world.imagine(worlds) if worlds > 1 else world


def scenes(device: str) -> dict[str, Callable[[], nuno.World]]:
    """What is timed."""
    cuda = device.startswith("cuda")
    many, more, cells = (132, 264, 10) if cuda else (16, 16, 8)
    found: dict[str, Callable[[], nuno.World]] = {
        "cloth of 30 x 30, 40 substeps": lambda: hanging(device, 1, False),
        "with self-contact": lambda: hanging(device, 1, True),
        f"{many} worlds of it": lambda: hanging(device, many, False),
        f"{many} worlds with self-contact": lambda: hanging(device, many, True),
        f"soft cube of {cells}^3 cells, 26 substeps": lambda: landing(device, 1, cells),
        f"{more} worlds of soft cubes": lambda: landing(device, more, cells),
    }
    if cuda:
        found["cloth of 128 x 128 lifted, self-contact"] = lambda: lifted(device, 128, True)[0]
        found["without"] = lambda: lifted(device, 128, False)[0]
    return found


def frame(world: nuno.World, device: str) -> float:
    """Milliseconds of a frame."""
    import warp as wp

    clock = time.perf_counter if device.startswith("cuda") else time.process_time
    world.run(LEAD, progress=False)
    wp.synchronize_device(device)
    start = clock()
    world.run(SECONDS, progress=False)
    wp.synchronize_device(device)
    return 1e3 * (clock() - start) / (60.0 * SECONDS)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--only", default="", help="scenes in whose name this is")
    options = parser.parse_args()
    print(f"| scene | floats [ms a frame] | doubles | ratio | ({options.device})")
    print("|---|---|---|---|")
    for name, make in scenes(options.device).items():
        if options.only not in name:
            continue
        spent: dict[float, list[float]] = {FLOATS: [], DOUBLES: []}
        for rate in spent:  # kernels are compiled, and memory is taken
            double_positions.DOUBLE_RATE = rate
            make().run(LEAD, progress=False)
        for _ in range(TURNS):
            for rate, times in spent.items():
                double_positions.DOUBLE_RATE = rate
                times.append(frame(make(), options.device))
        floats, doubles = (float(np.median(times)) for times in spent.values())
        print(f"| {name} | {floats:.3f} | {doubles:.3f} | {doubles / floats:.2f} |", flush=True)


if __name__ == "__main__":
    main()
