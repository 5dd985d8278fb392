"""Carrying a mat in 90 ways: how long it takes, what comes of it, and whether half the substep says the same.

    python benchmarks/carry.py --out carried
    python benchmarks/carry.py --device cuda:0 --mat cloth
    python benchmarks/carry.py --half --every 2
    python benchmarks/carry.py --save-plans plans.npz --plan-only
    python benchmarks/carry.py --device cuda:0 --plans plans.npz --warm --json carry.json
    python benchmarks/carry.py --stiffness

Wall time by stage and the process's own busy time (for machines that others use too), the table, and how the trials
ended. `--half` runs all once more at twice the substeps: how often success and failure agree, and Spearman's rank
correlation of F over all that succeed in both. `--arms boxes` takes boxes around the links, `--compare-boxes` both.
`--save-plans` writes where the arms are along the walks to a file; with `--plans` nothing of a robot is needed, and the
device may be on a machine without Pinocchio. `--warm` runs once more, now that all kernels are loaded.
`--stiffness` instead clamps strips of the soft mat, 0.15 m free, and reads the bending rigidity off their sag: tip drop
over reach H / W of a strip under its own weight against the elastica's (theta'' = -G (1 - s) cos theta, G = w L^3 / B).
`--body weight` carries with a whole robot that has dynamics, `--body kinematic` with the same links going where they
are sent, one trial after the other or in `--jobs` processes. Trials are appended to the `--json` file, and it goes on
from there.
`--compare FILE FILE` says how alike two such files, or one and that of a batch, are.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import pathlib
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from processes import in_processes

import nuno
from nuno.tasks import carry_mat as carrying
from nuno.tasks.arm_tracks import ArmTracks
from nuno.tasks.carry_by_robot import carry_by_robot
from nuno.tasks.carry_plan import make_plan
from nuno.tasks.carry_result import CarryResult

TABLE_G = np.array([0.1, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0])


def run(**options: Any) -> tuple[CarryResult, dict[str, Any]]:
    """Carry, and say what came of it."""
    busy, wall = time.process_time(), time.perf_counter()
    result = carrying.carry_mat(**options)
    busy, wall = time.process_time() - busy, time.perf_counter() - wall
    print(result.table())
    print(f"{len(result.trials)} trials in {wall:.1f} s ({result.seconds}), busy {busy:.1f} s")
    print(Counter(trial.reason for trial in result.trials), flush=True)
    late = int(sum(trial.failed_at is not None and trial.failed_at > 0.0 for trial in result.trials))
    said = {
        "trials": len(result.trials), "failed": int(result.failed.sum()), "failed_under_way": late, "wall_s": wall,
        "busy_s": busy, "seconds": result.seconds, "device": options["device"], "steadiest": result.best,
        "values": [None if np.isnan(value) else float(value) for value in result.values],
    }  # fmt: skip
    return result, said


def compare(first: CarryResult, second: CarryResult, what: str) -> dict[str, float]:
    """Say how alike two results are."""
    from scipy.stats import spearmanr

    both = ~first.failed & ~second.failed
    order = spearmanr(first.values[both], second.values[both])[0]
    apart = np.median(np.abs(second.values[both] / first.values[both] - 1.0))
    agree = (first.failed == second.failed).mean()
    print(
        f"{what}: success and failure agree in {100 * agree:.1f} %, Spearman {order:.3f} over {both.sum()}, F differs "
        f"by {100 * apart:.1f} % in the median",
        flush=True,
    )
    return {"agree": float(agree), "spearman": float(order), "over": int(both.sum()), "apart": float(apart)}


def plan(arms: str, path: str | None, processes: int) -> tuple[ArmTracks, dict[str, float]]:
    """Return the tracks of Talos' arms along ten walks, and the seconds that they took, or read them from a file."""
    wall, busy = time.perf_counter(), time.process_time()
    if path is not None:
        tracks = ArmTracks.load(path)
    elif processes:
        # a fresh start: a copy of a process in which threads run may hang
        with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as executor:
            tracks = carrying.plan_arms("talos", arms=arms, executor=executor)
    else:
        tracks = carrying.plan_arms("talos", arms=arms)
    return tracks, {"wall_s": time.perf_counter() - wall, "busy_s": time.process_time() - busy}


def with_body(tracks: ArmTracks, mat: str, body: str, path: pathlib.Path, jobs: int) -> None:
    """Carry with a whole robot, and append each trial to a file of JSON lines as it ends."""
    ways = itertools.product(range(len(tracks.distances)), carrying.OFFSETS_X, carrying.OFFSETS_Y)
    done = {way_of(row) for row in read_lines(path)} if path.exists() else set()
    left = [
        (tracks, mat, body, walk, x, y)
        for walk, x, y in ways
        if (round(float(tracks.distances[walk]), 4), x, y) not in done
    ]
    for said in in_processes(trial_with_body, left, jobs):
        print(said, flush=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(said) + "\n")


