"""What a step costs, and how much memory a world takes, against the number of particles, worlds and static shapes.

    python benchmarks/sizes.py [--device cuda:0] [--plot docs/images/sizes.png] [--json sizes.json] [--kinds worlds]

A cloth falls on a table and over a bar, with self-contact, and on the table alone; a soft cube lands on the table. A
bar slimmer than three cells, as this one is up to 75 x 75 cells, meets the cloth's edges and triangles too. Times are
medians of frames of 1/60 s, kernels already compiled.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

import nuno

FRAMES = 24
KINDS = ("cloth particles", "soft particles", "worlds", "static shapes")
PARTICLES = {"cpu": (8, 16, 32, 64), "cuda": (16, 32, 64, 128, 256)}
SOFT = {"cpu": (4, 6, 10, 16), "cuda": (4, 6, 10, 16, 24)}
WORLDS = {"cpu": (1, 4, 16, 64), "cuda": (1, 16, 128, 1024, 8192)}
SHAPES = (1, 10, 100, 1000)


def room(device: str) -> nuno.World:
    world = nuno.World(device=device)
    world.add(nuno.box((1.2, 0.8, 0.02), name="table", position=(0.0, 0.0, -0.01)))
    return world


def cloth(world: nuno.World, cells: int, bar: bool = True) -> nuno.Body:
    if bar:
        world.add(nuno.capsule(0.02, 0.6, name="bar", position=(0.1, 0.0, 0.03)).rotate(np.pi / 2, "x"))
    body = world.add(nuno.sheet((0.5, 0.5), cells=(cells, cells), position=(0.0, 0.0, 0.1)))
    world.attach(body)
    return body


def cube(world: nuno.World, cells: int) -> nuno.Body:
    body = world.add(nuno.soft_box((0.2, 0.2, 0.2), cells=(cells,) * 3, position=(0.0, 0.0, 0.13)))
    world.attach(body, nuno.Soft(density=1000.0, youngs_modulus=5e4))
    return body


def frame_seconds(world: nuno.World) -> float:
    """Median wall seconds of a frame."""
    world.run(4 / 60)
    spans = []
    for _ in range(FRAMES):
        start = time.perf_counter()
        world.step()
        # wait for the device
        next(b for b in world.bodies if b.is_dynamic)._dynamics.finite()  # type: ignore[union-attr]
        spans.append(time.perf_counter() - start)
    return float(np.median(spans))


def draped(device: str, cells: int, count: int, bar: bool) -> tuple[float, Any]:
    """Milliseconds a frame of a cloth, in many worlds or one, and its solver."""
    world = room(device)
    body = cloth(world, cells, bar)
    if count > 1:
        world = world.imagine(count)
    ms = 1e3 * frame_seconds(world)
    return ms, world.find(body.name)._dynamics.solver  # type: ignore[union-attr]


def measured(kind: str, device: str) -> Iterator[dict[str, Any]]:
    """One row a size."""
    short = device.split(":")[0]
    if kind == "cloth particles":
        for cells in PARTICLES[short]:
            flat = draped(device, cells, 1, bar=False)[0]
            ms, solver = draped(device, cells, 1, bar=True)
            row = {"size": (cells + 1) ** 2, "ms": ms, "flat_ms": flat, "substeps": solver.substeps}
            yield row | {"bytes": solver.memory_bytes / row["size"]}
    elif kind == "soft particles":
        for cells in SOFT[short]:
            world = room(device)
            body = cube(world, cells)
            solver = body._dynamics.solver  # type: ignore[union-attr]
            row = {"size": (cells + 1) ** 3, "ms": 1e3 * frame_seconds(world), "substeps": solver.substeps}
            yield row | {"bytes": solver.memory_bytes / (5 * cells**3)}
    elif kind == "worlds":
        for count in WORLDS[short]:
            flat = draped(device, 30, count, bar=False)[0]
            ms, solver = draped(device, 30, count, bar=True)
            row = {"size": count, "ms": ms, "flat_ms": flat, "substeps": solver.substeps}
            yield row | {"bytes": solver.memory_bytes / count}
    else:
        for count in SHAPES:
            world = room(device)
            rng = np.random.default_rng(1)
            for _ in range(count):
                place = rng.uniform((1.0, -5.0, 0.0), (9.0, 5.0, 2.0))
                world.add(nuno.box(rng.uniform(0.1, 0.4, 3), position=place))
            solver = cloth(world, 30)._dynamics.solver  # type: ignore[union-attr]
            yield {"size": count, "ms": 1e3 * frame_seconds(world), "substeps": solver.substeps, "bytes": 0.0}


def plot(results: dict[str, list[dict[str, Any]]], path: str, device: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullLocator

    figure, axes = plt.subplots(1, len(results), figsize=(4 * len(results), 3.4), layout="constrained", sharey=True)
    for axis, (kind, rows) in zip(axes, results.items(), strict=True):
        sizes = [r["size"] for r in rows]
        axis.loglog(sizes, [r["ms"] for r in rows], "o-", color="tab:blue", label="over a bar")
        if "flat_ms" in rows[0]:
            axis.loglog(sizes, [r["flat_ms"] for r in rows], "o--", color="tab:orange", label="on a table")
            axis.legend()
        axis.axhline(1e3 / 60, color="gray", linewidth=0.8)
        axis.set(xlabel=kind, title=f"{kind}, {device}")
        axis.set_xticks(sizes, [str(size) for size in sizes])
        axis.set_xticks([], minor=True)
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_locator(NullLocator())
        axis.grid(True, linewidth=0.3)
    axes[0].set_ylabel("ms a frame (grey: real time)")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--plot")
    parser.add_argument("--json")
    parser.add_argument("--kinds", nargs="+", default=KINDS, choices=KINDS)
    options = parser.parse_args()
    results: dict[str, list[dict[str, Any]]] = {}
    head = ("against", "size", "substeps", "ms a frame", "without the bar", "bytes a particle, tetrahedron, world")
    print(f"| {' | '.join(head)} | ({options.device})")
    print("|" + "---|" * len(head))
    for kind in options.kinds:
        results[kind] = []
        for row in measured(kind, options.device):
            results[kind].append(row)
            flat = f"{row['flat_ms']:.2f}" if "flat_ms" in row else ""
            cells = (kind, str(row["size"]), str(row["substeps"]), f"{row['ms']:.2f}", flat, f"{row['bytes']:.0f}")
            print(f"| {' | '.join(cells)} |", flush=True)
    if options.plot:
        plot(results, options.plot, options.device)
    if options.json:
        with open(options.json, "w") as stream:
            json.dump({"device": options.device, "results": results}, stream, indent=1)


if __name__ == "__main__":
    main()
