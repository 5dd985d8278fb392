"""What a simulated robot costs, against its goals: ``python benchmarks/robot.py [--repeats 300] [--json FILE]``.

Talos on the CPU, each figure a median of processor time (of the wall clock on the wire): a control tick, all sensors at
a tick, a robot beside a cloth (frames with and without it in turns), reaching, and round trips on the wire. The peers,
where they are installed, have the same URDFs, whose meshes are left out: scikit-robot for forward and inverse
kinematics, mujoco for forward kinematics, inverse dynamics and a step of its own dynamics, which Nuno's robots, whose
motion is given, have only under servo commands.
"""

from __future__ import annotations

import argparse
import json
import logging
import re
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from reaching import reaching
from sensors import ticks
from wire import SERVERS, other_process, ours, put_on_the_wire

import nuno
from nuno.robot.description import robot_data
from nuno.robot.servo import ServoCommand

FRAME = 1.0 / 60.0
ARM = [f"arm_left_{k}_joint" for k in range(1, 8)]
PANDA = "panda_description/urdf/panda.urdf"
NEAR, TURNED = 1e-3, np.radians(1.0)
"""[m], [rad] Within which a pose counts as reached, of either library."""


def median_ms(call: Callable[[], Any], repeats: int) -> float:
    """Median processor time of a call [ms], after some that do not count."""
    spent = []
    for k in range(repeats + 5):
        start = time.thread_time()
        call()
        if k >= 5:
            spent.append(time.thread_time() - start)
    return round(1000.0 * statistics.median(spent), 4)


def control(repeats: int) -> dict[str, float]:
    """A tick of the simulated robot [ms]: what the world asks of it in a frame, without the frame."""
    world = nuno.World(device="cpu")
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    spent: list[float] = []

    def measured(name: str) -> None:
        own = getattr(robot, name)

        def call(*arguments: Any) -> None:
            start = time.thread_time()
            own(*arguments)
            spent.append(time.thread_time() - start)

        setattr(robot, name, call)

    measured("begin_frame")
    measured("end_frame")

    def tick(frames: int) -> float:
        robot.sleep(0.2)
        spent.clear()
        robot.sleep(frames * FRAME)
        both = np.array(spent[: 2 * frames]).reshape(-1, 2).sum(axis=1)
        return round(1000.0 * float(np.median(both)), 4)

    found = {"at rest": tick(repeats)}
    angles = robot.angle_vector()
    robot.angle_vector(np.clip(angles + 0.3, *robot.robot.joint_limits), 2.0 * repeats * FRAME)
    found["all joints in motion"] = tick(repeats)
    robot.angle_vector(angles, 5.0)
    robot.wait_interpolation()
    robot.angle_vector(dict.fromkeys(ARM[:4], -0.3), 2.0 * repeats * FRAME)
    found["an arm in motion"] = tick(repeats)
    robot.stop_motion()
    robot.servo(
        ServoCommand(tuple(ARM), q=angles[[robot.robot.joint_index(joint) for joint in ARM]], kp=300.0, kd=20.0)
    )
    found["7 joints under a servo command"] = tick(repeats // 4)
    robot.servo(None)
    robot.go_pos(1.0, wait=False)
    found["walking"] = tick(min(repeats, 200))
    return found


def beside_a_cloth(repeats: int) -> dict[str, Any]:
    """A cloth's frames with a robot in the room over those without [ms, ratios]: in turns, medians of both."""

    def room() -> nuno.World:
        world = nuno.World(device="cpu")
        world.add(nuno.box((0.6, 1.2, 0.02), name="table", position=(0.7, 0.0, 0.7)))
        cloth = world.add(nuno.sheet((0.6, 0.4), cells=(30, 20), name="cloth", position=(0.7, 0.0, 0.715)))
        world.attach(cloth, nuno.Cloth.preset("towel"))
        return world

    alone, shared = room(), room()
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), shared)
    for world in (alone, shared):
        world.run(1.0)
    found: dict[str, Any] = {}

    def compare(what: str) -> None:
        spent: dict[str, list[float]] = {"without": [], "with": []}
        for k in range(repeats):
            for name, world in (("without", alone), ("with", shared)):
                start = time.thread_time()
                world.step()
                if k >= 5:
                    spent[name].append(time.thread_time() - start)
        without, with_robot = (1000.0 * statistics.median(spent[name]) for name in ("without", "with"))
        found[what] = {
            "frame_ms_without": round(without, 3), "frame_ms_with": round(with_robot, 3),
            "ratio": round(with_robot / without, 3),
        }  # fmt: skip

    compare("at rest")
    robot.angle_vector({"arm_right_4_joint": -1.2}, 1.0)
    robot.wait_interpolation()
    compare("at rest after it moved")
    robot.angle_vector({"arm_right_4_joint": -0.5}, 2.0 * repeats * FRAME)
    compare("in motion")
    return found


