"""Robots with dynamics against MuJoCo: ``python benchmarks/robot_against_mujoco.py [step lift walk] [--json FILE]``.

Talos, the same URDF in both, on the CPU; MuJoCo is ``pip install mujoco``.

- step: several joints are sent elsewhere by motors with the same gains, base fixed and afloat. Joint angles over 2 s.
- lift: it stands on a floor with 2.5 kg in each hand and bends both elbows. The same balance commands both.
- walk: it walks 0.3 m on a floor. Joint torques of both, the same balance again.

CPU seconds are processor time of this program a simulated second, in turns.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from robot_in_mujoco import MujocoRobot
from standing_talos import FRAME, InEngine, InNuno

import nuno
from nuno.robot.link_dynamics import LinkDynamics
from nuno.robot.robot_state import RobotState

WAYS = {
    "arm_left_2_joint": 0.4, "arm_left_6_joint": 0.3, "arm_right_4_joint": -0.5, "torso_1_joint": 0.3,
    "head_1_joint": -0.2, "leg_left_4_joint": 0.4, "leg_right_3_joint": -0.3,
}  # fmt: skip
"""[rad] How far joints are sent."""
RATE, RATIO = 20.0, 0.7
"""[rad/s] Of the motors' oscillation with the joint's own inertia, and its damping ratio."""
LOAD = 2.5
"""[kg] In each hand."""
BENDS = -0.3
"""[rad] By which elbows bend."""
GROUPS = {"hips and knees": "leg_.*_[1234]_", "ankles": "leg_.*_[56]_", "trunk and head": "torso|head", "arms": "arm"}


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
    afloat: bool, substeps: int, friction: str, *, seconds: float = 2.0, gravity: Any = (0.0, 0.0, 0.0)
) -> dict[str, Any]:
    """Return how far joints of both are from each other, over the joints' ranges, and what a simulated second costs."""
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
    theirs = MujocoRobot(robot, FRAME / substeps, gravity, afloat=afloat, friction=friction)
    dynamics.drive(*command)
    theirs.drive(*command)
    angles: dict[str, list[np.ndarray]] = {"nuno": [], "mujoco": []}
    spent: dict[str, list[float]] = {"nuno": [], "mujoco": []}
    for _ in range(round(seconds * 60)):
        begun = time.process_time()
        world.step()
        middle = time.process_time()
        theirs.advance(substeps)
        spent["mujoco"].append(time.process_time() - middle)
        spent["nuno"].append(middle - begun)
        angles["nuno"].append(robot.angles_of(dynamics.read()[0][0]))
        angles["mujoco"].append(theirs.angles())
    lower, upper = robot.joint_limits
    apart = np.abs(np.array(angles["nuno"]) - np.array(angles["mujoco"]))
    share = (apart / (upper - lower)).max(axis=0)
    far = np.abs(np.array(angles["mujoco"]) - start).max()
    return {
        "base": "afloat" if afloat else "fixed", "friction": friction, "substeps": substeps,
        "apart_rad": float(apart.max()), "apart_of_range": float(share.max()),
        "joint": robot.joint_names[int(share.argmax())], "way_rad": float(far),
        **{f"{name}_cpu": 60.0 * statistics.median(own) for name, own in spent.items()},
    }  # fmt: skip


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", default=["step", "lift", "walk"])
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    found: dict[str, Any] = {}
    if "step" in given.parts:
        found["step"] = steps()
    if "lift" in given.parts:
        found["lift"] = lift()
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


def bends(driver: nuno.SimulatedRobot) -> None:
    """Send both elbows up, in 1.5 s."""
    angles = driver.robot.angle_vector()
    elbows = [f"arm_{side}_4_joint" for side in ("left", "right")]
    driver.angle_vector({name: angles[driver.robot.joint_index(name)] + BENDS for name in elbows}, 1.5)


def on_floor(robot: nuno.Humanoid, step: float, loads: Any) -> MujocoRobot:
    """Return a robot in MuJoCo on a floor."""
    return MujocoRobot(robot, step, floor=True, loads=loads)


