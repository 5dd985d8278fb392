"""RobotServer: a robot, most often a simulated one, on the wire."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque

from nuno.errors import InvalidInputError, MessageError
from nuno.robot.interface import RobotInterface
from nuno.robot.known_joints import TICK
from nuno.robot.wire import messages as ros
from nuno.robot.wire.bridge import Bridge
from nuno.robot.wire.bridge_client import UNANSWERED, Client
from nuno.robot.wire.broadcast import Broadcast
from nuno.robot.wire.commands import Commands
from nuno.robot.wire.names import ADVANCE, CLOCK_KIND, RUNNING, STEPPED, Names
from nuno.robot.wire.protocol import Message
from nuno.validation import number

logger = logging.getLogger(__name__)

CHANGES = ("send_action_goal", "cancel_action_goal", "publish")
"""Messages after which a robot may want to be elsewhere, though no time has passed."""
OFTEN = 0.004
"""[s] Of real time, at least, between two publications of a simulation that runs faster than its ticks are long."""
STALE = 0.5
"""[s] Of the robot's time, at most, between two publications."""
YIELD = 1e-5
"""[s] In which a program that wants the robot's lock gets its turn, though the simulation is late."""
LATE = 0.25
"""[s] A simulation that is later than this behind real time gives the lost time up."""
LONGEST = 3600.0
"""[s] The longest time that a client may ask for at once."""


