"""What a robot's sensors cost: ``python benchmarks/sensors.py [--json FILE]``.

A tick of all sensors but the cameras, called again and again and between frames of a world (when a processor's caches
hold the world's numbers), with a towel in a hand and while walking; one by contacts that the solver is asked for; and
pictures.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nuno
from nuno.robot.hands import Hand
from nuno.robot.head_cameras import HeadCameras
from nuno.robot.sensors import Sensors


def median_ms(call: Callable[[], Any], repeats: int, before: Callable[[], Any] | None = None) -> float:
    """Median processor time of a call [ms], with something else done before each."""
    walls = []
    for _ in range(repeats):
        if before is not None:
            before()
        start = time.thread_time()
        call()
        walls.append(time.thread_time() - start)
    return round(1000.0 * statistics.median(walls), 4)


def ticks(name: str, repeats: int) -> dict[str, float]:
    """Times of a tick [ms] in several states."""
    robot = nuno.Humanoid(name)
    world = nuno.World(device="cpu")
    links = robot.enter(world)
    sensors = Sensors(robot, links)
    state = sensors.state_at_rest()
    sensors.read(state)
    found = {"alone": median_ms(lambda: sensors.read(state), repeats)}
    place = robot.frame_pose("left_hand").to_world([(0.0, 0.0, 0.03)])[0]
    towel = world.add(nuno.sheet((0.3, 0.4), cells=(12, 16), position=(place[0] + 0.15, place[1] + 0.2, place[2])))
    world.attach(towel, nuno.Cloth.preset("towel"))
    hand = Hand(links, "left_hand")
    hand.close()
    world.run(1.0)
    found["frame"] = median_ms(world.step, repeats // 4)
    found["towel_in_hand"] = median_ms(lambda: sensors.read(state), repeats // 4, world.step)
    other = Sensors(robot)
    found["between_frames_without_world"] = median_ms(lambda: other.read(state), repeats // 4, world.step)
    found["contacts_asked"] = median_ms(lambda: world.contacts(towel), repeats // 20, world.step)
    walker = nuno.SimulatedRobot(nuno.Humanoid(name), nuno.World(device="cpu"))
    walker.go_pos(1.0, wait=False)
    walker.sleep(0.5)
    found["walking"] = median_ms(walker.read, min(repeats // 4, 100), walker.world.step)
    return found


def pictures(name: str, repeats: int) -> dict[str, float]:
    """Times of a pair of pictures of 640 x 480 pixels [ms]: colour, depth and bodies."""
    robot = nuno.Humanoid(name)
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    world.add(nuno.box((0.7, 1.2, 0.02), position=(0.75, 0, 0.71)))
    world.add(nuno.sheet((0.3, 0.4), cells=(12, 16), position=(0.6, 0, 0.725)))
    links = robot.enter(world)
    found = {}
    for looks in ("collision", "visual"):
        cameras = HeadCameras(links, looks=looks)
        cameras.look()
        found[looks] = median_ms(lambda: cameras.look()["head_left"].color.numpy(), repeats)  # noqa: B023
    return found


def main() -> None:
    """Measure, print, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--repeats", type=int, default=400)
    options = parser.parse_args()
    results = {
        name: {"tick_ms": ticks(name, options.repeats), "pair_of_pictures_ms": pictures(name, 5)}
        for name in ("talos", "g1")
    }
    text = json.dumps(results, indent=2)
    print(text)
    if options.json is not None:
        options.json.write_text(text)


if __name__ == "__main__":
    main()
