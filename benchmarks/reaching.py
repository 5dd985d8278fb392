"""How well robots reach: ``python benchmarks/reaching.py [--targets 60] [--robots talos g1] [--json FILE]``.

Random targets within reach, both hands at once, whole body, feet on the floor: arms drawn around the standing posture,
drawn again where links touch. Then a point that is out of reach, checks of self-collision, and forward kinematics with
the links' bodies. Each figure is a median of processor time.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import nuno

HANDS = ("left_hand", "right_hand")
DRAWN = 0.6
"""[rad] How far each arm joint is drawn from the standing posture."""
FAR = (3.0, 0.0, 1.0)
"""[m] A point that no arm gets to."""


def spent_by(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return the processor time of a call [s], and its result."""
    begin = time.thread_time()
    result = call()
    return time.thread_time() - begin, result


def median_ms(times: list[float]) -> float:
    """Return the median of times [s] in [ms]."""
    return round(1000.0 * statistics.median(times), 3)


def arm_joints(robot: nuno.Humanoid) -> list[int]:
    """Return the indices of the joints between hands and trunk: of those that move a hand, but not both."""
    start = robot.angle_vector()
    places = {hand: robot.frame_pose(hand).position for hand in HANDS}
    found = []
    for k in range(len(start)):
        angles = start.copy()
        angles[k] += 1e-3
        robot.angle_vector(np.clip(angles, *robot.joint_limits))
        moved = [np.linalg.norm(robot.frame_pose(hand).position - places[hand]) > 1e-7 for hand in HANDS]
        if sum(moved) == 1:
            found.append(k)
    robot.angle_vector(start)
    return found


def poses_in_reach(robot: nuno.Humanoid, count: int, seed: int) -> list[dict[str, Any]]:
    """Return poses of both hands in postures that are free of collisions."""
    start, arms = robot.angle_vector(), arm_joints(robot)
    low, high = (limit[arms] for limit in robot.joint_limits)
    random = np.random.default_rng(seed)
    wanted: list[dict[str, Any]] = []
    while len(wanted) < count:
        angles = start.copy()
        angles[arms] = np.clip(start[arms] + random.uniform(-DRAWN, DRAWN, len(arms)), low, high)
        robot.angle_vector(angles)
        if not robot.self_collisions():
            wanted.append({hand: robot.frame_pose(hand) for hand in HANDS})
    return wanted


def reach_all(robot: nuno.Humanoid, wanted: list[dict[str, Any]]) -> dict[str, Any]:
    """Reach for each target from the standing posture."""
    spent, reached, largest = [], 0, 0.0
    for goals in wanted:
        robot.stand()
        taken, result = spent_by(lambda goals=goals: robot.reach(goals))  # type: ignore[misc]
        spent.append(taken)
        reached += bool(result)
        largest = max([largest, *result.position_errors.values()]) if result else largest
    return {
        "targets": len(wanted), "reached": reached, "median_ms": median_ms(spent),
        "largest_error_mm": round(1000.0 * largest, 3),
    }  # fmt: skip


def reaching(name: str, targets: int, seed: int = 1) -> dict[str, Any]:
    """Return the report of one robot."""
    robot = nuno.Humanoid(name)
    robot.self_collisions()  # reads the meshes
    poses = poses_in_reach(robot, targets, seed)
    points = [
        {hand: pose.position for hand, pose in goals.items()} for goals in poses_in_reach(robot, targets, seed + 1)
    ]
    report: dict[str, Any] = {"poses": reach_all(robot, poses), "points": reach_all(robot, points)}
    robot.stand()
    taken, result = spent_by(lambda: robot.reach({"left_hand": np.array(FAR)}))
    assert not result, result
    report["out_of_reach_ms"] = round(1000.0 * taken, 1)
    report["self_collisions_ms"] = median_ms([spent_by(robot.self_collisions)[0] for _ in range(30)])
    world = nuno.World(device="cpu")
    links = robot.enter(world)
    report["follow_ms"] = median_ms([spent_by(lambda: links.follow(1.0 / 60.0))[0] for _ in range(100)])
    return report


def main() -> None:
    """Measure each robot, print a table, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--targets", type=int, default=60)
    parser.add_argument("--robots", nargs="+", default=["talos", "g1"])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report = {name: reaching(name, options.targets) for name in options.robots}
    print(f"{'':<48}" + "".join(f"{name:>28}" for name in report))
    for what in ("poses", "points"):
        cells = [f"{r[what]['reached']} of {r[what]['targets']}, {r[what]['median_ms']} ms" for r in report.values()]
        print(f"{'two hands, random ' + what + ' in reach':<48}" + "".join(f"{cell:>28}" for cell in cells))
        cells = [str(r[what]["largest_error_mm"]) for r in report.values()]
        print(f"{'  largest distance from the target [mm]':<48}" + "".join(f"{cell:>28}" for cell in cells))
    for key in ("out_of_reach_ms", "self_collisions_ms", "follow_ms"):
        print(f"{key:<48}" + "".join(f"{r[key]:>28}" for r in report.values()))
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
