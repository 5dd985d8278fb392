"""How well and how fast walks are planned: ``python benchmarks/walk.py``; prints a table."""

from __future__ import annotations

import statistics
import time

import nuno
from nuno.robot.stride import Stride
from nuno.robot.walking import plan_walk

GOALS = {
    "straight, 4 steps": (None, 0, 0), "aside 0.3 m": (0, 0.3, 0), "turn by 90 deg": (0, 0, 1.571),
    "1 m, 0.3 m aside, 0.8 rad": (1.0, 0.3, 0.8), "back 0.3 m": (-0.3, 0, 0),
}  # fmt: skip
REPEATS = 3


def main() -> None:
    """Plan each walk of each robot some times."""
    print("| robot, walk | steps | margin [mm] | rms x, y [mm] | drift [mm] | velocity | torque | friction | seconds |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in ("talos", "g1"):
        robot = nuno.Humanoid(name)
        robot.self_collisions()  # reads the meshes
        for what, (x, y, yaw) in GOALS.items():
            # three steps and the one that closes
            ahead = 3 * Stride.of(robot).step_length if x is None else x
            walls = []
            for _ in range(REPEATS):
                start = time.perf_counter()
                walk = plan_walk(robot, ahead, y, yaw)
                walls.append(time.perf_counter() - start)
            own = walk.measures
            rms = ", ".join(f"{1000 * part:.1f}" for part in own.zmp_rms)
            print(f"| {name}, {what} | {len(walk.footsteps)} | {1000 * own.margin:.1f} | {rms} | "
                  f"{1000 * own.drift:.0e} | {own.velocity_share:.0%} | {own.torque_share:.0%} | {own.friction:.2f} | "
                  f"{statistics.median(walls):.2f} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