def without_meshes(urdf: Path, folder: Path) -> Path:
    """Write a URDF without shapes, and return its path."""
    text = urdf.read_text(encoding="utf-8")
    for part in ("visual", "collision"):
        text = re.sub(rf"<{part}\b.*?</{part}>", "", text, flags=re.DOTALL)
    path = folder / urdf.name
    path.write_text(text, encoding="utf-8")
    return path


def kinematics(repeats: int, targets: int) -> dict[str, Any]:
    """Forward kinematics of all frames of Talos, inverse ones of a Panda arm (7 joints), and the peers' [ms]."""
    talos, random = nuno.Humanoid("talos"), np.random.default_rng(2)
    lower, upper = talos.joint_limits
    some = iter(random.uniform(np.maximum(lower, -1.0), np.minimum(upper, 1.0), (repeats + 5, len(lower))))

    def forward() -> None:
        talos.move_to(next(some))
        talos.update()

    found: dict[str, Any] = {"forward": {"nuno": median_ms(forward, repeats)}}
    q, v = talos.configuration(), np.zeros(talos.model.nv)
    found["inverse_dynamics"] = {"nuno": median_ms(lambda: pin.rnea(talos.model, talos.data, q, v, v), repeats)}
    panda = nuno.Humanoid(robot_data() / PANDA)
    start = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.0, 0.0])
    low, high = panda.joint_limits
    poses = []
    for _ in range(targets):
        panda.angle_vector(np.append(random.uniform(low[:7] + 0.1, high[:7] - 0.1), [0.0, 0.0]))
        poses.append(panda.frame_pose("panda_hand"))
    spent, reached = [], 0
    for pose in poses:
        panda.angle_vector(start)
        begin = time.thread_time()
        reached += bool(
            panda.reach({"panda_hand": pose}, stance=["panda_link0"], tolerance=NEAR, angle_tolerance=TURNED,
                        check_collisions=False)
        )  # fmt: skip
        spent.append(time.thread_time() - begin)
    found["inverse"] = {"nuno": {"reached": reached, "of": targets, "median_ms": _median(spent)}}
    with tempfile.TemporaryDirectory() as folder:
        _scikit_robot(found, Path(folder), poses, start, repeats)
        _mujoco(found, Path(folder), repeats)
    return found


def _median(spent: list[float]) -> float:
    return round(1000.0 * statistics.median(spent), 3)


def _scikit_robot(found: dict[str, Any], folder: Path, poses: list[Any], start: np.ndarray, repeats: int) -> None:
    try:
        from skrobot.coordinates import Coordinates
        from skrobot.models.urdf import RobotModelFromURDF
    except ImportError:
        return
    logging.getLogger("skrobot").setLevel(logging.ERROR)
    talos = RobotModelFromURDF(urdf_file=str(without_meshes(nuno.Humanoid("talos").description.urdf, folder)))
    middle = np.array([0.5 * (max(joint.min_angle, -1.0) + min(joint.max_angle, 1.0)) for joint in talos.joint_list])
    step = iter(np.linspace(0.0, 1e-3, repeats + 5))

    def forward() -> None:
        talos.angle_vector(middle + next(step))
        for link in talos.link_list:
            link.worldpos()

    found["forward"]["scikit-robot"] = median_ms(forward, repeats)
    panda = RobotModelFromURDF(urdf_file=str(without_meshes(robot_data() / PANDA, folder)))
    hand = next(link for link in panda.link_list if link.name == "panda_hand")
    arm = [link for link in panda.link_list if re.fullmatch(r"panda_link[1-7]", link.name)]
    order = {f"panda_joint{k}": start[k - 1] for k in range(1, 8)}
    spent, reached = [], 0
    for pose in poses:
        for joint in panda.joint_list:
            joint.joint_angle(order.get(joint.name, 0.0))
        goal = Coordinates(pos=pose.position, rot=pose.rotation)
        begin = time.thread_time()
        panda.inverse_kinematics(
            goal, link_list=arm, move_target=hand, thre=NEAR, rthre=TURNED, stop=100, revert_if_fail=False
        )
        spent.append(time.thread_time() - begin)
        turn = pin.log3(hand.worldrot().T @ pose.rotation)
        near = np.linalg.norm(hand.worldpos() - pose.position) <= 1.01 * NEAR
        reached += bool(near and np.linalg.norm(turn) <= 1.01 * TURNED)
    found["inverse"]["scikit-robot"] = {"reached": reached, "of": len(poses), "median_ms": _median(spent)}


