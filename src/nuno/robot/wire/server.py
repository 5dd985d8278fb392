"""RobotServer: a robot, most often a simulated one, on the wire."""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import time
from concurrent.futures import Future
from contextlib import suppress

import numpy as np

from nuno.errors import InvalidInputError, MessageError
from nuno.robot.interface import RobotInterface
from nuno.robot.serving import Serving
from nuno.robot.wire import messages as ros
from nuno.robot.wire.bridge import Bridge
from nuno.robot.wire.bridge_client import Client
from nuno.robot.wire.broadcast import Broadcast
from nuno.robot.wire.commands import Commands
from nuno.robot.wire.names import ADVANCE, CLOCK_KIND, RUNNING, STEPPED, Names
from nuno.robot.wire.protocol import Message
from nuno.validation import checked, number

logger = logging.getLogger(__name__)

CHANGES = ("send_action_goal", "cancel_action_goal", "publish")
"""Messages after which a robot may want to be elsewhere, though no time has passed."""
OFTEN = 0.004
"""[s] Of real time, at least, between two publications of a simulation that runs faster than its ticks are long."""
SHARE = 2.0
"""Times as long as a publication takes, at least, until the next: many subscribers slow it down, not the clock."""
STALE = 0.5
"""[s] Of the robot's time, at most, between two publications."""
LOOP_PASSES = 3
"""Of the event loop, that a message needs from the socket to its handler; so many pass before a tick that is due."""
PATIENCE = 1e-3
"""[s] Between two looks at whether a program has given the robot's lock back."""
WAITS = 64
"""So many times a client may wait for at once."""
YIELD = 1e-5
"""[s] In which a program that wants the robot's lock gets its turn, though the simulation is late."""
LATE = 0.25
"""[s] A simulation that is later than this behind real time gives the lost time up."""
LONGEST = 3600.0
"""[s] The longest time that a client may ask for at once."""


RealTimeFactor = float | None
"""Simulated over real time; infinite where nothing waits."""


