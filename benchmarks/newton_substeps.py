"""Bending on Newton by its substeps: ``python benchmarks/newton_substeps.py [--device cuda] [--json substeps.json]``.

A strip of 0.2 m is clamped level at one end and hangs by its weight, G = w L^3 / B = 5, damped until it is at rest;
its drop over its reach is 0.586 by the elastica (Romero et al. 2021). Block descent goes through vertices one by one, a
few times a substep; what it leaves of bending depends on r = stretch stiffness x h^2 / (area density x cell^2).
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

import nuno

LENGTH, DENSITY, LOAD, DROP = 0.2, 0.2, 5.0, 0.586
SECONDS = 2.5
ROWS = [
    (10, 1000.0, 40), (10, 1000.0, 60), (10, 1000.0, 80), (10, 250.0, 40), (10, 4000.0, 80), (10, 4000.0, 120),
    (20, 1000.0, 80), (20, 1000.0, 120), (20, 1000.0, 160), (20, 1000.0, 240), (20, 250.0, 80),
]  # fmt: skip
"""Cells along, stretch stiffness [N/m], substeps a frame."""


def drop_of(cells: int, stretch: float, substeps: int, device: str) -> tuple[float, float]:
    """Return the drop of the strip's tip over its reach, and the time [s] that it took after the first two frames.

    The time is of the CPU, on CUDA of the clock.
    """
    h = LENGTH / (cells + 0.5)  # level in the middle of the first cell, both of whose rows are held
    rigidity = DENSITY * 9.81 * LENGTH**3 / LOAD
    slowest = 3.516 * np.sqrt(rigidity / (DENSITY * LENGTH**4))
    world = nuno.World(device=device, engine="newton", substeps=substeps)
    strip = world.add(nuno.sheet(((cells + 1) * h, 2 * h), cells=(cells + 1, 2), name="strip", position=(0, 0, 0.3)))
    start = strip.vertices
    held = np.flatnonzero(start[:, 0] < start[:, 0].min() + 1.1 * h)
    tip = np.flatnonzero(start[:, 0] > start[:, 0].max() - 0.1 * h)
    world.ignore_contact(strip, strip)
    material = nuno.Cloth(
        area_density=DENSITY, stretch_stiffness=stretch, bending_rigidity=rigidity, thickness=1e-3,
        air_drag=1.5 * slowest,
    )  # fmt: skip
    world.attach(strip, material)
    world.grip(strip, held, to=start[held].mean(axis=0))
    world.step()
    world.step()  # the second records the substeps
    clock = time.process_time if device == "cpu" else time.perf_counter
    begun = clock()
    world.run(SECONDS - 2.0 / world.frame_rate)
    moved = strip.vertices[tip].mean(axis=0)
    spent = clock() - begun
    root = strip.vertices[held, 0].mean()
    return float((start[tip, 2].mean() - moved[2]) / (moved[0] - root)), spent


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    drop_of(4, 1000.0, 40, given.device)  # kernels are compiled or loaded
    rows = []
    print(f"| cells along | stretch stiffness [N/m] | substeps | r | drop, over {DROP} | s for {SECONDS} s |")
    print("|---|---|---|---|---|---|", flush=True)
    for cells, stretch, substeps in ROWS:
        side = LENGTH / (cells + 0.5)
        ratio = stretch / (DENSITY * side**2) / (60.0 * substeps) ** 2
        drop, spent = drop_of(cells, stretch, substeps, given.device)
        rows.append({"cells": cells, "stretch": stretch, "substeps": substeps, "r": ratio, "drop": drop, "s": spent})
        print(f"| {cells} | {stretch:.0f} | {substeps} | {ratio:.2g} | {drop / DROP:.2f} | {spent:.1f} |", flush=True)
    if given.json:
        given.json.write_text(json.dumps({"device": given.device, "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
