"""Success rates of planning in imagination, and how many futures a second it imagines.

    python benchmarks/planning.py [--tasks flatten hang cover pull] [--seeds 0 20] [--device cpu] [--json FILE]
    python benchmarks/planning.py --hands talos|dynamic [--tasks cover] [--rough] ...
    python benchmarks/planning.py --rate [--rollouts 512] [--device cuda] [--side 0.6] [--json FILE]

The first carries out each task twice for each seed: with a fixed motion of the hands, which knows of this seed's room
only where the corners of the cloth were at the start, and with the same motion as the start of ``nuno.replan``, which
imagines 24 futures (12 of the pull) in one batch, twice a plan, acts for a while, looks and plans on. The criteria
are in docs/planning.md. With ``--json`` seeds that are in the file already are left out, so that several runs add up.

The second does so with Talos' arms in the place of points (benchmarks/arm_tasks.py), without or with dynamics of the
robot. What the last plan of a seed cost in imagination stands beside what it cost as carried out. ``--rough`` imagines
fast frames once (``thorough=False``), as hands that are points always do here.

The third imagines futures of 1 s of a sheet of 20 x 20 cells that two hands fold, with one iteration: plan after plan
by ``nuno.replan``, which sets its futures back, and by ``nuno.plan``, which imagines them anew. It tells rollouts a
second, plans a second, and what of a plan is beginning with the batch, setting it on its way, simulating and scoring,
medians. The first plan of a row, which compiles kernels where that was not done, stands by itself. On CUDA
``nuno.plans.run_blocks_small`` (up to 158 rollouts ``run_blocks_shared``) takes long to compile.
``--thorough`` imagines with doubles, and fast frames twice.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import warp as wp
from planning_tasks import TASKS, Task
from tqdm import tqdm

import nuno


def carry_out_fixed(task: Task) -> None:
    """Do all stages by what was seen at the start."""
    seen = task.look()
    for stage, pair in enumerate(task.pairs):
        if stage:
            task.pair = np.array([task.nearest(seen[k]) for k in pair])
        else:
            task.pair = task.corners[list(pair)]
        if (task.pair < 0).any() or task.pair[0] == task.pair[1]:
            continue  # a hand found nothing: the other one leaves its corner, too
        task.come()
        task.act(task.world, nuno.Knots(task.now(task.world), task.fixed(seen, stage), task.horizon))
        task.world.run(task.horizon, progress=False)
        task.release()
        task.world.run(task.settle, progress=False)


def carry_out_planned(task: Task, seed: int, thorough: bool = False) -> dict[str, float]:
    """Plan and replan each stage from what is seen then; return what planning took."""
    seconds, plans, imagined, true = 0.0, 0, np.nan, np.nan
    for stage, pair in enumerate(task.pairs):
        if stage and task.is_solved(task.figures()):
            break
        task.pair = task.corners[list(pair)]
        task.come()
        found = nuno.replan(
            task.world, task.act, task.judge, now=task.now, start=task.fixed(task.look(), stage), spread=task.spread,
            horizon=task.horizon, every=task.every, periods=8, shrink=True, samples=task.samples,
            iterations=task.iterations, bounds=(task.lowest, task.highest), seed=100 * seed + 10 * stage,
            thorough=thorough,
        )  # fmt: skip
        imagined, true = found.plans[-1].cost, task.carried_out()
        seconds, plans = seconds + float(found.planning_seconds.sum()), plans + len(found.plans)
    return {"planning_s": seconds, "plans": plans, "imagined_s": task.imagined, "cost": imagined, "true_cost": true}


def trial(
    name: str, seed: int, device: str, tasks: dict[str, type[Task]], thorough: bool, samples: int | None
) -> dict[str, Any]:
    """Both ways of one seed."""
    row: dict[str, Any] = {"task": name, "seed": seed, "device": device}
    begin, cpu = time.perf_counter(), time.process_time()
    for way in ("fixed", "planned"):
        task: Any = tasks[name](seed, device)
        task.samples = samples or task.samples
        try:
            if way == "fixed":
                carry_out_fixed(task)
            else:
                row.update(carry_out_planned(task, seed, thorough))
            task.world.run(1.0, progress=False)
            figures = task.figures()
            row[way] = {"solved": bool(task.is_solved(figures)), **figures}
        except nuno.NunoError as error:
            row[way] = {"solved": False, "error": f"{type(error).__name__}: {error}"}
    row["wall_s"], row["cpu_s"] = time.perf_counter() - begin, time.process_time() - cpu
    return row


def measure_rate(rollouts: int, device: str, plans: int, side: float, thorough: bool) -> dict[str, Any]:
    """Futures of 1 s of a sheet of 20 x 20 cells, whose far corners two hands lay onto its near ones, in one batch."""
    world = nuno.World(device=device)
    world.add(nuno.box((2.0, 2.0, 0.02), name="table", position=(0.0, 0.0, -0.01)))
    cloth = world.add(nuno.sheet((side, side), (20, 20), name="cloth", position=(0.0, 0.0, 0.002)))
    world.attach(cloth)
    near, far = np.array([0, 20]), np.array([20 * 21, 21 * 21 - 1])
    goal, begin = (cloth.vertices[k].astype(float).ravel() for k in (near, far))

    instants = []

    def go(futures: nuno.World, motion: nuno.Knots) -> None:
        instants.append(time.perf_counter())
        for k, vertex in enumerate(far):
            futures.grip("cloth", np.array([vertex]), to=motion.path(futures.time, slice(3 * k, 3 * k + 3)))
        instants.append(time.perf_counter())

    def act(futures: nuno.World, knots: np.ndarray) -> None:
        go(futures, nuno.Knots(begin, knots, 1.0))

    def now(_: nuno.World) -> np.ndarray:
        instants.append(time.perf_counter())
        return begin

    def cost(futures: nuno.World) -> np.ndarray:
        instants.append(time.perf_counter())
        return np.linalg.norm(futures.find("cloth").vertices[:, far].reshape(-1, 6) - goal, axis=1)

    up = np.tile((0.0, 0.0, 0.4 * side), 2)
    start = np.stack([begin + 0.3 * (goal - begin) + up, begin + 0.7 * (goal - begin) + up, goal + 0.02 * up])
    took, cpu, parts = [], [], []
    for k in range(plans + 1):
        clock, core = time.perf_counter(), time.process_time()
        instants[:] = [clock]
        nuno.plan(
            world, act, cost, start=start, spread=0.05 * side, horizon=1.0, samples=rollouts, iterations=1, seed=k,
            bounds=(-1.0, 1.0), thorough=thorough,
        )  # fmt: skip
        parts.append(np.diff([*instants, time.perf_counter()]))
        took.append(time.perf_counter() - clock)
        cpu.append(time.process_time() - core)
    best = float(np.median(took[1:]))
    instants.clear()
    found = nuno.replan(
        world, go, cost, now=now, start=start, spread=0.05 * side, horizon=1.0, every=1.0 / 60.0, periods=plans + 1,
        execute=lambda *_: None, samples=rollouts, iterations=1, bounds=(-1.0, 1.0), thorough=thorough,
    )  # fmt: skip
    again = found.planning_seconds
    parts_again = np.diff(np.reshape(instants, (-1, 4)), axis=1)
    parts_again = np.column_stack([parts_again, again - parts_again.sum(axis=1)])
    middle = float(np.median(again[1:]))
    return {
        "replan_s": middle, "replans_per_s": 1.0 / middle, "first_replan_s": float(again[0]),
        "replan_parts_s": np.median(parts_again[1:], axis=0).tolist(),
        "rollouts": rollouts, "device": wp.get_device(device).name, "side": side,
        "substeps": cloth.resolution.substeps, "first_s": took[0], "plan_s": best, "rollouts_per_s": rollouts / best,
        "plans_per_s": 1.0 / best, "cpu_s": float(np.median(cpu[1:])), "thorough": thorough,
        "parts_s": np.median(parts[1:], axis=0).tolist(),
    }  # fmt: skip


def print_table(rows: list[dict[str, Any]]) -> None:
    """Print success rates by task."""
    print("| task | seeds | fixed plan | replanned | s of planning | simulated s imagined | cost imagined, true |")
    print("|---|---|---|---|---|---|---|")
    for name in TASKS:
        own = [row for row in rows if row["task"] == name]
        if own:
            solved = [sum(row[way]["solved"] for row in own) for way in ("fixed", "planned")]
            spent = [float(np.median([row.get(key, np.nan) for row in own])) for key in ("planning_s", "imagined_s")]
            imagined, true = (np.nanmedian([row.get(key, np.nan) for row in own]) for key in ("cost", "true_cost"))
            print(
                f"| {name} | {len(own)} | {solved[0]} | {solved[1]} | {spent[0]:.0f} | {spent[1]:.0f} | "
                f"{imagined:.3f}, {true:.3f} |"
            )


def print_rates(device: str, rollouts: list[int], asked: argparse.Namespace) -> None:
    """Measure and print rates, row by row."""
    rows = []
    print(f"{wp.get_device(device).name}, a sheet of {asked.side:g} m with 20 x 20 cells")
    print(
        "| rollouts of 1 s | substeps | first plan, s | a plan, s | of it: imagine, act, simulate, score, ms | CPU s | "
        "rollouts a second | plans a second | replanning, s | of it: set back, act, simulate, score, ms | a second |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for count in rollouts:
        row = measure_rate(count, device, asked.plans, asked.side, asked.thorough)
        rows.append(row)
        print(
            f"| {count:,} | {row['substeps']} | {row['first_s']:.2f} | {row['plan_s']:.4f} | "
            f"{', '.join(f'{1000.0 * part:.1f}' for part in row['parts_s'])} | {row['cpu_s']:.2f} | "
            f"{row['rollouts_per_s']:,.1f} | {row['plans_per_s']:.2f} | {row['replan_s']:.4f} | "
            f"{', '.join(f'{1000.0 * part:.1f}' for part in row['replan_parts_s'])} | {row['replans_per_s']:.2f} |",
            flush=True,
        )  # fmt: skip
        if asked.json:
            asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--tasks", nargs="+", help="all of these hands' when left out")
    options.add_argument("--hands", default="points", choices=("points", "talos", "dynamic"))
    options.add_argument("--samples", type=int, help="futures of an iteration; 24, 12 of the pull, 6 of dynamic hands")
    options.add_argument("--rough", action="store_true", help="arms: imagine fast frames once")
    options.add_argument("--seeds", nargs=2, type=int, default=(0, 20), metavar=("FIRST", "END"))
    options.add_argument("--device", default="cpu")
    options.add_argument("--json", type=FilePath)
    options.add_argument("--rate", action="store_true", help="measure rollouts a second instead")
    options.add_argument("--rollouts", nargs="+", type=int)
    options.add_argument("--plans", type=int, default=5, help="timed plans of a row of --rate")
    options.add_argument("--thorough", action="store_true", help="--rate: imagine with doubles, fast frames twice")
    options.add_argument("--side", type=float, default=0.6, help="of the sheet of --rate [m]")
    asked = options.parse_args()
    logging.getLogger("nuno").setLevel(logging.ERROR)
    device = str(wp.get_device(asked.device))
    rows: list[dict[str, Any]] = []
    if asked.rate:
        print_rates(device, asked.rollouts or ([64] if device == "cpu" else [512, 64, 2048]), asked)
        return
    if asked.json and asked.json.exists():
        rows = json.loads(asked.json.read_text(encoding="utf-8"))
    tasks = TASKS
    if asked.hands != "points":
        from arm_tasks import ARM_TASKS, DYNAMIC_TASKS  # which need a robot's model

        tasks = ARM_TASKS if asked.hands == "talos" else DYNAMIC_TASKS
    names = asked.tasks or list(tasks)
    if unknown := set(names) - set(tasks):
        options.error(f"--tasks must be among {list(tasks)} with these hands, got {sorted(unknown)}")
    thorough = asked.hands != "points" and not asked.rough
    done = {(row["task"], row["seed"]) for row in rows}
    # seed by seed, so that a run that is cut short has as many of each task
    wanted = [(name, seed) for seed in range(*asked.seeds) for name in names if (name, seed) not in done]
    for name, seed in tqdm(wanted, unit="trial"):
        rows.append(trial(name, seed, device, tasks, thorough, asked.samples))
        if asked.json:
            asked.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print_table(rows)


if __name__ == "__main__":
    main()
