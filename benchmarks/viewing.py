"""What it costs a world to be looked at: its frames' time with a viewer and without, in turns.

    python benchmarks/viewing.py --json out.json

Talos stands at a table with a towel of 30 by 20 cells and a soft cube on it, and moves an arm; a page (here: a reader
of its messages, in a process of its own, as a browser is) is connected. Each round times the same frames without a
viewer, with one, with contacts in it, and with a recording; the middle of the rounds' ratios is told. "paced" steps
once a real 1/60 s, as a world in the background does, so that the viewer's own work falls between the frames; "unpaced"
never pauses.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np

FRAME = 1.0 / 60.0


def make():
    """The world, and what moves the robot in each frame."""
    import nuno

    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.7, 1.2, 0.02), name="table", position=(0.75, 0, 0.71)))
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(30, 20), name="towel", position=(0.75, 0.2, 0.73)))
    cube = world.add(nuno.soft_box((0.14, 0.14, 0.14), cells=(4, 4, 4), name="cube", position=(0.75, -0.4, 0.8)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    world.attach(cube)
    robot = nuno.Humanoid("talos")
    links = robot.enter(world)

    def tick(k: int) -> None:
        robot.angle_vector({"arm_left_4_joint": -1.0 - 0.5 * np.sin(0.05 * k)})
        links.follow(FRAME)

    return world, tick


def read(url: str, pipe: Any) -> None:
    """Receive what a page would, until the viewer is closed, and tell how long [bytes] each message was."""
    sizes: list[int] = []
    from tornado.websocket import websocket_connect

    async def receive() -> None:
        socket = await websocket_connect(url.replace("http", "ws") + "feed", max_message_size=1 << 27)
        while (message := await socket.read_message()) is not None:
            sizes.append(len(message))

    asyncio.run(receive())
    pipe.send(sizes)


@contextmanager
def reader(viewer: Any, sizes: list[int]) -> Iterator[None]:
    """A page that is connected meanwhile; the sizes of the messages that it got are added at the end."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=read, args=(viewer.url, there))
    process.start()
    while not viewer.page_count:
        time.sleep(0.01)
    time.sleep(0.5)
    yield
    viewer.close()
    sizes += here.recv()
    process.join()


def timed(world, tick, frames: int, paced: bool) -> tuple[float, float, float]:
    """Of a frame: its time, the time that its thread had a core, and the time that the process had cores in all."""
    spent = 0.0
    begin, used, own = time.perf_counter(), time.process_time(), time.thread_time()
    for k in range(frames):
        start = time.perf_counter()
        tick(k)
        world.step()
        spent += time.perf_counter() - start
        if paced:
            time.sleep(max(0.0, begin + (k + 1) * FRAME - time.perf_counter()))
    return spent / frames, (time.thread_time() - own) / frames, (time.process_time() - used) / frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--frames", type=int, default=180)
    parser.add_argument("--json")
    options = parser.parse_args()
    from nuno.viewer import Viewer

    world, tick = make()
    timed(world, tick, 60, False)
    rows = []
    for paced in (True, False):
        times: dict[str, list[tuple[float, float, float]]] = {}
        sizes: list[int] = []
        watched: list[float] = []
        for _ in range(options.rounds):
            for case in ("alone", "viewer", "contacts", "recording"):
                with ExitStack() as stack:
                    if case != "alone":
                        viewer = stack.enter_context(Viewer(world, contacts=case == "contacts"))
                        stack.enter_context(reader(viewer, sizes if case == "viewer" else []))
                        if case == "recording":
                            film = viewer.record()
                            stack.callback(film.stop)
                    begin = time.perf_counter()
                    times.setdefault(case, []).append(timed(world, tick, options.frames, paced))
                    if case == "viewer":
                        watched.append(time.perf_counter() - begin)
        alone = np.array(times["alone"])
        for case, found in times.items():
            step, thread, process = 100.0 * (np.median(np.array(found) / alone, axis=0) - 1.0)
            rows.append({
                "paced": paced, "case": case, "frame_ms": 1e3 * float(np.median(np.array(found)[:, 0])),
                "frame_more_percent": float(step), "its_thread_more_percent": float(thread),
                "process_more_percent": float(process),
            })  # fmt: skip
            print(rows[-1])
        rate = len(sizes) / sum(watched)
        print(f"{rate:.0f} messages a second of {np.median(sizes) / 1e3:.1f} kB, the first {max(sizes) / 1e6:.1f} MB")
    if options.json:
        with open(options.json, "w") as file:
            json.dump(rows, file, indent=2)


if __name__ == "__main__":
    main()
