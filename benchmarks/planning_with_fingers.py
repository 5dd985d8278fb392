"""A plan for a towel that fingers hold by friction: ``python benchmarks/planning_with_fingers.py [--samples 6]``.

Talos with weight closes its left hand on the edge of a towel of 0.2 m that hangs between the tips, and nothing grips
it from then on. ``nuno.plan`` finds two angles of that arm which bring the towel's lowest point 0.19 m ahead and up in
1 s: in every future the fingers press on the towel, as in the world. Prints what the plan cost in imagination and as
carried out, what the towel slid in the hand, and CPU seconds.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
from pathlib import Path
from typing import Any

import numpy as np

import nuno
from nuno.robot.placement import quaternion_of

JOINTS = ("arm_left_2_joint", "arm_left_4_joint")
SIZE, CELLS = 0.2, 10
INSIDE = 0.015  # [m] of the towel that is above the middle of the tips
TIPS = (0.0, 0.0, 0.008)  # [m] in the hand's frame
AWAY = (0.15, 0.0, 0.12)  # [m] of the goal
SECONDS, REST = 1.0, 0.3


def begin() -> tuple[nuno.SimulatedRobot, nuno.Body]:
    """Talos with a towel's edge in its left hand, held by friction alone."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    robot.start_grasp("larm")
    robot.stop_grasp("larm")
    pose = robot.actual.frame_pose("left_hand")
    closing = pose.rotation[:, 1]
    down = np.array((0.0, 0.0, -1.0)) + closing * closing[2]
    down /= np.linalg.norm(down)
    side = np.cross(down, closing)
    axes = np.stack([side, down, np.cross(side, down)], axis=1)
    tips = pose.to_world([TIPS])[0]
    towel = world.add(
        nuno.sheet(
            (SIZE, SIZE), (CELLS, CELLS), name="towel", position=tips + down * (0.5 * SIZE - INSIDE),
            quaternion=quaternion_of(axes),
        )
    )  # fmt: skip
    world.attach(towel, nuno.Cloth.preset("towel"))
    low, high = robot.hands["left_hand"].volume()
    local = pose.to_local(towel.vertices)
    between = np.flatnonzero(((local >= low) & (local <= high)).all(axis=1))
    kept = world.grip(towel, between, to=towel.vertices[between].mean(axis=0))
    if robot.start_grasp("larm") != [True]:
        raise RuntimeError("the fingers hold nothing")
    kept.release()
    robot.sleep(0.3)
    return robot, towel


def held_vertex(robot: nuno.SimulatedRobot, towel: nuno.Body) -> int:
    """The vertex that is nearest to the middle of the tips."""
    local = robot.actual.frame_pose("left_hand").to_local(towel.vertices)
    return int(np.linalg.norm(local - TIPS, axis=1).argmin())


def measure(samples: int) -> dict[str, Any]:
    """Plan, carry the plan out, and tell what came of both."""
    start = time.process_time()
    robot, towel = begin()
    world, now = robot.world, dict(zip(robot.actual.joint_names, robot.angle_vector(), strict=True))
    low, held = int(towel.vertices[:, 2].argmin()), held_vertex(robot, towel)
    goal = towel.vertices[low] + AWAY

    def in_hand() -> np.ndarray:
        return robot.actual.frame_pose("left_hand").to_local(towel.vertices[[held]])[0]

    def act(futures: nuno.World, knots: np.ndarray) -> None:
        futures.robot.angle_vector({name: now[name] + knots[:, 0, k] for k, name in enumerate(JOINTS)}, SECONDS)

    def cost(futures: nuno.World) -> np.ndarray:
        return np.linalg.norm(futures.find("towel").vertices[:, low] - goal, axis=1)

    before, prepared = in_hand(), time.process_time()
    plan = nuno.plan(
        world, act, cost, start=[[0.1, -0.4]], spread=0.2, horizon=SECONDS + REST, samples=samples, iterations=2, seed=1
    )
    planned = time.process_time()
    robot.angle_vector({name: float(now[name] + plan.knots[0, k]) for k, name in enumerate(JOINTS)}, SECONDS)
    world.run(SECONDS + REST)
    return {
        "samples": samples, "first_m": float(plan.history[0]), "imagined_m": plan.cost,
        "carried_out_m": float(np.linalg.norm(towel.vertices[low] - goal)),
        "slid_m": np.abs(in_hand() - before).tolist(), "held": [body.name for body in robot.hands["left_hand"].held],
        "fallen": robot.state().fallen, "cpu_s_to_hold": prepared - start, "cpu_s_of_plan": planned - prepared,
    }  # fmt: skip


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--samples", type=int, default=6)
    options.add_argument("--json", type=Path)
    asked = options.parse_args()
    logging.getLogger("nuno").setLevel(logging.ERROR)
    row = measure(asked.samples)
    for name, value in row.items():
        print(f"{name}: {value}")
    if asked.json:
        asked.json.write_text(json.dumps(row, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
