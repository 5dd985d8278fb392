"""Robots with dynamics against MuJoCo: ``python benchmarks/robot_against_mujoco.py [step lift press walk]``.

Talos, the same URDF in both, on the CPU; MuJoCo is ``pip install mujoco``.

- step: several joints are sent elsewhere by motors with the same gains, base fixed and afloat. Joint angles over 2 s.
- lift: it stands on a floor with 2.5 kg in each hand and bends both elbows. The same balance commands both.
- press: with its base fixed, it presses a plate on a soft cube, which is Nuno's also where the arm is MuJoCo's.
- walk: it walks 0.3 m on a floor. Joint torques of both, the same balance again.

Lift and walk also run by Pinocchio's constraint solver. CPU seconds are processor time of this program a simulated
second, medians of frames that the engines take in turns; those of press of one run after the other.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from lifting_and_walking import lift, walk
from pressing_hand import press
from robot_in_mujoco import MujocoRobot
from standing_talos import FRAME

import nuno
from nuno.robot.link_dynamics import LinkDynamics

WAYS = {
    "arm_left_2_joint": 0.4, "arm_left_6_joint": 0.3, "arm_right_4_joint": -0.5, "torso_1_joint": 0.3,
    "head_1_joint": -0.2, "leg_left_4_joint": 0.4, "leg_right_3_joint": -0.3,
}  # fmt: skip
"""[rad] How far joints are sent."""
RATE, RATIO = 20.0, 0.7
"""[rad/s] Of the motors' oscillation with the joint's own inertia, and its damping ratio."""


def fixed_or_free(afloat: bool) -> nuno.Humanoid:
    """Return Talos with its grippers half open; with a base that stays where it is, it has no feet to its knowledge."""
    talos = nuno.Humanoid("talos")
    talos.angle_vector({"gripper_left_joint": -0.5, "gripper_right_joint": -0.5})
    if afloat:
        return talos
    own = nuno.Humanoid(talos.description.urdf)
    own.angle_vector(talos.angle_vector())
    return own


def step_response(
    afloat: bool, substeps: int, friction: str, *, seconds: float = 2.0, gravity: Any = (0.0, 0.0, 0.0), finer: int = 1
) -> dict[str, Any]:
    """Return how far joints of both are from each other, over the joints' ranges, and what a simulated second costs.

    MuJoCo takes steps that are ``finer`` times shorter: at 1.67 ms its own error is as large as the difference.
    """
    robot = fixed_or_free(afloat)
    world = nuno.World(device="cpu", gravity=gravity, substeps=substeps)
    dynamics = LinkDynamics(robot.enter(world, "joints"))
    n = len(robot.joint_names)
    if friction == "none":
        dynamics.joint_friction, dynamics.joint_damping = np.zeros(n), np.zeros(n)
    dynamics.efforts = np.full(n, 1e4)  # no limit is met
    dynamics.attach()
    start, wanted = robot.angle_vector(), robot.angle_vector()
    for name, way in WAYS.items():
        wanted[robot.joint_index(name)] += way
    inertia = np.array(pin.crba(robot.model, robot.model.createData(), robot.configuration())).diagonal()[6:]
    command = (wanted, np.zeros(n), RATE**2 * inertia, 2.0 * RATIO * RATE * inertia, np.zeros(n))
    theirs = MujocoRobot(robot, FRAME / (substeps * finer), gravity, afloat=afloat, friction=friction)
    dynamics.drive(*command)
    theirs.drive(*command)
    angles: dict[str, list[np.ndarray]] = {"nuno": [], "mujoco": []}
    spent: dict[str, list[float]] = {"nuno": [], "mujoco": []}
    for _ in range(round(seconds * 60)):
        begun = time.process_time()
        world.step()
        middle = time.process_time()
        theirs.advance(substeps * finer)
        spent["mujoco"].append(time.process_time() - middle)
        spent["nuno"].append(middle - begun)
        angles["nuno"].append(robot.angles_of(dynamics.read()[0][0]))
        angles["mujoco"].append(theirs.angles())
    lower, upper = robot.joint_limits
    apart = np.abs(np.array(angles["nuno"]) - np.array(angles["mujoco"]))
    share = (apart / (upper - lower)).max(axis=0)
    far = np.abs(np.array(angles["mujoco"]) - start).max()
    return {
        "base": "afloat" if afloat else "fixed", "friction": friction, "substeps": substeps, "finer": finer,
        "apart_rad": float(apart.max()), "apart_of_range": float(share.max()),
        "joint": robot.joint_names[int(share.argmax())], "way_rad": float(far),
        **{f"{name}_cpu": 60.0 * statistics.median(own) for name, own in spent.items()},
    }  # fmt: skip


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", default=["step", "lift", "press", "walk"])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, Any] = {}
    if "step" in given.parts:
        found["step"] = steps()
    if "lift" in given.parts:
        found["lift"] = lift()
    if "press" in given.parts:
        found["press"] = press()
    if "walk" in given.parts:
        found["walk"] = walk()
    if given.json:
        given.json.write_text(json.dumps(found, indent=1))


def steps() -> list[dict[str, Any]]:
    """Run and print all step responses."""
    print("| base | friction | step [ms] | apart, of range | joint | [rad] | CPU s/s Nuno | MuJoCo |")
    print("|---|---|---|---|---|---|---|---|")
    rows = []
    for afloat in (False, True):
        for friction in ("none", "hard", "soft"):
            for substeps in (10, 20, 40):
                row = step_response(afloat, substeps, friction)
                rows.append(row)
                print(f"| {row['base']} | {friction} | {1000 * FRAME / substeps:.2f} | {row['apart_of_range']:.2%} | "
                      f"{row['joint']} | {row['apart_rad']:.4f} of {row['way_rad']:.2f} | {row['nuno_cpu']:.2f} | "
                      f"{row['mujoco_cpu']:.2f} |", flush=True)  # fmt: skip
    return rows


if __name__ == "__main__":
    main()