class RobotServer(Serving):
    """A server of the rosbridge protocol, to which any number of programs may connect, in Python or not.

    From when it is made, the robot belongs to a thread of the server, which does one thing after another: what clients
    ask, and ticks of the simulation. A program that made the server and uses the robot or its world itself holds
    ``lock`` meanwhile.

    All clients may listen. Each controller, each hand and the base does what it was asked for last, by whomever; what
    it did before ends as preempted. When a client goes, or is lost, what it asked for stops, and the joints hold
    where they are; hands keep what they hold.

    Args:
        robot: The robot, whose ``sleep`` lets its simulation go on, as fast as it can.
        host: The address to listen at; by default only programs of this machine can connect.
        port: [0, 65535]; 0 takes a free one, which ``port`` tells.
        real_time_factor: Simulated over real time; ``inf`` is as fast as possible. None lets time pass only while a
            client waits for it, as in a program that has the simulation in itself: a ``WireRobot`` does, at full speed.
        names: Of topics and actions.
        max_message: Size of the longest message that is read [bytes]; who sends a longer one is disconnected.
        alive: A client that is silent for so long [s], not answering pings either, is gone.
        tick: Between two looks at the robot [s]; None takes the frames of the robot's world, else 0.01 s.
        origins: Web pages that may connect, as browsers name them ("http://localhost:8080"); by default none, for any
            page that somebody looks at on this machine could.
        image_rate: Images a second of the robot's time, of every camera that a client looks through.

    Raises:
        MissingPackageError: websockets is not installed.
        NotConnectedError: the port is taken, or the address is not this machine's.
        InvalidInputError: a value out of range.
    """

    @checked
    def __init__(
        self, robot: RobotInterface, host: str = "127.0.0.1", port: int = 9090, *,
        real_time_factor: RealTimeFactor = 1.0, names: Names | None = None, max_message: int = 2**23,
        alive: float = 20.0, tick: float | None = None, origins: tuple[str, ...] = (), image_rate: float = 10.0,
    ) -> None:  # fmt: skip
        if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
            raise InvalidInputError(f"port must be a whole number in [0, 65535], got {port!r}")
        self._factor: float | None = real_time_factor
        if real_time_factor is not None and not (isinstance(real_time_factor, float) and np.isposinf(real_time_factor)):
            self._factor = number("real_time_factor", real_time_factor, above=0.0)
        super().__init__(robot, tick)
        self._waiting: list[tuple[Client, Message, float]] = []
        alive = number("alive", alive, above=0.0)
        self._bridge = Bridge(self._deal, self._left, host, port, max_message, alive, origins)
        self._begin(names or Names(), number("image_rate", image_rate, above=0.0))

    def __repr__(self) -> str:
        return f"<RobotServer of {self.robot.robot.name!r} at {self.url}>"

    @property
    def port(self) -> int:
        """Return where it listens."""
        return self._bridge.port

    @property
    def url(self) -> str:
        """Return where a ``WireRobot`` finds it."""
        host = self._bridge.host
        return f"ws://[{host}]:{self.port}" if ":" in host else f"ws://{host}:{self.port}"

    def close(self) -> None:
        """Stop what clients have asked for, disconnect them and end; a second time does nothing."""
        if self._thread.is_alive():
            with suppress(RuntimeError):  # it has ended meanwhile
                self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join()

    def _begin(self, names: Names, image_rate: float) -> None:
        controllers = [client.controller for client in self.robot.controller_actions]
        self._broadcast = Broadcast(self.robot, self._bridge, names, controllers, image_rate)
        is_stepped = self._factor is None
        self._next_tick = time.perf_counter()
        self._published, self._cost = (self._next_tick, self.robot.now()), 0.0
        self._commands = Commands(
            self.robot, self._broadcast, names, controllers, {ADVANCE: self._wait} if is_stepped else {}
        )
        kind = {"kind": STEPPED if is_stepped else RUNNING, "tick": self.tick}
        self._bridge.publish(CLOCK_KIND, {"data": json.dumps(kind)}, latched=True)
        self._commands.settle()
        listening: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, args=(listening,), name="nuno-server", daemon=True)
        self._thread.start()
        listening.result()

    # In the server's own thread, which runs an event loop: clients are served between ticks

    def _run(self, listening: Future[None]) -> None:
        try:
            asyncio.run(self._serve(listening))
        except Exception as error:
            self.error = error
            if not listening.done():
                self.error = None
                listening.set_exception(error)

    async def _serve(self, listening: Future[None]) -> None:
        self._loop, self._closing, self._asked = asyncio.get_running_loop(), asyncio.Event(), asyncio.Event()
        await self._bridge.open()
        listening.set_result(None)
        closing, simulation = asyncio.create_task(self._closing.wait()), asyncio.create_task(self._simulate())
        await asyncio.wait((closing, simulation), return_when=asyncio.FIRST_COMPLETED)
        error = simulation.exception() if simulation.done() else None
        for task in (closing, simulation):
            task.cancel()
        if error is not None:
            logger.error("the robot's simulation failed", exc_info=error)
            await self._bridge.close(f"{type(error).__name__}: {error}")
            raise error
        await self._take_lock()
        try:
            self._commands.stop()
        finally:
            self.lock.release()
        await self._bridge.close()

    async def _simulate(self) -> None:
        """Let time pass, tick by tick."""
        while True:
            await self._until_due()
            await self._take_lock()
            try:
                self._tick()
                self._tell()
            finally:
                self.lock.release()

    async def _until_due(self) -> None:
        """Let clients be served until the next tick is due; without anyone who waits, it never is."""
        if self._factor is None:
            await self._asked.wait()
        for _ in range(LOOP_PASSES):
            await asyncio.sleep(0.0)
        if self._factor is not None and (left := self._next_tick - time.perf_counter()) > 0.0:
            await asyncio.sleep(left)
        else:
            time.sleep(YIELD)

    async def _take_lock(self) -> None:
        """Take the robot from a program that uses it; connections are kept meanwhile."""
        while not self.lock.acquire(blocking=False):
            await asyncio.sleep(PATIENCE)

    async def _deal(self, client: Client, message: Message) -> None:
        """Do what a client asks."""
        await self._take_lock()
        try:
            if message["op"] == "subscribe":
                if self._bridge.resend(message["topic"], client):  # nothing has changed, nobody else needs it
                    return
            else:
                self._bridge.forget()
            self._commands.handle(client, message)
            if self._factor is None and not self._waiting and message["op"] in CHANGES:
                self._broadcast.publish()  # no tick comes that would show it
            self._commands.settle()
        finally:
            self.lock.release()

    async def _left(self, client: Client) -> None:
        await self._take_lock()
        try:
            self._waiting = [own for own in self._waiting if own[0] is not client]
            if not self._waiting:
                self._asked.clear()
            self._commands.leave(client)
            self._commands.settle()
        finally:
            self.lock.release()

    def _tick(self) -> None:
        if self._factor is None:
            span = min(self.tick, max(0.0, min(end for _, _, end in self._waiting) - self.robot.now()))
        else:
            span = self.tick
            self._next_tick = max(self._next_tick, time.perf_counter() - LATE) + span / self._factor
        if span > 0.0:
            self.robot.sleep(span)

    def _tell(self) -> None:
        now, wall = self.robot.now(), time.perf_counter()
        old = wall - self._published[0] >= max(OFTEN, SHARE * self._cost) or now - self._published[1] >= STALE
        if self._factor is None or old or self._commands.has_ended:  # a result comes after its last state
            self._published = wall, now
            self._bridge.forget()
            self._broadcast.publish()
            begin = time.perf_counter()
            self._bridge.flush()
            self._cost = self._broadcast.seconds + time.perf_counter() - begin
        self._commands.settle()
        for own in [own for own in self._waiting if now >= own[2] - 1e-9]:
            self._waiting.remove(own)
            client, message, _ = own
            client.answer(message, {"time": ros.time_fields(now)})
        if not self._waiting:
            self._asked.clear()

    def _wait(self, client: Client, message: Message) -> None:
        """Let time pass for a client, who gets an answer when it has."""
        span = ros.seconds(message.get("args"), "duration")
        if not 0.0 <= span <= LONGEST:
            raise MessageError(f"duration must lie in [0, {LONGEST:g}] s, got {span:g} s")
        if sum(own is client for own, _, _ in self._waiting) >= WAITS:
            raise MessageError(f"a client may wait for {WAITS} times at once, no more")
        self._waiting.append((client, message, self.robot.now() + span))
        self._asked.set()
