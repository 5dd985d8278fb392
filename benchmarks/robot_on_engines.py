"""A robot with dynamics on Nuno's engine and on MuJoCo's, by a word: ``python benchmarks/robot_on_engines.py``.

- step: the links of Talos without weight, seven joints sent elsewhere by motors with the same gains for 1 s, friction
  and damping as of its URDF: how far the joints are apart, of their ranges.
- stand: it stands on a floor under its balance, and bends an elbow: what its soles bear, where joints end, CPU time.
- walk: it walks 0.2 m: where it ends.

CPU seconds are this program's, a simulated second; of step by turns in one process, else one after the other.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from robot_against_mujoco import RATE, RATIO, WAYS, fixed_or_free

import nuno
from nuno.robot.link_dynamics import LinkDynamics

ENGINES = ("nuno", "mujoco")


def driven(engine: str, afloat: bool, substeps: int) -> tuple[nuno.World, LinkDynamics]:
    """Return a world and the links in it, whose motors are told where to go."""
    robot = fixed_or_free(afloat)
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0), substeps=substeps, engine=engine)
    dynamics = LinkDynamics(robot.enter(world, "joints"))
    n = len(robot.joint_names)
    dynamics.efforts = np.full(n, 1e4)  # no limit is met
    dynamics.attach()
    wanted = robot.angle_vector()
    for name, way in WAYS.items():
        wanted[robot.joint_index(name)] += way
    inertia = np.array(pin.crba(robot.model, robot.model.createData(), robot.configuration())).diagonal()[6:]
    dynamics.drive(wanted, np.zeros(n), RATE**2 * inertia, 2.0 * RATIO * RATE * inertia, np.zeros(n))
    return world, dynamics


def step(afloat: bool, substeps: int, seconds: float = 1.0) -> dict[str, Any]:
    """Return how far the joints of both are apart."""
    both = {engine: driven(engine, afloat, substeps) for engine in ENGINES}
    angles: dict[str, list[np.ndarray]] = {engine: [] for engine in ENGINES}
    spent = dict.fromkeys(ENGINES, 0.0)
    for frame in range(round(60 * seconds)):
        for engine, (world, dynamics) in both.items():
            now = time.process_time()
            world.step()
            spent[engine] += time.process_time() - now if frame else 0.0
            angles[engine].append(dynamics.robot.angles_of(dynamics.read()[0][0]))
    lower, upper = both["nuno"][1].robot.joint_limits
    apart = np.abs(np.subtract(*(np.array(angles[engine]) for engine in ENGINES)))
    return {
        "base": "afloat" if afloat else "fixed", "substep_ms": 1e3 / 60.0 / substeps, "apart_rad": float(apart.max()),
        "apart_of_range": float((apart / (upper - lower)).max()),
        **{f"{engine}_cpu": spent[engine] / seconds for engine in ENGINES},
    }  # fmt: skip


def stand(engine: str) -> dict[str, Any]:
    """Return how Talos stands and bends an elbow, and how it walks."""
    world = nuno.World(device="cpu", engine=engine)
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    world.run(0.5)
    now = time.process_time()
    world.run(1.0)
    cpu = time.process_time() - now
    state = robot.state()
    borne = sum(force[2] for link in state.contacts.values() for force in link.values())
    angles = robot.angle_vector()
    angles[robot.actual.joint_index("arm_left_4_joint")] -= 0.5
    robot.angle_vector(angles, 1.0)
    world.run(1.5)
    after = robot.state()
    off = float(np.abs(robot.actual.angles_of(after.q) - angles).max())
    x = float(after.q[0])
    robot.go_pos(0.2, 0.0, 0.0)
    world.run(1.0)
    end = robot.state()
    return {
        "engine": engine, "cpu": cpu, "borne_N": float(borne), "speed": float(np.abs(state.v).max()), "off_rad": off,
        "walked_m": float(end.q[0]) - x, "sideways_m": float(end.q[1]), "fallen": end.fallen,
    }  # fmt: skip


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    print("| base | substep [ms] | joints apart [rad] | of their ranges | CPU s/s nuno | mujoco |")
    print("|---|---|---|---|---|---|")
    steps = []
    for afloat in (False, True):
        for substeps in (8, 20):
            row = step(afloat, substeps)
            steps.append(row)
            print(f"| {row['base']} | {row['substep_ms']:.2f} | {row['apart_rad']:.4f} | {row['apart_of_range']:.2%} | "
                  f"{row['nuno_cpu']:.2f} | {row['mujoco_cpu']:.2f} |", flush=True)  # fmt: skip
    print("\n| engine | soles bear [N] | fastest [rad/s; m/s] | joints off [rad] | walked of 0.2 m | CPU s/s |")
    print("|---|---|---|---|---|---|")
    stands = []
    for engine in ENGINES:
        row = stand(engine)
        stands.append(row)
        fell = "" if row["fallen"] is None else ", fell"
        print(f"| {engine} | {row['borne_N']:.1f} | {row['speed']:.1e} | {row['off_rad']:.4f} | "
              f"{row['walked_m']:.4f}{fell} | {row['cpu']:.2f} |", flush=True)  # fmt: skip
    if given.json:
        given.json.write_text(json.dumps({"step": steps, "stand": stands}, indent=1))


if __name__ == "__main__":
    main()
