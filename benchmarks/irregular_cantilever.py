"""Bending of irregular triangle meshes on each engine: ``python benchmarks/irregular_cantilever.py``.

A strip is clamped level at one end and hangs by its weight, G = w L^3 / B = 6. The drop of its tip over its reach tells
which rigidity it has (the elastica, theta'' = -G (1 - s) cos(theta)); the table has that over the nominal one. Points
are a grid of 20 x 5 cells that was shaken, each by a share of a cell's side, or thrown at random with the same density;
Delaunay's triangles join them. The grid itself, with all diagonals alike, is beside them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scipy.integrate import solve_bvp
from scipy.spatial import Delaunay

import nuno

LENGTH, CELLS, ACROSS = 0.2, 20, 5
STEP = LENGTH / CELLS
DENSITY, LOAD = 0.2, 6.0
SEEDS = 5


def strip_mesh(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (n, 2) [m] from -STEP on, those up to 0 to be held, and triangles (m, 3)."""
    random = np.random.default_rng(seed)
    x, y = (part.ravel() for part in np.meshgrid(np.arange(-1, CELLS + 1), np.arange(ACROSS + 1), indexing="ij"))
    points = STEP * np.stack([x, y], axis=1).astype(float)
    inner_x, inner_y = (x > 0) & (x < CELLS), (y > 0) & (y < ACROSS)
    if kind == "random":
        thrown = random.uniform((0.5 * STEP, 0.4 * STEP), (LENGTH - 0.5 * STEP, (ACROSS - 0.4) * STEP), (4000, 2))
        kept = [points[k] for k in np.flatnonzero(~(inner_x & inner_y))]
        for point in thrown:  # as close as three quarters of a cell's side
            if np.linalg.norm(np.array(kept) - point, axis=1).min() > 0.75 * STEP:
                kept.append(point)
        points = np.array(kept)
    elif kind != "grid":
        share = float(kind.removeprefix("shaken "))
        moves = share * STEP * random.uniform(-1.0, 1.0, points.shape)
        points[:, 0] += np.where(inner_x, moves[:, 0], 0.0)
        points[:, 1] += np.where(inner_x & inner_y, moves[:, 1], 0.0)
    else:
        points[:, 0] += 1e-6 * points[:, 1]  # so that all diagonals are alike
    found = Delaunay(points).simplices
    corners = points[found]
    sides, others = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = sides[:, 0] * others[:, 1] - sides[:, 1] * others[:, 0]
    found = np.where((area < 0.0)[:, None], found[:, ::-1], found)
    return points, found[np.abs(area) > 1e-3 * STEP**2]


def drop_over_reach(load: float) -> float:
    """Return the elastica's, with slope zero at its start and no moment at its end; angles count downwards."""
    s = np.linspace(0.0, 1.0, 101)
    solved = solve_bvp(
        lambda s, t: np.stack([t[1], -load * (1.0 - s) * np.cos(t[0])]), lambda a, b: np.array([a[0], b[1]]), s,
        np.stack([0.8 * s, 0.8 + 0.0 * s]), tol=1e-8,
    )  # fmt: skip
    angle = solved.sol(s)[0]
    return float(np.trapezoid(np.sin(angle), s) / np.trapezoid(np.cos(angle), s))


def felt(kind: str, seed: int, engine: str) -> float:
    """Return the strip's rigidity over the nominal one."""
    points, triangles = strip_mesh(kind, seed)
    reach = LENGTH + 0.5 * STEP  # the slope is zero in the middle of the held cells and the first free ones
    rigidity = DENSITY * 9.81 * reach**3 / LOAD
    slowest = 3.516 * np.sqrt(rigidity / (DENSITY * LENGTH**4))
    world = nuno.World(device="cpu", engine=engine)
    flat = np.pad(points, ((0, 0), (0, 1)))
    strip = world.add(nuno.cloth_mesh(flat, triangles, name="strip"))
    held, tip = np.flatnonzero(points[:, 0] < 1e-9), np.flatnonzero(points[:, 0] > LENGTH - 1e-9)
    world.ignore_contact(strip, strip)
    world.attach(
        strip, nuno.Cloth(area_density=DENSITY, bending_rigidity=rigidity, thickness=1e-3, air_drag=1.5 * slowest)
    )
    start = strip.vertices
    world.grip(strip, held, to=start[held].mean(axis=0))
    world.run(2.5)
    moved = strip.vertices[tip].mean(axis=0)
    ratio = (start[tip, 2].mean() - moved[2]) / (moved[0] - start[held, 0].max() + 0.5 * STEP)
    loads = np.linspace(1.5, 18.0, 34)
    return LOAD / float(np.interp(ratio, [drop_over_reach(load) for load in loads], loads))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", nargs="+", default=["nuno", "mujoco"])
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows = {}
    print("| mesh | " + " | ".join(f"{engine}: mean (least to most)" for engine in given.engines) + " |")
    print("|---" * (len(given.engines) + 1) + "|")
    for kind in ("grid", "shaken 0.15", "shaken 0.3", "random"):
        cells = []
        for engine in given.engines:
            values = [felt(kind, seed, engine) for seed in range(1 if kind == "grid" else given.seeds)]
            rows[f"{kind}, {engine}"] = values
            cells.append(f"{np.mean(values):.2f} ({min(values):.2f} to {max(values):.2f})")
        print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
