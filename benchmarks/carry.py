"""Carrying a mat in 90 ways: how long it takes, what comes of it, and whether half the substep says the same.

    python benchmarks/carry.py --out carried
    python benchmarks/carry.py --device cuda:0 --mat cloth
    python benchmarks/carry.py --half --every 2
    python benchmarks/carry.py --stiffness

Wall time by stage and the process's own busy time (for machines that others use too), the table, and how the trials
ended. `--half` runs all once more at twice the substeps: how often success and failure agree, and Spearman's rank
correlation of F over all that succeed in both. `--arms hulls` takes the links' own hulls, `--compare-hulls` both.
`--stiffness` instead clamps strips of the soft mat, 0.15 m free, and reads the bending rigidity off their sag: tip drop
over reach H / W of a strip under its own weight against the elastica's (theta'' = -G (1 - s) cos theta, G = w L^3 / B).
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from typing import Any

import numpy as np

import nuno
from nuno.tasks import carry_mat as carrying
from nuno.tasks.carry_result import CarryResult

TABLE_G = np.array([0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0])


def run(**options: Any) -> CarryResult:
    """Carry, and say what came of it."""
    busy, wall = time.process_time(), time.perf_counter()
    result = carrying.carry_mat(**options)
    busy, wall = time.process_time() - busy, time.perf_counter() - wall
    print(result.table())
    print(f"{len(result.trials)} trials in {wall:.1f} s ({result.seconds}), busy {busy:.1f} s")
    print(Counter(trial.reason for trial in result.trials), flush=True)
    return result


def compare(first: CarryResult, second: CarryResult, what: str) -> None:
    """Say how alike two results are."""
    from scipy.stats import spearmanr

    both = ~first.failed & ~second.failed
    order = spearmanr(first.values[both], second.values[both])[0]
    apart = np.median(np.abs(second.values[both] / first.values[both] - 1.0))
    print(
        f"{what}: success and failure agree in {100 * (first.failed == second.failed).mean():.1f} %, Spearman "
        f"{order:.3f} over {both.sum()}, F differs by {100 * apart:.1f} % in the median"
    )


def default_substeps(mat: nuno.Body, material: Any) -> int:
    """Return the substeps that the solver chooses."""
    world = nuno.World(device="cpu")
    world.attach(world.add(mat), material)
    return int(mat._dynamics.substeps)  # type: ignore[union-attr]


def ratio_of(g: float) -> float:
    """Return H / W of a strip that is clamped level, by the elastica."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq

    def end(bend: float) -> Any:
        # the arc, the angle and its slope, and where the strip is
        def slope(s: float, y: np.ndarray) -> list[float]:
            return [y[1], -g * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

        return solve_ivp(slope, (0.0, 1.0), [0.0, bend, 0.0, 0.0], rtol=1e-9, atol=1e-10).y[:, -1]

    # theta' at the clamp is the moment there: w L^2 / 2 at most, and downwards
    bend = brentq(lambda b: end(b)[1], 0.0, 0.5 * g + 1e-9)
    _, _, reach, drop = end(bend)
    return abs(drop) / reach


def stiffness(free: float = 0.15) -> None:
    """Say how stiff in bending the soft mat is, for several meshes."""
    ratios = np.array([ratio_of(g) for g in TABLE_G])
    material = carrying.FOAM
    size, modulus, density = carrying.SIZE, float(material.youngs_modulus), float(material.density)
    nominal, weight = modulus * size[2] ** 3 / 12.0, density * size[2] * 9.81
    for cells in ((12, 8, 3), (18, 12, 3), (24, 16, 3), (24, 16, 4)):
        for axis in range(2):
            world = nuno.World(device="cpu")
            mat = world.add(nuno.soft_box(size, cells=cells))
            rest = mat.vertices
            world.ignore_contact(mat, mat)
            world.attach(mat, nuno.Soft(density=density, youngs_modulus=modulus, poisson_ratio=0.25, air_drag=8.0))
            held = np.flatnonzero(rest[:, axis] <= 0.5 * size[axis] - free + 1e-6)
            world.grip(mat, held, to=rest[held].mean(axis=0))
            world.run(3.0)
            tip, clamp = rest[:, axis] > 0.5 * size[axis] - 1e-6, rest[held, axis].max()
            moved = mat.vertices[tip].mean(axis=0)
            found = -moved[2] / (moved[axis] - clamp)
            g = float(np.interp(found, ratios, TABLE_G))
            rigidity = weight * (0.5 * size[axis] - clamp) ** 3 / g
            print(
                f"{cells} along {'xy'[axis]}: H / W {found:.3f}, G {g:.2f}, {rigidity:.5f} N m, "
                f"{rigidity / nominal:.2f} E t^3 / 12"
            )


def main() -> None:
    """Read the options and run."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--device", default="cpu")
    options.add_argument("--mat", choices=carrying.MATS, default="soft")
    options.add_argument("--hold", choices=carrying.HOLDS, default="support")
    options.add_argument("--arms", choices=("boxes", "hulls"), default="boxes")
    options.add_argument("--every", type=int, default=1, help="every so many arm distances only")
    options.add_argument("--half", action="store_true")
    options.add_argument("--compare-hulls", action="store_true")
    options.add_argument("--stiffness", action="store_true")
    options.add_argument("--out")
    asked = options.parse_args()
    if asked.stiffness:
        stiffness()
        return
    given: dict[str, Any] = dict(
        mat=asked.mat, hold=asked.hold, arms=asked.arms, device=asked.device,
        arm_distances=carrying.DISTANCES[:: asked.every],
    )  # fmt: skip
    first = run(**given)
    if asked.out:
        first.save(asked.out)
    if asked.half:
        mat = nuno.Body(first.plan.mat)
        compare(first, run(**given, substeps=2 * default_substeps(mat, first.plan.material)), "half the substep")
    if asked.compare_hulls:
        compare(first, run(**(given | {"arms": "hulls"})), "hulls for boxes")


if __name__ == "__main__":
    main()
