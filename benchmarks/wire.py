"""How long a robot on the wire takes to answer: ``python benchmarks/wire.py [--count 2000] [--json FILE]``.

A server with a simulated Talos in another process, on loopback. Round trips of a service (``get_time``), of a goal for
one arm until it is acknowledged by feedback, and of a tick of the simulation; each as median, 99th percentile and
longest, against the goal of 2 ms. "stepped" is a server whose time passes when clients wait, "real time" one where it
passes by itself, "with a cloth" one that also steps a towel of 31 x 21 vertices. The peer is roslibpy 2.1, where it is
installed, on the same service and server.

The floor, measured before and after on a message of the same length: two processes that only send it back and forth,
by blocking sockets, and by the websockets package, its asyncio server and either of its clients. What they take is
what the machine and the interpreter take at that moment. All processes ``gc.freeze()`` what they begin with, as
``nuno serve`` does: a full collection takes tens of milliseconds in a program that has loaded Warp and Pinocchio.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import multiprocessing
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

GOAL_MS = 2.0
WARM = 20  # round trips that do not count
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
        gc.freeze()
        pipe.send(server.url)
        pipe.recv()


def send_back(pipe: Any) -> None:
    """Send back what comes, by a blocking socket, until the other side closes it."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        pipe.send(listening.getsockname()[1])
        own, _ = listening.accept()
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with own:
            while data := own.recv(2**16):
                own.sendall(data)
        pipe.recv()


def send_back_messages(pipe: Any) -> None:
    """Send back what comes, by the asyncio server of websockets, until the pipe says otherwise."""
    from websockets.asyncio.server import serve

    async def echo(own: Any) -> None:
        async for message in own:
            await own.send(message)

    async def stay() -> None:
        async with serve(echo, "127.0.0.1", 0, compression=None) as server:
            pipe.send(next(iter(server.sockets)).getsockname()[1])
            await asyncio.get_running_loop().run_in_executor(None, pipe.recv)

    asyncio.run(stay())


@contextmanager
def other_process(work: Callable[..., None], *arguments: Any) -> Iterator[Any]:
    """What another process says first; it is told to end afterwards."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=work, args=(there, *arguments))
    process.start()
    there.close()
    try:
        yield here.recv()
    finally:
        here.send("end")
        process.join()


def summary(walls: list[float]) -> dict[str, float]:
    """Median, 99th percentile and longest [ms] of times [s]."""
    median, late, longest = (round(1000.0 * float(value), 3) for value in np.percentile(walls, (50, 99, 100)))
    return {"median_ms": median, "p99_ms": late, "longest_ms": longest, "count": len(walls)}


def timed(act: Callable[[], Any], count: int) -> dict[str, float]:
    """What something takes, after some times that do not count."""
    walls = []
    for _ in range(count + WARM):
        start = time.perf_counter()
        act()
        walls.append(time.perf_counter() - start)
    return summary(walls[WARM:])


def ours(url: str, count: int) -> dict[str, dict[str, float]]:
    """Round trips of ``WireRobot``."""
    from nuno.robot.trajectory import JointTrajectory
    from nuno.robot.wire.client import WireRobot

    with WireRobot(url) as robot:
        gc.freeze()
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


def floor(count: int) -> dict[str, dict[str, float]]:
    """Round trips of the bare message between two processes that do nothing else."""
    from websockets.asyncio.client import connect as connect_asyncio
    from websockets.sync.client import connect

    request = {"op": "call_service", "id": "call:/rosapi/get_time:1000", "service": "/rosapi/get_time", "args": {}}
    text = json.dumps(request)
    data, rows = text.encode(), {}
    with other_process(send_back) as port, socket.create_connection(("127.0.0.1", port)) as own:
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        rows["blocking sockets"] = timed(lambda: (own.sendall(data), own.recv(2**16)), count)
        own.close()
    with other_process(send_back_messages) as port:
        with connect(f"ws://127.0.0.1:{port}", compression=None) as peer:
            rows["websockets, its threaded client"] = timed(lambda: (peer.send(text), peer.recv()), count)

        async def back_and_forth() -> list[float]:
            walls = []
            async with connect_asyncio(f"ws://127.0.0.1:{port}", compression=None) as own:
                for _ in range(count + WARM):
                    start = time.perf_counter()
                    await own.send(text)
                    await own.recv()
                    walls.append(time.perf_counter() - start)
            return walls[WARM:]

        rows["websockets, asyncio on both sides"] = summary(asyncio.run(back_and_forth()))
    return rows


def main() -> None:
    """Measure all and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, help="round trips of the service; a quarter of the others")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report: dict[str, Any] = {"goal_ms": GOAL_MS}
    print(f"{'server':<26}{'round trip':<38}{'median':>9}{'99 %':>9}{'longest':>9}  ms")

    def tell(name: str, rows: dict[str, dict[str, float]]) -> None:
        report[name] = rows
        for what, row in rows.items():
            print(f"{name:<26}{what:<38}{row['median_ms']:>9}{row['p99_ms']:>9}{row['longest_ms']:>9}", flush=True)

    gc.freeze()
    tell("floor, before", floor(options.count))
    for name, (factor, with_cloth) in SERVERS.items():
        with other_process(put_on_the_wire, factor, with_cloth) as url:
            tell(name, ours(url, options.count) | peer(url, options.count))
    tell("floor, after", floor(options.count))
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    for what, key in (("in the median", "median_ms"), ("at the 99th percentile", "p99_ms")):
        worst = max(row[key] for name in SERVERS for row in report[name].values())
        print(f"goal {GOAL_MS} ms: {'met' if worst < GOAL_MS else 'missed'} {what} of all ({worst} ms)")


if __name__ == "__main__":
    main()
