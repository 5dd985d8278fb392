"""Client: a program that has connected to a bridge, as the bridge sees it."""

from __future__ import annotations

import asyncio
import logging
import threading
from dataclasses import dataclass, field
from typing import Any

from nuno.robot.wire.outbox import KEPT, Outbox
from nuno.robot.wire.protocol import Message, encode

logger = logging.getLogger(__name__)

MAX_WARNINGS = 20
"""So many of what one client does wrong the log warns of; nobody is to fill disks."""
AHEAD = 2**15
"""[bytes] That are handed to the system before it has taken them; what comes after that waits in the outbox."""
OPEN = "OPEN"
"""The state of a connection that may be written to."""
CONTROL = 2**16
"""[bytes] Of pongs that wait for a client that asks for them without end and reads none."""


@dataclass(eq=False)
class Subscription:
    """A client's subscription to a topic.

    Attributes:
        interval: Shortest time between two messages [s].
        keep: How many messages wait for a slow reader.
        ids: By which the client calls it; the subscription ends with the last.
        sent: When the last message was sent [s], of ``time.monotonic``.
    """

    interval: float = 0.0
    keep: int = KEPT
    ids: set[str | int | None] = field(default_factory=set)
    sent: float = -1e9


class Client:
    """One that has connected.

    What is sent in one turn of the event loop goes to the socket together at its end. What a slow reader has not taken
    waits here, bounded, until ``look`` finds room.

    Args:
        connection: To it, of the websockets package.
    """

    def __init__(self, connection: Any) -> None:
        self.connection = connection
        address = connection.remote_address or ("unknown",)
        self.name = ":".join(str(part) for part in address[:2])
        self.subscriptions: dict[str, Subscription] = {}
        self.outbox = Outbox()
        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        self._frames: list[bytes] = []  # of this turn of the event loop
        self._gathered = 0  # their size [bytes]
        self._max_frame = 0  # message that was written [bytes]
        self._complaints = 0

    def __repr__(self) -> str:
        return f"<Client {self.name}>"

    def send(self, message: Message) -> None:
        """Send a message that may not be lost; from any thread."""
        frame = frame_of(encode(message))
        if threading.get_ident() == self._thread:
            self.write(frame)
        else:
            self._loop.call_soon_threadsafe(self.write, frame)

    def write(self, frame: bytes, topic: str | None = None, keep: int = KEPT) -> None:
        """Send a frame in this turn of the event loop, or let it wait where the client reads slowly; in that thread.

        Args:
            frame: What is sent: one that others get too is made once.
            topic: Of a publication: then only ``keep`` of one topic wait.
            keep: How many.
        """
        if not self.outbox and self._waiting() < AHEAD:
            self._write(frame)
        elif not self.outbox.add(frame, topic, keep):
            self.abort("it reads too slowly")

    def flush(self) -> None:
        """Hand what was sent in this turn to the system."""
        frames, self._frames, self._gathered = self._frames, [], 0
        if frames and self.connection.state.name == OPEN:
            self.connection.transport.write(frames[0] if len(frames) == 1 else b"".join(frames))

    def look(self) -> None:
        """Send what waits, as far as the client reads; give up one that takes nothing."""
        while self.outbox and self._waiting() < AHEAD:
            self._write(self.outbox.pop())
        if self._waiting() > AHEAD + self._max_frame + CONTROL:
            self.abort("it reads too slowly")

    def abort(self, reason: str) -> None:
        """End the connection without a word to the client."""
        logger.warning("%s is disconnected: %s", self.name, reason)
        self.outbox.clear()
        self._frames = []
        self.connection.transport.abort()

    def answer(self, request: Message, values: Any, good: bool = True) -> None:
        """Answer the call of a service; what went wrong, where it did, is a text."""
        answer = {"op": "service_response", "service": request["service"], "values": values, "result": good}
        self.send(answer | identity_of(request))

    def complain(self, text: str, identity: str | int | None = None) -> None:
        """Tell the client what was wrong with a message of its."""
        self._complaints += 1
        logger.log(logging.WARNING if self._complaints <= MAX_WARNINGS else logging.DEBUG, "%s: %s", self.name, text)
        self.send({"op": "status", "level": "error", "msg": text} | identity_of({"id": identity}))

    def _waiting(self) -> int:
        size: int = self.connection.transport.get_write_buffer_size()
        return size + self._gathered

    def _write(self, frame: bytes) -> None:
        if not self._frames:
            self._loop.call_soon(self.flush)
        self._max_frame = max(self._max_frame, len(frame))
        self._frames.append(frame)
        self._gathered += len(frame)


def frame_of(text: str) -> bytes:
    """Return a text as a websocket's server sends it."""
    from websockets.frames import Frame, Opcode

    return Frame(Opcode.TEXT, text.encode()).serialize(mask=False)


def identity_of(message: Message) -> Message:
    """Return the id of a message, for the answer; empty where it has none."""
    return {} if message.get("id") is None else {"id": message["id"]}
