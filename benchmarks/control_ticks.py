"""Control ticks of Talos without dynamics, this version's and another's, in processes by turns.

    python benchmarks/control_ticks.py OTHER [--ticks 300] [--rounds 9] [--scenes rest arm ...] [--json FILE]

OTHER is the src folder of another checkout (git worktree add ../other COMMIT). A tick is what the world asks of the
robot in a frame (``begin_frame`` and ``end_frame``), without the frame, in processor time. Of each process the median
and the mean of its ticks are taken: every thirtieth tick looks at torques and balance, which only the mean has. Nobody
reads the robot's state or sensors. Of the processes their medians and their least, and the medians of ratios by turns.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tqdm import tqdm

HERE = Path(__file__).resolve().parents[1] / "src"
FRAME = 1.0 / 60.0
ARM = {"arm_left_1_joint": 0.5, "arm_left_2_joint": 0.4, "arm_left_4_joint": -1.2}


def rest(robot: Any, seconds: float) -> None:
    """Talos stands still."""


def arm(robot: Any, seconds: float) -> None:
    """An arm is under way."""
    robot.angle_vector(ARM, seconds)


def joints(robot: Any, seconds: float) -> None:
    """All joints are under way, those of the legs as well."""
    import numpy as np

    robot.angle_vector(np.clip(robot.angle_vector() + 0.3, *robot.robot.joint_limits), seconds)


def walk(robot: Any, seconds: float) -> None:
    """It walks."""
    robot.go_pos(1.0, wait=False)


def towel(robot: Any, seconds: float) -> None:
    """It stands still with a towel of 12 x 16 cells in the hand."""
    import nuno

    world, place = robot.world, robot.actual.frame_pose("left_hand").to_world([(0.0, 0.0, 0.03)])[0]
    cloth = world.add(nuno.sheet((0.3, 0.4), cells=(12, 16), position=(place[0] + 0.15, place[1] + 0.2, place[2])))
    world.attach(cloth, nuno.Cloth.preset("towel"))
    robot.hands["left_hand"].close()
    world.run(1.0, progress=False)


def towel_arm(robot: Any, seconds: float) -> None:
    """The arm with the towel is under way."""
    towel(robot, seconds)
    arm(robot, seconds)


SCENES: dict[str, Callable[[Any, float], None]] = {
    made.__name__: made for made in (rest, arm, joints, walk, towel, towel_arm)
}


def run_one(scene: str, ticks: int) -> None:
    """Print median and mean of the ticks of one scene [ms], with the version that is imported."""
    import nuno

    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    begin, end, spent = robot.begin_frame, robot.end_frame, [0.0]

    def begin_frame(start: float, finish: float) -> None:
        since = time.thread_time()
        begin(start, finish)
        spent.append(time.thread_time() - since)

    def end_frame() -> None:
        since = time.thread_time()
        end()
        spent[-1] += time.thread_time() - since

    robot.begin_frame, robot.end_frame = begin_frame, end_frame  # type: ignore[method-assign]
    SCENES[scene](robot, (ticks + 60) * FRAME)
    for _ in range(30):  # what the first frames make, and the first look
        world.step()
    del spent[:]
    for _ in range(ticks):
        world.step()
    assert len(spent) == ticks
    print("ticks", json.dumps([1000.0 * statistics.median(spent), 1000.0 * statistics.fmean(spent)]))


def main() -> None:
    """Run every scene with both versions by turns, and print the medians of a tick."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--ticks", type=int, default=300, help="a walk takes some 400")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        run_one(options.scenes[0], options.ticks)
        return
    if not (options.other / "nuno").is_dir():
        sys.exit(f"no package nuno in {options.other}: give the src folder of another checkout")
    found: dict[str, dict[str, list[list[float]]]] = {scene: {"before": [], "now": []} for scene in options.scenes}
    for _, scene in tqdm([(k, scene) for k in range(options.rounds) for scene in options.scenes]):
        for name, source in (("before", options.other), ("now", HERE)):
            command = [sys.executable, __file__, str(options.other), "--one", "--scenes", scene]
            done = subprocess.run(
                [*command, "--ticks", str(options.ticks)], capture_output=True, text=True,
                env=os.environ | {"PYTHONPATH": str(source.resolve())},
            )  # fmt: skip
            if done.returncode:
                sys.exit(f"{scene} with {source} failed:\n{done.stderr}")
            found[scene][name].append(json.loads(done.stdout.split("ticks")[-1]))
    print("| tick, ms | median before | now | ratio | least before | now | mean before | now | ratio |")
    print("|---|---|---|---|---|---|---|---|---|")
    for scene, own in found.items():
        (a, means_a), (b, means_b) = (tuple(zip(*own[name], strict=True)) for name in ("before", "now"))
        middle = [statistics.median(row) for row in (a, b, means_a, means_b)]
        ratio, ratio_of_means = (
            statistics.median(y / x for x, y in zip(*pair, strict=True)) for pair in ((a, b), (means_a, means_b))
        )
        print(
            f"| {scene} | {middle[0]:.4f} | {middle[1]:.4f} | {ratio:.2f} | {min(a):.4f} | "
            f"{min(b):.4f} | {middle[2]:.4f} | {middle[3]:.4f} | {ratio_of_means:.2f} |"
        )
    if options.json:
        options.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
