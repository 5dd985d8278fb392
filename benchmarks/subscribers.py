"""How 200 subscribers and a long goal hold a robot's server up: ``python benchmarks/subscribers.py [--count 200]``.

A server with a simulated Talos in real time, and in another process all clients, which read what comes. Of each load:
simulated seconds in one real second, processor seconds of the server in one, and the longest that a service
(``get_time``) took of another client, asked 20 times a second. The clients need as much of a processor as the server.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import multiprocessing
import time
from typing import Any

import psutil

SPAN = 6.0  # [s] each load is looked at
TOPICS = (["/joint_states"], ["/joint_states", "/tf", "/odom", "/clock"])
POINTS = 60_000
ACTION = "/larm_controller/follow_joint_trajectory"


def serve(pipe: Any) -> None:
    """Serve a Talos until the pipe says otherwise."""
    import nuno

    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), nuno.World(device="cpu"))
    with nuno.RobotServer(robot, port=0) as server:
        gc.freeze()
        pipe.send(server.url)
        pipe.recv()


def long_goal(count: int) -> str:
    """Return a goal of many points, as a client sends it."""
    points = [{"positions": [0] * 7, "time_from_start": {"sec": k + 1, "nanosec": 0}} for k in range(count)]
    joints = [f"arm_left_{k}_joint" for k in range(1, 8)]
    return json.dumps({
        "op": "send_action_goal", "id": "g", "action": ACTION, "args": {"trajectory": {"joint_names": joints,
        "points": points}}, "action_type": "control_msgs/action/FollowJointTrajectory",
    })  # fmt: skip


def listen(url: str, count: int, topics: list[str], ready: Any, over: Any) -> None:
    """Let many clients read topics until it is over."""
    from websockets.asyncio.client import connect

    there = 0

    async def read(few: asyncio.Semaphore) -> None:
        nonlocal there
        async with few:  # at a time
            client = await connect(url, compression=None, max_size=None, open_timeout=60)
            for topic in topics:
                await client.send(json.dumps({"op": "subscribe", "topic": topic}))
            await client.recv()
        there += 1
        while True:
            await client.recv()

    async def run() -> None:
        few = asyncio.Semaphore(5)
        tasks = [asyncio.create_task(read(few)) for _ in range(count)]
        while there < count:
            await asyncio.sleep(0.05)
        ready.set()
        while not over.is_set():
            await asyncio.sleep(0.1)
        for task in tasks:
            task.cancel()

    asyncio.run(run())


class Watch:
    """A client that asks what time it is."""

    def __init__(self, url: str, process: psutil.Process) -> None:
        from websockets.sync.client import connect

        self._socket, self._process = connect(url, compression=None), process

    def ask(self) -> tuple[float, float]:
        """Return the simulated time [s], and how long the answer took [s]."""
        begin = time.perf_counter()
        self._socket.send('{"op": "call_service", "id": "t", "service": "/rosapi/get_time"}')
        told = json.loads(self._socket.recv(60.0))["values"]["time"]
        return told["sec"] + 1e-9 * told["nanosec"], time.perf_counter() - begin

    def look(self, what: str, begin: Any = lambda: None) -> None:
        """Print a row on ``SPAN`` seconds that begin with something."""
        first, wall, used = self.ask()[0], time.perf_counter(), sum(self._process.cpu_times()[:2])
        begin()
        longest = 0.0
        while time.perf_counter() - wall < SPAN:
            longest = max(longest, self.ask()[1])
            time.sleep(0.05)
        span, last = time.perf_counter() - wall, self.ask()[0]
        spent = sum(self._process.cpu_times()[:2]) - used
        print(f"| {what} | {(last - first) / span:.2f} | {spent / span:.2f} | {1e3 * longest:.0f} |", flush=True)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="of subscribers (default 200)")
    options = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    pipe, theirs = context.Pipe()
    server = context.Process(target=serve, args=(theirs,))
    server.start()
    url = pipe.recv()
    watch = Watch(url, psutil.Process(server.pid))
    print(
        f"| load ({psutil.getloadavg()[0]:.0f} on {psutil.cpu_count()} cores) | simulated s per s | CPU s per s | ms |"
    )
    print("|---|---|---|---|")
    watch.look("nobody else")
    from websockets.sync.client import connect

    with connect(url, compression=None, max_size=None) as sender:
        text = long_goal(POINTS)
        watch.look(f"a goal of {POINTS} points, {len(text) / 1e6:.1f} MB", lambda: sender.send(text))
    for topics in TOPICS:
        ready, over = context.Event(), context.Event()
        others = context.Process(target=listen, args=(url, options.count, topics, ready, over))
        others.start()
        ready.wait(60.0)
        watch.look(f"{options.count} subscribers of {', '.join(topics)}")
        over.set()
        others.terminate()
        others.join()
    pipe.send("end")
    server.join()


if __name__ == "__main__":
    main()