def trial_with_body(tracks: ArmTracks, mat: str, body: str, walk: int, x: float, y: float) -> dict[str, Any]:
    """Return what came of carrying in one way with a whole robot, and how long it took."""
    carried, material = carrying._mat(mat, None)
    plan = make_plan(tracks, carried, material, hold="support", arm_friction=0.5)
    robot = nuno.Humanoid(tracks.robot)
    wall, busy = time.perf_counter(), time.process_time()
    found = carry_by_robot(robot, plan, walk, np.array([x, y]), dynamics=body == "weight", goal=carrying.WALK)
    said = {name: None if value != value else value for name, value in vars(found).items()}
    said |= {"arm_distance": float(tracks.distances[walk]), "offset_x": x, "offset_y": y, "body": body}
    return said | {"wall_s": time.perf_counter() - wall, "busy_s": time.process_time() - busy}


def read_lines(path: pathlib.Path) -> list[dict[str, Any]]:
    """Read the trials of a file of JSON lines, or those in the result.json of a batch."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json" and text.lstrip().startswith("{\n"):
        trials: list[dict[str, Any]] = json.loads(text)["trials"]
        return trials
    return [json.loads(line) for line in text.splitlines()]


def way_of(row: dict[str, Any]) -> tuple[float, float, float]:
    """Return the three parameters of a trial."""
    return round(row["arm_distance"], 4), row["offset_x"], row["offset_y"]


def compare_files(paths: list[str]) -> None:
    """Print the trials that two files share, and how their orders by F agree."""
    from scipy.stats import spearmanr

    first, second = ({way_of(row): row for row in read_lines(pathlib.Path(path))} for path in paths)
    shared = sorted(set(first) & set(second))
    print("| arms, ahead, aside [m] | F | F | why |\n|---|---|---|---|")
    for way in shared:
        cells = [
            f"{1000.0 * row['value']:.1f}" if row["value"] is not None else f"x {row['failed_at']:.1f}"
            for row in (first[way], second[way])
        ]
        print(f"| {way[0]:.3f}, {way[1]:+.2f}, {way[2]:+.2f} | {cells[0]} | {cells[1]} | {second[way]['reason']} |")
    values = np.array([[np.nan if own[way]["value"] is None else own[way]["value"] for way in shared]
                       for own in (first, second)])  # fmt: skip
    both = np.isfinite(values).all(axis=0)
    agree = (np.isfinite(values[0]) == np.isfinite(values[1])).mean() if shared else np.nan
    order = spearmanr(*values[:, both])[0] if both.sum() > 2 else np.nan
    print(
        f"{len(shared)} shared, carried {np.isfinite(values).sum(axis=1).tolist()}, success and failure agree in "
        f"{100 * agree:.1f} %, Spearman {order:.3f} over {both.sum()}, F of the second "
        f"{np.median(values[1, both] / values[0, both]):.2f} times the first's in the median"
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
    options.add_argument("--arms", choices=("hulls", "boxes"), default="hulls")
    options.add_argument("--every", type=int, default=1, help="every so many arm distances only")
    options.add_argument("--half", action="store_true", help="once more at half the substep")
    options.add_argument("--compare-boxes", action="store_true")
    options.add_argument("--warm", action="store_true", help="once more, with all kernels loaded")
    options.add_argument("--processes", type=int, default=0, help="that plan walks; 0 plans them in this one")
    options.add_argument("--jobs", type=int, default=1, help="processes for --body, each on one core")
    options.add_argument("--plans", help="a file of plans to take")
    options.add_argument("--save-plans", help="a file to write plans to")
    options.add_argument("--plan-only", action="store_true")
    options.add_argument("--stiffness", action="store_true")
    options.add_argument("--body", choices=("weight", "kinematic"), help="a whole robot, one trial a process")
    options.add_argument("--compare", nargs=2, metavar="FILE", help="two files of trials")
    options.add_argument("--out", help="folder for table and pictures")
    options.add_argument("--json", help="file for the numbers")
    asked = options.parse_args()
    if asked.stiffness:
        stiffness()
        return
    if asked.compare:
        compare_files(asked.compare)
        return
    tracks, planning = plan(asked.arms, asked.plans, asked.processes)
    print(f"{len(tracks.distances)} walks and the arms along them: {planning}", flush=True)
    if asked.save_plans:
        tracks.save(asked.save_plans)
    if asked.plan_only:
        return
    if asked.body:
        path = pathlib.Path(asked.json or f"carry-{asked.body}.jsonl")
        with_body(tracks.of_walks(slice(None, None, asked.every)), asked.mat, asked.body, path, asked.jobs)
        return
    given: dict[str, Any] = dict(
        robot=tracks.of_walks(slice(None, None, asked.every)), mat=asked.mat, hold=asked.hold, device=asked.device
    )
    first, said = run(**given)
    found: dict[str, Any] = {"planning": planning, "first": said}
    if asked.out:
        first.save(asked.out)
    if asked.warm:
        found["warm"] = run(**given)[1]
    if asked.half:
        mat = nuno.Body(first.plan.mat)
        finer, found["half"] = run(**given, substeps=2 * default_substeps(mat, first.plan.material))
        found["half"] |= compare(first, finer, "half the substep")
    if asked.compare_boxes:
        boxes = plan("boxes", None, asked.processes)[0].of_walks(slice(None, None, asked.every))
        second, found["boxes"] = run(**(given | {"robot": boxes}))
        found["boxes"] |= compare(first, second, "boxes for hulls")
    if asked.json:
        pathlib.Path(asked.json).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
