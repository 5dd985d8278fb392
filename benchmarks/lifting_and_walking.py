"""Talos lifts 5 kg, and walks, in Nuno, MuJoCo and Pinocchio; for `robot_against_mujoco.py`."""

from __future__ import annotations

import re
import statistics
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np
import pinocchio as pin
from robot_in_mujoco import MujocoRobot
from robot_in_pinocchio import PinocchioRobot
from standing_talos import InEngine, InNuno

import nuno
from nuno.robot.robot_state import RobotState

LOAD = 2.5
"""[kg] In each hand."""
BENDS = -0.3
"""[rad] By which elbows bend."""
GROUPS = {"hips and knees": "leg_.*_[1234]_", "ankles": "leg_.*_[56]_", "trunk and head": "torso|head", "arms": "arm"}


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
    pair: dict[str, Any] = {"nuno": InNuno(LOAD), "mujoco": InEngine(on_floor, LOAD),
                            "pinocchio": InEngine(PinocchioRobot, LOAD)}  # fmt: skip
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
    found: dict[str, Any] = {}
    print("| | angles from MuJoCo's, of a range | legs' torques from MuJoCo's [N m] | lifted [m] "
          "| wander of a load [mm/s] | torques off statics | CPU s/s | control besides | fallen |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|")
    for name, own in pair.items():
        last, place = states[name][-1], np.array(places[name])
        wanted = statics(model, last.q, LOAD, places_in)
        pairs = zip(states[name], states["mujoco"], strict=True)
        apart = np.abs([model.angles_of(a.q) - model.angles_of(b.q) for a, b in pairs]) / (upper - lower)
        row = {
            "apart_of_range": float(apart.max()),
            "legs_apart": rms(last.torques[legs] - states["mujoco"][-1].torques[legs]),
            "lifted": float(place[-1, 2] - place[17, 2]),
            "wander": 1000.0 * float(np.linalg.norm(np.diff(place[-60:], axis=0), axis=1).sum()),
            "off": float(np.abs(last.torques - wanted)[arms].max() / np.abs(wanted[arms]).max()),
            "cpu": 60.0 * statistics.median(own.spent), "control": 60.0 * statistics.median(own.control),
            "fallen": last.fallen,
        }  # fmt: skip
        found[name] = row
        print(f"| {name} | {row['apart_of_range']:.2%} | {row['legs_apart']:.2f} | {row['lifted']:.3f} | "
              f"{row['wander']:.2f} | {row['off']:.2%} | {row['cpu']:.2f} | {row['control']:.2f} | {row['fallen']} |",
              flush=True)  # fmt: skip
    found["bits"] = bits()
    return found


def bits() -> dict[str, bool]:
    """Return whether worlds of a batch have the bits of one alone: Nuno's imagined ones, MuJoCo's on two threads."""
    own = InNuno(LOAD)
    for frame in range(30):
        if frame == 18:
            bends(own.driver)
        own.step()
    futures = own.world.imagine(3)
    futures.run(0.3)
    own.world.run(0.3)
    alone = own.now
    same = all((state.q == alone.q).all() and (state.v == alone.v).all() for state in futures.robot.state())
    body = InEngine(on_floor, LOAD).body
    body.drive(body.angles(), *np.tile([[0.0], [500.0], [20.0], [0.0]], len(body.angles())))
    size = mujoco.mj_stateSize(body.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    start = np.zeros(size)
    mujoco.mj_getState(body.model, body.data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    threads = [mujoco.MjData(body.model) for _ in range(2)]
    found, _ = mujoco.rollout.rollout(body.model, threads, np.tile(start, (4, 1)), nstep=180)
    body.advance(180)
    end = np.zeros(size)
    mujoco.mj_getState(body.model, body.data, end, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    told = {"nuno": bool(same), "mujoco": bool((found[:, -1] == end).all())}
    print(f"worlds of a batch have the bits of one alone: {told}")
    return told


def walk() -> dict[str, Any]:
    """Run and print the joint torques of a walk in both."""
    pair: dict[str, Any] = {"nuno": InNuno(0.0), "mujoco": InEngine(on_floor, 0.0),
                            "pinocchio": InEngine(PinocchioRobot, 0.0)}  # fmt: skip
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
    print("| joints | torque [N m] | from MuJoCo's | means of 0.1 s | Pinocchio's from MuJoCo's | means of 0.1 s |")
    print("|---|---|---|---|---|---|")
    for group, pattern in GROUPS.items():
        rows = [k for k, name in enumerate(model.joint_names) if re.match(pattern, name)]
        row = {"torque": rms(torques["mujoco"][:, rows])}
        for name in ("nuno", "pinocchio"):
            off = (torques[name] - torques["mujoco"])[:, rows]
            row[name] = rms(off)
            row[f"{name}_slow"] = rms(off[: len(off) // 6 * 6].reshape(-1, 6, len(rows)).mean(axis=1))
        found[group] = row
        print("| " + " | ".join([group, *(f"{value:.2f}" for value in row.values())]) + " |", flush=True)
    return found


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
