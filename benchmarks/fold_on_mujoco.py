"""What a fold's bend on MuJoCo depends on: ``python benchmarks/fold_on_mujoco.py [--json fold.json]``.

A strip of 0.4 m is carried over itself by two corners, as in ``fold`` of ``engine_scenes.py``. The table has how high
its bend is, with one thing at a time changed, and on Nuno's own engine. ``turned`` is the largest angle between two
rows of cells. ``sharp`` is what folding along one line between cells costs in MuJoCo's hinges, whose energy goes by the
sine of half the angle: 2 B / h for cells of the length h, and ``round`` what half a circle of Nuno's height costs, B pi
/ (2 R), and lifting it, pi w R^2.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

import nuno

SIZE, DENSITY, RIGIDITY = (0.4, 0.1), 0.25, 5e-5
CASES = {
    "as it is": {},
    "rigidity 4 times": {"rigidity": 4.0 * RIGIDITY},
    "thickness 1 mm": {"thickness": 0.001},
    "no friction": {"friction": 0.0},
    "no air drag": {"drag": 0.0},
    "damping 0": {"damping": 0.0},
    "no self-contact": {"itself": False},
    "32 substeps": {"substeps": 32},
    "cells of half the length": {"cells": 24},
    "a third": {"cells": 36},
    "a quarter": {"cells": 48},
}


def folded(
    engine: str, cells: int = 12, rigidity: float = RIGIDITY, thickness: float = 0.004, friction: float = 0.6,
    drag: float = 2.0, damping: float | None = None, itself: bool = True, substeps: int | None = None,
) -> dict[str, float]:  # fmt: skip
    """Return how high the bend is [mm], the largest angle between rows of cells [degrees], and the CPU time [s]."""
    world = nuno.World(device="cpu", engine=engine, substeps=substeps)
    world.add(nuno.box((0.8, 0.8, 0.02), name="table", position=(0, 0, -0.01)))
    across = max(3, cells // 4)
    towel = world.add(nuno.sheet(SIZE, cells=(cells, across), name="towel", position=(0, 0, 0.5 * thickness)))
    start = towel.vertices
    more = {} if damping is None else {"damping": damping}
    material = nuno.Cloth(
        area_density=DENSITY, bending_rigidity=rigidity, thickness=thickness, friction=friction, air_drag=drag, **more
    )
    if not itself:
        world.ignore_contact(towel, towel)
    world.attach(towel, material)
    columns = cells + 1
    for row in (0, across):
        carried, covered = row * columns + cells, row * columns
        goal = start[covered] + (0.0, 0.0, thickness)
        above = 0.5 * (start[carried] + goal) + (0.0, 0.0, 0.15)
        path = nuno.Path([0.0, 1.0, 2.0], [start[carried], above, goal], interpolation="minimum_jerk")
        world.grip(towel, [carried], to=path)
    begun = time.process_time()
    world.run(2.5)
    spent = time.process_time() - begun
    middle = towel.vertices.reshape(across + 1, columns, 3).mean(axis=0)
    ways = np.diff(middle, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    angles = np.degrees(np.arccos(np.clip(np.einsum("ki,ki->k", ways[1:], ways[:-1]), -1.0, 1.0)))
    return {"height": float(1e3 * towel.vertices[:, 2].max()), "turned": float(angles.max()), "seconds": spent}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found = {"nuno": folded("nuno"), **{name: folded("mujoco", **values) for name, values in CASES.items()}}
    radius = 0.5e-3 * found["nuno"]["height"]
    bent = RIGIDITY * np.pi / (2.0 * radius), DENSITY * 9.81 * np.pi * radius**2
    print(f"round: {1e3 * bent[0]:.1f} mJ/m to bend and {1e3 * bent[1]:.1f} to lift it")
    print("| case | height [mm] | turned [degrees] | sharp [mJ/m] | CPU s |\n|---|---|---|---|---|")
    for name, row in found.items():
        values = CASES.get(name, {})
        row["sharp"] = 2e3 * values.get("rigidity", RIGIDITY) / (SIZE[0] / values.get("cells", 12))
        sharp = "-" if name == "nuno" else f"{row['sharp']:.1f}"
        print(f"| {name} | {row['height']:.1f} | {row['turned']:.0f} | {sharp} | {row['seconds']:.1f} |")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
