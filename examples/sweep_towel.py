"""How limp and how slippery must a towel be to slide off a ball? The same sweep in a batch and over processes.

Run: python examples/sweep_towel.py [--results FILE] [--out FOLDER]

With a results file, a run that is killed goes on where it stopped; a run that has ended is only read.
"""

import argparse
import multiprocessing
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import nuno

GRID = {"bending_rigidity": [1e-6, 1e-5, 1e-4, 1e-3], "friction": [0.02, 0.1, 0.5]}
RADIUS = 0.06  # [m] of the ball
FALL = 1.0  # [s]


def room() -> nuno.World:
    """A towel over a ball that stands on the floor, a little off its middle; every process makes its own."""
    world = nuno.World(device="cpu", substeps=12)
    world.add(nuno.plane(name="floor"))
    world.add(nuno.sphere(RADIUS, name="ball", position=(0, 0, RADIUS)))
    world.add(nuno.sheet((0.3, 0.2), cells=(12, 8), name="towel", position=(0.05, 0, 2 * RADIUS + 0.01)))
    return world


def drop(world: nuno.World, params: dict) -> dict:
    """Let one towel fall in each world of the batch, and tell where its middle is in the end."""
    world.find("ball").friction = params["friction"]
    world.attach("towel", nuno.Cloth(**params))
    world.run(FALL)
    middle = world.find("towel").vertices.mean(axis=1)  # (worlds, 3)
    return {"slid": middle[:, 0] - 0.05, "height": middle[:, 2]}


def main() -> None:
    """Sweep in one batch, then over two processes, and compare."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--results", help="a file for the results")
    options.add_argument("--out", type=Path, help="a folder for a plot")
    asked = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        results = asked.results or Path(folder) / "results.jsonl"
        found = nuno.sweep(drop, GRID, world=room, results=results)
        for k in range(len(found)):
            row = found.row(k)
            print(
                f"bending {row['bending_rigidity']:.0e} N m, friction {row['friction']:.2f}: slid "
                f"{found.values('slid')[k] * 100:+.1f} cm, its middle is {found.values('height')[k] * 100:.1f} cm high"
            )
        again = nuno.sweep(drop, GRID, world=room, results=results)  # nothing is left to run
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        over_processes = nuno.sweep(drop, GRID, world=room, executor=pool, batch=6)
    assert not found.failures
    for other in (again, over_processes):
        np.testing.assert_array_equal(found.values("height"), other.values("height"))
    slid = found.values("slid").reshape(4, 3)
    assert (slid[:, 0] > slid[:, 2]).all(), "less friction lets a towel slide farther"
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
        figure = Figure(figsize=(5.2, 3.6), layout="constrained")
        axes = figure.subplots()
        for friction, values in zip(GRID["friction"], slid.T, strict=True):
            axes.semilogx(GRID["bending_rigidity"], 100 * values, "o-", label=f"friction {friction}")
        axes.set(xlabel="bending rigidity [N m]", ylabel="slid [cm]")
        axes.legend()
        figure.savefig(asked.out / "sweep_towel.png", dpi=100)


if __name__ == "__main__":  # processes import this file
    main()