def statics(model: nuno.Humanoid, q: np.ndarray, load: float, places: Any) -> np.ndarray:
    """Return the joint torques (n,) by which gravity and what the hands hold are borne, but for the feet."""
    data = model.model.createData()
    found = pin.computeGeneralizedGravity(model.model, data, q).copy()
    pin.computeJointJacobians(model.model, data, q)
    pin.updateFramePlacements(model.model, data)
    for link, place in places.items():
        frame = model.frame_index(link)
        jacobian = pin.getFrameJacobian(model.model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        weight = np.array((0.0, 0.0, -9.81 * load))
        found -= jacobian.T @ [*weight, *np.cross(data.oMf[frame].rotation @ place, weight)]
    return found[6:]


def lift() -> dict[str, Any]:
    """Run and print how Talos lifts 5 kg in both."""
    pair: dict[str, Any] = {"nuno": InNuno(LOAD), "mujoco": InEngine(on_floor, LOAD)}
    model, places_in = pair["mujoco"].model, pair["mujoco"].places
    states: dict[str, list[RobotState]] = {name: [] for name in pair}
    places: dict[str, list[np.ndarray]] = {name: [] for name in pair}
    for frame in range(300):
        for name, own in pair.items():
            if frame == 18:
                bends(own.driver)
            own.step()
            states[name].append(own.now)
            places[name].append(own.load_place())
    arms = [k for k, name in enumerate(model.joint_names) if not name.startswith("leg")]
    legs = [k for k, name in enumerate(model.joint_names) if name.startswith("leg")]
    lower, upper = model.joint_limits
    apart = np.abs([model.angles_of(a.q) - model.angles_of(b.q) for a, b in zip(*states.values(), strict=True)])
    found: dict[str, Any] = {
        "apart_of_range": float((apart / (upper - lower)).max()),
        "joint": model.joint_names[int((apart / (upper - lower)).max(axis=0).argmax())],
        "legs_apart": float(rms(states["nuno"][-1].torques[legs] - states["mujoco"][-1].torques[legs])),
        "legs": float(rms(states["mujoco"][-1].torques[legs])),
    }
    print(f"angles apart: {found['apart_of_range']:.2%} of a range ({found['joint']}); legs' torques at rest: "
          f"{found['legs_apart']:.2f} N m of {found['legs']:.1f} (root mean squares)")  # fmt: skip
    print("| | lifted [m] | wander of a load [mm/s] | torques off statics | CPU s/s | of control | fallen |")
    print("|---|---|---|---|---|---|---|")
    for name, own in pair.items():
        last, place = states[name][-1], np.array(places[name])
        wanted = statics(model, last.q, LOAD, places_in)
        row = {
            "lifted": float(place[-1, 2] - place[17, 2]),
            "wander": 1000.0 * float(np.linalg.norm(np.diff(place[-60:], axis=0), axis=1).sum()),
            "off": float(np.abs(last.torques - wanted)[arms].max() / np.abs(wanted[arms]).max()),
            "cpu": 60.0 * statistics.median(own.spent), "control": 60.0 * statistics.median(own.control),
            "fallen": last.fallen,
        }  # fmt: skip
        found[name] = row
        print(f"| {name} | {row['lifted']:.3f} | {row['wander']:.2f} | {row['off']:.2%} | {row['cpu']:.2f} | "
              f"{row['control']:.2f} | {row['fallen']} |", flush=True)  # fmt: skip
    return found


def walk() -> dict[str, Any]:
    """Run and print the joint torques of a walk in both."""
    pair: dict[str, Any] = {"nuno": InNuno(0.0), "mujoco": InEngine(on_floor, 0.0)}
    model = pair["mujoco"].model
    states: dict[str, list[RobotState]] = {name: [] for name in pair}
    for frame in range(1000):
        for name, own in pair.items():
            if frame == 18:
                own.driver.go_pos(0.3, 0.0, 0.0, wait=False)
            own.step()
            states[name].append(own.now)
        if frame > 30 and not any(own.driver.gait.is_walking for own in pair.values()):
            break
    torques = {name: np.array([state.torques for state in own[18:]]) for name, own in states.items()}
    found: dict[str, Any] = {"seconds": len(torques["nuno"]) / 60.0}
    for name, own in states.items():
        found[name] = {"way": float(own[-1].q[0] - own[17].q[0]), "fallen": own[-1].fallen}
        print(f"{name}: {found[name]['way']:.3f} m in {found['seconds']:.1f} s, fallen: {found[name]['fallen']}")
    print("| joints | torque [N m] | apart [N m] | means of 0.1 s apart [N m] |")
    print("|---|---|---|---|")
    for group, pattern in GROUPS.items():
        rows = [k for k, name in enumerate(model.joint_names) if re.match(pattern, name)]
        off = (torques["nuno"] - torques["mujoco"])[:, rows]
        whole = len(off) // 6 * 6
        slow = off[:whole].reshape(-1, 6, len(rows)).mean(axis=1)
        row = {"torque": rms(torques["mujoco"][:, rows]), "apart": rms(off), "slow_apart": rms(slow)}
        found[group] = row
        print(f"| {group} | {row['torque']:.2f} | {row['apart']:.2f} | {row['slow_apart']:.2f} |", flush=True)
    return found


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    main()
