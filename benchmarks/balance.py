"""How robots keep their balance: ``python benchmarks/balance.py``; prints tables, ``--json PATH`` writes them.

Standing, walks of 1 m and turns by 90 degrees on flat ground, with a mat of 5 kg on the arms and over boards of 1 cm,
pushes while standing and walking, the largest push that is survived, and the fall past it with the stand-up after.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

import nuno
from nuno.robot.support import standing_place
from nuno.tasks.look_at_camera import look_at_camera

ROBOTS = ("talos", "g1")
ARMS = {
    "talos": {"arm_left_4_joint": -1.8, "arm_right_4_joint": -1.8},
    "g1": {"left_elbow_joint": -0.35, "right_elbow_joint": -0.35},
}  # forearms about level [rad]
MAT_AT = {"talos": (0.2, 0.3, 1.0), "g1": (0.2, 0.2, 0.56)}  # its middle ahead of the base, its sides [m]
HOLDS = {"talos": (), "g1": ("left_wrist_yaw_link", "right_wrist_yaw_link")}  # that hold its edges
MAT, BOARD = 5.0, 0.01  # [kg], [m]
DIRECTIONS = {"ahead": 0, "ahead and left": 45, "left": 90, "back and left": 135, "back": 180, "right": 270}  # [deg]
WALKING = ("ahead", "left", "back", "right")
IMPULSES = (5.0, 10.0, 20.0, 30.0, 40.0)  # [N s]
LASTS, STEP = 0.1, 2.5  # [s] of a push, [N s] to which the limit is found
AFTER, PUSHED_AT = 3.5, (3.3, 3.8)  # [s] after a push; when a walker is pushed: early in a step and late


@dataclass
class Scene:
    """A robot in a world."""

    world: nuno.World
    robot: nuno.SimulatedRobot

    @classmethod
    def of(cls, name: str) -> Scene:
        """Return a robot that stands on a floor."""
        world = nuno.World(device="cpu")
        world.add(nuno.plane(name="floor"))
        return cls(world, nuno.SimulatedRobot(nuno.Humanoid(name), world, dynamics=True))

    def push(self, impulse: float, degrees: float) -> None:
        """Push the base along the ground."""
        angle = math.radians(degrees)
        force = np.array([math.cos(angle), math.sin(angle), 0.0]) * impulse / LASTS
        self.world.push(self.robot.links.bodies[0], force, duration=LASTS)

    def stands_after(self, seconds: float) -> bool:
        """Return whether the robot has not fallen after some seconds."""
        for _ in range(round(seconds / 0.1)):
            self.robot.sleep(0.1)
            if self.robot.state().fallen:
                return False
        return True


def walked(scene: Scene, x: float, yaw: float) -> dict[str, Any]:
    """Walk, and return how far from the goal the robot ends."""
    robot = scene.robot
    start, clock, begun = standing_place(robot.actual), time.process_time(), robot.now()
    over: set[str] = set()

    def watch() -> bool:
        over.update(robot.state().over_torque)
        return goal.is_done or robot.state().fallen is not None

    goal = robot.send_base(x, 0.0, yaw, None, True)
    robot.wait_until(watch, 120.0)
    arrived = goal.is_done and robot.state().fallen is None
    robot.sleep(0.5)
    c, s = math.cos(start[2]), math.sin(start[2])
    end = standing_place(robot.actual)
    wanted = start[0] + c * x, start[1] + s * x
    turned = math.remainder(end[2] - start[2] - yaw, math.tau)
    return {
        "arrived": arrived, "said": robot.state().fallen or goal.text, "seconds": robot.now() - begun,
        "missed_mm": 1000.0 * math.hypot(end[0] - wanted[0], end[1] - wanted[1]), "missed_mrad": 1000.0 * turned,
        "over_torque": sorted(over), "cpu_per_s": (time.process_time() - clock) / (robot.now() - begun),
    }  # fmt: skip


def with_mat(name: str) -> tuple[Scene, nuno.Body]:
    """Return a robot with the mat on its arms."""
    scene = Scene.of(name)
    robot, (ahead, length, width) = scene.robot, MAT_AT[name]
    robot.sleep(0.1)
    robot.angle_vector(ARMS[name], 0.8)
    robot.wait_interpolation()
    arms = [body for body, link in zip(robot.links.bodies, robot.links.names, strict=True)
            if any(part in link for part in ("left_4", "left_5", "left_elbow", "left_wrist"))]  # fmt: skip
    top = max(float(body.vertices[:, 2].max()) for body in arms)
    size = (length, width, 0.04)
    mat = nuno.soft_box(size, (4, 12, 1), name="mat", position=(robot.state().q[0] + ahead, 0.0, top + 0.03))
    scene.world.add(mat)
    scene.world.attach(mat, nuno.Soft(youngs_modulus=1e6, density=MAT / math.prod(size), friction=0.8))
    for hand in HOLDS[name]:  # short forearms: it would slide off
        link = next(body for body, own in zip(robot.links.bodies, robot.links.names, strict=True) if own == hand)
        near = np.linalg.norm(mat.vertices - link.vertices.mean(axis=0), axis=1)
        scene.world.grip(mat, np.argsort(near)[:4], to=link)
    robot.sleep(1.5)
    return scene, mat


def walks(name: str, what: str) -> list[dict[str, Any]]:
    """Walk 1 m and turn by 90 degrees."""
    mat = None
    if what == "mat":
        scene, mat = with_mat(name)
    else:
        scene = Scene.of(name)
        scene.robot.sleep(0.5)
    if what == "boards":
        numbers = np.random.default_rng(1)
        for x in np.arange(0.3, 1.2, 0.3):
            size = (0.22, 0.9, BOARD)
            place = (float(x + numbers.uniform(-0.03, 0.03)), float(numbers.uniform(-0.1, 0.1)), 0.5 * BOARD)
            scene.world.add(nuno.box(size, position=place, name=f"board {x:.1f}"))
    found = []
    for goal, x, yaw in (("1 m", 1.0, 0.0), ("90 degrees", 0.0, 0.5 * math.pi)):
        row = {"robot": name, "ground": what, "goal": goal, **walked(scene, x, yaw)}
        if mat is not None:
            row["mat_above_floor_m"] = float(mat.vertices[:, 2].min())
        found.append(row)
        if scene.robot.state().fallen:
            break
    return found


def pushes(name: str, bar: Any) -> list[dict[str, Any]]:
    """Push a standing robot, and find the largest impulse that it survives in each direction."""
    scene = Scene.of(name)
    scene.robot.sleep(0.5)
    saved, found = scene.world.save(), []
    bounds = {degrees: capture_bound(scene.robot, degrees) for degrees in DIRECTIONS.values()}
    for direction, degrees in DIRECTIONS.items():
        results: dict[float, str] = {}

        def survives(impulse: float, degrees: float = degrees, results: dict[float, str] = results) -> bool:
            scene.world.restore(saved)
            scene.push(impulse, degrees)
            stands = scene.stands_after(AFTER)
            results[impulse] = "stands" if stands else str(scene.robot.state().fallen)
            bar.update()
            return stands

        survived = survivors(survives)
        low = 0.0
        for impulse in IMPULSES:
            if impulse not in survived:
                break
            low = impulse
        failed = [impulse for impulse in IMPULSES if impulse not in survived]
        high = min(failed) if failed else 1.5 * IMPULSES[-1]
        while high - low > STEP:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if survives(middle) else (low, middle)
        found.append({"robot": name, "direction": direction, "survived": survived, "limit": low, "falls_at": high,
                      "capture_bound": bounds[degrees], "results": results})  # fmt: skip
    return found


def survivors(survives: Callable[[float], bool]) -> list[float]:
    """Return the impulses that are survived, in order, up to two in a row that are not."""
    found: list[float] = []
    failed = 0
    for impulse in IMPULSES:
        if survives(impulse):
            found.append(impulse)
            failed = 0
        elif (failed := failed + 1) == 2:
            break
    return found


def capture_bound(robot: nuno.SimulatedRobot, degrees: float) -> float:
    """Return the impulse [N s] that brings the capture point to the edge of the soles: J = m w d, w = sqrt(g / h)."""
    actual, angle = robot.actual, math.radians(degrees)
    way = np.array([math.cos(angle), math.sin(angle)])
    centre = actual.centre_of_mass
    outline = actual.support_polygon()
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
    offsets = (normals * (outline - centre[:2])).sum(axis=1)
    ahead = normals @ way
    distance = float(np.min(offsets[ahead > 1e-9] / ahead[ahead > 1e-9]))
    return float(actual.mass * math.sqrt(9.81 / centre[2]) * distance)


def walking_pushes(name: str, bar: Any) -> list[dict[str, Any]]:
    """Push a robot that walks 1 m, early and late in a step."""
    found = []
    for at in PUSHED_AT:
        scene = Scene.of(name)
        scene.robot.sleep(0.5)
        scene.robot.send_base(1.0, 0.0, 0.0, None, True)
        scene.robot.sleep(at)
        saved = scene.world.save()
        for direction in WALKING:

            def survives(impulse: float, scene: Scene = scene, saved: Any = saved, direction: str = direction) -> bool:
                scene.world.restore(saved)
                scene.push(impulse, DIRECTIONS[direction])
                bar.update()
                return scene.stands_after(AFTER)

            survived = survivors(survives)
            found.append({"robot": name, "direction": direction, "at": at, "survived": survived})
    return found


def falls(name: str) -> dict[str, Any]:
    """Push a robot over, and set it up again."""
    scene = Scene.of(name)
    scene.robot.sleep(0.3)
    scene.push(3.0 * scene.robot.actual.mass, 0.0)
    stood = scene.stands_after(3.0)
    state = scene.robot.state()
    touching = sorted(state.contacts)
    scene.robot.sleep(1.0)
    scene.robot.set_up((1.0, 0.0, 0.0), 0.5)
    stands = scene.stands_after(1.0)
    return {"robot": name, "said": "" if stood else state.fallen, "touching": touching, "stands_again": stands,
            "over_torque": list(state.over_torque)}  # fmt: skip


def pictures(path: Path) -> None:
    """Draw a kick that is survived by a step, one that is not, and the stand-up after it."""
    import cv2

    strips = []
    for name, (survived, lost) in {"talos": (45.0, 90.0), "g1": (15.0, 40.0)}.items():
        scene = Scene.of(name)
        scene.robot.sleep(0.5)
        saved, height = scene.world.save(), float(scene.robot.state().q[2])
        row = []
        for impulse, times in ((survived, (0.1, 0.35, 0.6, 2.0)), (lost, (0.3, 0.7, 1.6))):
            scene.world.restore(saved)
            begun = scene.robot.now()
            scene.push(impulse, 0.0)
            for at in times:
                scene.robot.sleep(begun + at - scene.robot.now())
                row.append(shot(scene, height, f"{impulse:.0f} N s, {at:.1f} s"))
        scene.robot.set_up()
        scene.robot.sleep(0.5)
        row.append(shot(scene, height, "set up again"))
        strips.append(np.hstack(row))
    cv2.imwrite(str(path), np.vstack(strips))


def shot(scene: Scene, height: float, text: str) -> np.ndarray:
    """Return a picture (h, w, 3) of a robot whose base stands at a height [m], blue first, with a line of text."""
    import cv2

    aim = np.array([scene.robot.state().q[0] + 0.1, scene.robot.state().q[1], 0.6 * height])
    camera = look_at_camera(aim + height * np.array([0.8, -3.2, 0.5]), aim, 300, 340, 460.0)
    image = nuno.take_picture(scene.world, camera, samples=2).color.numpy()[..., ::-1].copy()
    return cv2.putText(image, text, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 1, cv2.LINE_AA)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--pictures", type=Path, help="a file for pictures of kicks, and no tables")
    parser.add_argument("--robots", nargs="+", default=ROBOTS, choices=ROBOTS)
    parser.add_argument("--parts", nargs="+", default=("walks", "pushes", "walking", "falls"))
    given = parser.parse_args()
    logging.getLogger("nuno").setLevel(logging.ERROR)
    if given.pictures:
        pictures(given.pictures)
        return
    found: dict[str, list[Any]] = {"walks": [], "pushes": [], "walking": [], "falls": []}
    with tqdm(unit="trial") as bar:
        for name in given.robots:
            for what in ("flat", "mat", "boards") if "walks" in given.parts else ():
                bar.set_description(f"{name}, {what}")
                found["walks"] += walks(name, what)
                bar.update()
            for part, function in (("pushes", pushes), ("walking", walking_pushes)):
                if part in given.parts:
                    bar.set_description(f"{name}, {part}")
                    found[part] += function(name, bar)
            if "falls" in given.parts:
                found["falls"].append(falls(name))
            if given.json:
                given.json.write_text(json.dumps(found, indent=1))
    table("| robot | ground | goal | arrived | off [mm] | off [mrad] | s | CPU s/s | motors at their limit |", [
        f"| {row['robot']} | {row['ground']} | {row['goal']} | {'yes' if row['arrived'] else row['said']} | "
        f"{row['missed_mm']:.1f} | {row['missed_mrad']:.0f} | {row['seconds']:.1f} | {row['cpu_per_s']:.1f} | "
        f"{', '.join(row['over_torque']) or 'none'} |" for row in found["walks"]
    ])  # fmt: skip
    table("| robot | pushed | survives of 5, 10, 20, 30, 40 N s | limit [N s] | m w d [N s] |", [
        f"| {row['robot']} | {row['direction']} | {', '.join(f'{j:.0f}' for j in row['survived'])} | "
        f"{row['limit']:.1f} | {row['capture_bound']:.1f} |" for row in found["pushes"]
    ])  # fmt: skip
    table("| robot | pushed walking | at [s] | survives of 5, 10, 20, 30, 40 N s |", [
        f"| {row['robot']} | {row['direction']} | {row['at']:.1f} | {', '.join(f'{j:.0f}' for j in row['survived'])} |"
        for row in found["walking"]
    ])  # fmt: skip
    table("| robot | what it says | touching | stands again |", [
        f"| {row['robot']} | {row['said']} | {', '.join(row['touching'])} | {row['stands_again']} |"
        for row in found["falls"]
    ])  # fmt: skip


def table(head: str, rows: list[str]) -> None:
    if rows:
        print(f"\n{head}\n|{'---|' * (head.count('|') - 1)}")
        print("\n".join(rows))


if __name__ == "__main__":
    main()