def _mujoco(found: dict[str, Any], folder: Path, repeats: int) -> None:
    try:
        import mujoco
    except ImportError:
        return
    text = without_meshes(nuno.Humanoid("talos").description.urdf, folder).read_text(encoding="utf-8")
    options = (
        '<mujoco><compiler discardvisual="false" fusestatic="false" balanceinertia="true" boundmass="1e-6"/></mujoco>'
    )
    model = mujoco.MjModel.from_xml_string(re.sub(r"(<robot\b[^>]*>)", rf"\1{options}", text, count=1))
    model.opt.timestep = 1e-3
    data = mujoco.MjData(model)
    found["forward"]["mujoco"] = median_ms(lambda: mujoco.mj_kinematics(model, data), repeats)
    found["inverse_dynamics"]["mujoco"] = median_ms(lambda: mujoco.mj_inverse(model, data), repeats)
    found["a step of dynamics"] = {"mujoco": median_ms(lambda: mujoco.mj_step(model, data), repeats)}


def rows_of(report: dict[str, Any]) -> list[tuple[str, Any, str, str]]:
    """What was measured, the figure, the goal, and the peers' figures."""
    rows: list[tuple[str, Any, str, str]] = []
    for what, value in report["control_tick_ms"].items():
        goal = "" if "servo" in what else "0.3"
        peers = {} if "servo" not in what else report["kinematics_ms"].get("a step of dynamics", {})
        rows.append((f"control tick, {what} [ms]", value, goal, _peers(peers, " (one step of 1 ms of 17)")))
    for what, value in report["sensors_ms"].items():
        if what not in ("frame", "contacts_asked"):
            rows.append((f"all sensors, {what.replace('_', ' ')} [ms]", value, "0.2", ""))
    for what, own in report["beside_a_cloth"].items():
        text = f"{own['ratio']:.2f} ({own['frame_ms_without']:.2f} -> {own['frame_ms_with']:.2f} ms)"
        rows.append((f"frame of a cloth, robot {what}", text, "" if what == "in motion" else "1.10", ""))
    own = report["reaching"]
    rows.append(("two hands, whole body [ms]", own["median_ms"], "5", ""))
    rows.append(("of so many reached", f"{own['reached']} of {own['targets']}", "all", ""))
    found = report["kinematics_ms"]
    for what, name in (("forward", "forward kinematics of Talos"), ("inverse_dynamics", "inverse dynamics of Talos")):
        peers = {peer: value for peer, value in found[what].items() if peer != "nuno"}
        rows.append((f"{name} [ms]", found[what]["nuno"], "", _peers(peers)))
    told = {peer: f"{own['median_ms']} ms, {own['reached']} of {own['of']}" for peer, own in found["inverse"].items()}
    rows.append(("pose of a Panda's hand, reached", told.pop("nuno"), "", _peers(told)))
    for what, own in report.get("wire", {}).items():
        rows.append((f"wire, {what} [ms]", f"{own['median_ms']} (99 %: {own['p99_ms']})", "2", ""))
    return rows


def _peers(found: dict[str, Any], more: str = "") -> str:
    return ", ".join(f"{name} {value}{more}" for name, value in found.items())


def main() -> None:
    """Measure all, print a table, and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=300)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report: dict[str, Any] = {
        "control_tick_ms": control(options.repeats),
        "sensors_ms": ticks("talos", options.repeats),
        "beside_a_cloth": beside_a_cloth(options.repeats),
        "reaching": reaching("talos", 60)["poses"],
        "kinematics_ms": kinematics(options.repeats, 60),
    }
    with other_process(put_on_the_wire, *SERVERS["real time"]) as url:
        report["wire"] = ours(url, options.repeats)
    print(f"{'':<50}{'nuno':>28}{'goal':>8}   peers")
    for what, value, goal, peers in rows_of(report):
        print(f"{what:<50}{value!s:>28}{goal:>8}   {peers}")
    if options.json is not None:
        options.json.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
