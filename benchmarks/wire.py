"""How long a robot on the wire takes to answer: ``python benchmarks/wire.py [--count 2000] [--json FILE]``.

A server with a simulated Talos in another process, on loopback. Round trips of a service (``get_time``), of a goal for
one arm until it is acknowledged by feedback, and of a tick of the simulation; each as median, 99th percentile and
longest, against the goal of 2 ms. "stepped" is a server whose time passes when clients wait, "real time" one where it
passes by itself, "with a cloth" one that also steps a towel of 31 x 21 vertices. The peer is roslibpy 2.1, where it is
installed, on the same service and server.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

GOAL_MS = 2.0
SERVERS = {"stepped": (None, False), "real time": (1.0, False), "real time, with a cloth": (1.0, True)}


def put_on_the_wire(pipe: Any, factor: float | None, with_cloth: bool) -> None:
    """Serve a Talos until the pipe says otherwise: what the other process does."""
    import warp as wp

    import nuno
    from nuno.robot.simulated_robot import SimulatedRobot
    from nuno.robot.wire.server import RobotServer

    wp.config.log_level = wp.LOG_ERROR
    world = nuno.World(device="cpu")
    if with_cloth:
        world.add(nuno.box((1.2, 0.8, 0.04), name="table", position=(1.0, 0.0, 0.68)))
        towel = world.add(nuno.sheet((0.6, 0.4), cells=(30, 20), name="towel", position=(1.0, 0.0, 0.75)))
        world.attach(towel)
        world.step()  # loads kernels
    with RobotServer(SimulatedRobot(nuno.Humanoid("talos"), world), port=0, real_time_factor=factor) as server:
        pipe.send(server.url)
        pipe.recv()


@contextmanager
def served(factor: float | None, with_cloth: bool) -> Iterator[str]:
    """The url of a server in another process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=put_on_the_wire, args=(there, factor, with_cloth))
    process.start()
    there.close()
    try:
        yield here.recv()
    finally:
        here.send("end")
        process.join()


def timed(act: Callable[[], Any], count: int) -> dict[str, float]:
    """Milliseconds that something takes, after some that do not count."""
    for _ in range(20):
        act()
    walls = np.empty(count)
    for k in range(count):
        start = time.perf_counter()
        act()
        walls[k] = 1000.0 * (time.perf_counter() - start)
    median, late = np.percentile(walls, (50, 99))
    return {
        "median_ms": round(median, 3),
        "p99_ms": round(late, 3),
        "longest_ms": round(walls.max(), 3),
        "count": count,
    }


def ours(url: str, count: int) -> dict[str, dict[str, float]]:
    """Round trips of ``WireRobot``."""
    from nuno.robot.trajectory import JointTrajectory
    from nuno.robot.wire.client import WireRobot

    with WireRobot(url) as robot:
        rows = {"service": timed(lambda: robot.connection.call("/rosapi/get_time", "", {}), count)}
        client = robot.controller_table["larm_controller"][0]
        joints = tuple(client.controller["joint_names"])
        angles = [robot.angle_vector()[robot.robot.joint_index(joint)] for joint in joints]
        trajectory = JointTrajectory(joints, [5.0], [angles], [np.zeros(len(joints))])
        rows["goal, until acknowledged"] = timed(lambda: client.send_goal(trajectory), count // 4)
        robot.cancel_angle_vector()
        if robot._clock.is_stepped:
            rows["a tick (1/60 s) and its joint state"] = timed(lambda: robot.sleep(1 / 60), count // 4)
    return rows


def peer(url: str, count: int) -> dict[str, dict[str, float]]:
    """Round trips of roslibpy, where it is installed."""
    try:
        import roslibpy
    except ImportError:
        return {}
    host, port = url.removeprefix("ws://").split(":")
    ros = roslibpy.Ros(host=host, port=int(port), transport="asyncio")
    ros.run()
    service = roslibpy.Service(ros, "/rosapi/get_time", "rosapi_msgs/srv/GetTime")

    def call() -> None:
        done = threading.Event()
        service.call(roslibpy.ServiceRequest(), lambda _: done.set(), None)
        done.wait(10.0)

    rows = {"service, by roslibpy": timed(call, count)}
    ros.close()
    return rows


def main() -> None:
    """Measure all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, help="round trips of the service; a quarter of the others")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report: dict[str, Any] = {"goal_ms": GOAL_MS}
    print(f"{'server':<26}{'round trip':<38}{'median':>9}{'99 %':>9}{'longest':>9}  ms")
    for name, (factor, with_cloth) in SERVERS.items():
        with served(factor, with_cloth) as url:
            rows = ours(url, options.count) | peer(url, options.count)
        report[name] = rows
        for what, row in rows.items():
            print(f"{name:<26}{what:<38}{row['median_ms']:>9}{row['p99_ms']:>9}{row['longest_ms']:>9}", flush=True)
        if options.json:
            options.json.write_text(json.dumps(report, indent=1))
    worst = max(row["median_ms"] for name in SERVERS for row in report[name].values())
    print(f"goal {GOAL_MS} ms: {'met' if worst < GOAL_MS else 'missed'} in the median of all ({worst} ms)")


if __name__ == "__main__":
    main()