class RobotServer:
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

    Raises:
        MissingPackageError: websockets is not installed.
        NotConnectedError: the port is taken, or the address is not this machine's.
        InvalidInputError: a value out of range.
    """

    def __init__(
        self, robot: RobotInterface, host: str = "127.0.0.1", port: int = 9090, *,
        real_time_factor: float | None = 1.0, names: Names | None = None, max_message: int = 2**23,
        alive: float = 20.0, tick: float | None = None, origins: tuple[str, ...] = (),
    ) -> None:  # fmt: skip
        if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
            raise InvalidInputError(f"port must be a whole number in [0, 65535], got {port!r}")
        self._factor: float | None = real_time_factor
        if real_time_factor is not None and real_time_factor != float("inf"):
            self._factor = number("real_time_factor", real_time_factor, above=0.0)
        own = 1.0 / robot.world.frame_rate if hasattr(robot, "world") else TICK
        self.tick = own if tick is None else number("tick", tick, above=0.0)
        self.robot, self.lock = robot, threading.RLock()
        self.error: Exception | None = None
        self._inbox: deque[tuple[Client, Message | None] | None] = deque()
        self._waiting: list[tuple[Client, Message, float]] = []
        alive = number("alive", alive, above=0.0)
        self._bridge = Bridge(self._receive, self._left, host, port, max_message, alive, origins)
        try:
            self._begin(names or Names())
        except BaseException:
            self._bridge.close()
            raise

    def __enter__(self) -> RobotServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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

    @property
    def alive(self) -> bool:
        """Return whether it serves: until ``close``, or until the simulation failed, which ``error`` then tells."""
        return self._thread.is_alive()

    def close(self) -> None:
        """Stop what clients have asked for, disconnect them and end; a second time does nothing."""
        self._inbox.append(None)
        self._bridge.wake()
        self._thread.join()
        self._bridge.close()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until it has ended, up to ``timeout`` [s]; returns whether it has.

        Raises:
            Exception: what the simulation failed with.
        """
        self._thread.join(timeout)
        if self.error is not None:
            raise self.error
        return not self._thread.is_alive()

    def _begin(self, names: Names) -> None:
        controllers = [client.controller for client in self.robot.controller_actions]
        self._broadcast = Broadcast(self.robot, self._bridge, names, controllers)
        is_stepped = self._factor is None
        self._next_tick = time.perf_counter()
        self._published = self._next_tick, self.robot.now()
        self._commands = Commands(
            self.robot, self._broadcast, names, controllers, {ADVANCE: self._wait} if is_stepped else {}
        )
        kind = {"kind": STEPPED if is_stepped else RUNNING, "tick": self.tick}
        self._bridge.publish(CLOCK_KIND, {"data": json.dumps(kind)}, latched=True)
        self._commands.settle()
        self._thread = threading.Thread(target=self._run, name="nuno-server", daemon=True)
        self._thread.start()

    # In the thread that watches the bridge's sockets: most often the server's own

    def _receive(self, client: Client, message: Message) -> None:
        self._inbox.append((client, message))

    def _left(self, client: Client) -> None:
        self._inbox.append((client, None))

    # In the server's own thread

    def _run(self) -> None:
        try:
            while self._listen():
                with self.lock:
                    self._tick()
                if self._factor is not None and not self._commands.has_ended:  # a result comes after its last state
                    self._catch_up()
                with self.lock, self._bridge.together():
                    self._tell()
            with self.lock:
                self._commands.stop()
        except Exception as error:
            logger.exception("the robot's simulation failed")
            self.error = error
            self._bridge.close(f"{type(error).__name__}: {error}")

    def _listen(self) -> bool:
        """Deal with what has come, and then with what comes until the next tick is due; returns whether to go on."""
        self._bridge.pump(0.0)
        present = len(self._inbox)
        while True:
            left = self._due() - time.perf_counter()
            if present <= 0 and left <= 0.0:
                time.sleep(YIELD)
                return True
            if not self._inbox:
                self._bridge.pump(left)
                continue
            present -= 1
            got = self._inbox.popleft()
            if got is None:
                return False
            self._deal(*got)

    def _due(self) -> float:
        """Return when the next tick is due [s] of ``time.perf_counter``; without anyone who waits, never."""
        if self._factor is None:
            return 0.0 if self._waiting else float("inf")
        return self._next_tick

    def _deal(self, client: Client, message: Message | None) -> None:
        with self.lock, self._bridge.together():
            if message is None:
                self._waiting = [own for own in self._waiting if own[0] is not client]
                self._commands.leave(client)
            else:
                self._commands.handle(client, message)
                if self._factor is None and not self._waiting and message["op"] in CHANGES:
                    self._broadcast.publish()  # no tick comes that would show it
            self._commands.settle()
            if message is not None:
                client.done()

    def _tick(self) -> None:
        if self._factor is None:
            span = min(self.tick, max(0.0, min(end for _, _, end in self._waiting) - self.robot.now()))
        else:
            span = self.tick
            self._next_tick = max(self._next_tick, time.perf_counter() - LATE) + span / self._factor
        if span > 0.0:
            self.robot.sleep(span)

    def _catch_up(self) -> None:
        """Deal with what has come meanwhile: nobody is to wait for all that is published as well."""
        self._bridge.pump(0.0)
        for _ in range(len(self._inbox)):
            got = self._inbox[0]
            if got is None:
                return
            self._inbox.popleft()
            self._deal(*got)

    def _tell(self) -> None:
        now, wall = self.robot.now(), time.perf_counter()
        old = wall - self._published[0] >= OFTEN or now - self._published[1] >= STALE
        if self._factor is None or old or self._commands.has_ended:
            self._published = wall, now
            self._broadcast.publish()
        self._commands.settle()
        for own in [own for own in self._waiting if now >= own[2] - 1e-9]:
            self._waiting.remove(own)
            client, message, _ = own
            client.answer(message, {"time": ros.time_fields(now)})

    def _wait(self, client: Client, message: Message) -> None:
        """Let time pass for a client, who gets an answer when it has."""
        span = ros.seconds(message.get("args"), "duration")
        if not 0.0 <= span <= LONGEST:
            raise MessageError(f"duration must lie in [0, {LONGEST:g}] s, got {span:g} s")
        if sum(own is client for own, _, _ in self._waiting) >= UNANSWERED:
            raise MessageError(f"a client may wait for {UNANSWERED} times at once, no more")
        self._waiting.append((client, message, self.robot.now() + span))
