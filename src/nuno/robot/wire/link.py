"""Link: one end of a websocket, on which any thread sends without waiting and one reads."""

from __future__ import annotations

import socket
import ssl
import threading
import time
from typing import Any

from nuno.robot.wire.outbox import KEPT, Outbox

PIECE = 2**16
"""[bytes] That are taken from a socket at once."""
CLOSING = 1.0
"""[s] That the other side has to answer when this one closes."""
CONTROL = 2**16
"""[bytes] Of pongs that wait for a peer that asks for them without end and reads none."""
BATCH = 2**14
"""[bytes] That texts are sent together up to."""
BLOCKED = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class Link:
    """A websocket over a socket that never waits.

    What is sent goes out in the thread that sends it, as far as the socket takes it: to wake another thread for that
    would take longer than all the rest. What the socket does not take waits here until ``flush`` is called, by
    whoever watches the socket.

    Args:
        own: The socket; connected.
        protocol: A ``ServerProtocol`` or ``ClientProtocol`` of websockets.
        alive: Who answers no ping for so long [s] is no longer there.
        opening: So long [s] the other side has until both agree on a websocket.
    """

    def __init__(self, own: socket.socket, protocol: Any, alive: float, opening: float) -> None:
        own.setblocking(False)
        # a message is to leave now, not together with the next once the last was acknowledged
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket, self._protocol, self._alive = own, protocol, alive
        self._lock = threading.Lock()  # of all below, and of the socket: TLS may not be used by two threads at once
        self._outbox = Outbox()
        self._rest = bytearray()  # of what is being sent, in whole frames but for the first
        self._control = 0  # bytes in it that the other side caused
        self._parts: list[bytes] = []  # of a message in several frames
        self._is_over = self._half_closed = False
        self._given_up = ""  # why this side ended it without a word
        self._opening, self._close_by = opening, time.monotonic() + opening
        self._asked: float | None = None  # since when a ping is unanswered
        self._ping_due = time.monotonic() + alive / 4

    def fileno(self) -> int:
        """Return what selectors want to know."""
        return self._socket.fileno()

    @property
    def waiting(self) -> int:
        """Return how many texts wait that were not begun to be sent."""
        return len(self._outbox)

    @property
    def wants_room(self) -> bool:
        """Return whether something waits for room in the socket, so that ``flush`` is to be called when there is."""
        return bool(self._rest) and not self._is_over

    @property
    def is_open(self) -> bool:
        """Return whether both sides have agreed on a websocket, and neither has ended it."""
        return self._is_open()

    @property
    def is_over(self) -> bool:
        """Return whether nothing will come any more; then ``shut`` it."""
        return self._is_over

    @property
    def end(self) -> str:
        """Return why it ended, as far as either side said."""
        protocol = self._protocol
        if self._given_up:
            return self._given_up
        if protocol.handshake_exc is not None:
            return str(protocol.handshake_exc)
        if protocol.close_rcvd is None and protocol.close_sent is not None:
            return f"given up, code {protocol.close_sent.code}, {protocol.close_sent.reason}"
        if protocol.close_code in (None, 1006):
            return "the other side went away without a word"
        reason = protocol.close_reason
        return f"the other side closed it, code {protocol.close_code}{reason and ', '}{reason}"

    def greet(self) -> None:
        """Ask the other side for a websocket, as a client."""
        with self._lock:
            self._protocol.send_request(self._protocol.connect())
            self._collect()
            self._send()

    def add(self, text: str, topic: str | None = None, keep: int = KEPT) -> None:
        """Let a text wait for the next ``flush``; from any thread.

        Args:
            text: What is sent.
            topic: Of a publication: then only ``keep`` of one topic wait.
            keep: How many.
        """
        with self._lock:
            if not self._is_over and not self._outbox.add(text, topic, keep):
                self._give_up("it reads too slowly")

    def flush(self) -> None:
        """Send what waits, as far as the socket takes it; from any thread."""
        with self._lock:
            self._send()

    def read(self) -> list[bytes]:
        """Take in what has come, and return the messages in it, in the thread that watches the socket."""
        with self._lock:
            if self._is_over:
                return []
            data = self._receive()
            if data is None:
                return []
            if data:
                self._asked = None
                self._protocol.receive_data(data)
            else:
                self._end()
            messages = [message for event in self._protocol.events_received() for message in self._take(event)]
            before = len(self._rest)
            self._collect()
            self._control += len(self._rest) - before
            self._send()
            if self._control > CONTROL:
                self._give_up("it reads too slowly")
            if self._protocol.close_expected():
                self._close_by = min(self._close_by, time.monotonic() + CLOSING)
                if self._half_closed and not self._rest and self._protocol.close_rcvd is not None:
                    self._end()  # both have said goodbye
        return messages

    def look(self, now: float) -> None:
        """Ping where that is due, and end what does not answer; in the thread that watches the socket.

        Args:
            now: [s] of ``time.monotonic``.
        """
        with self._lock:
            if self._is_over:
                return
            if now > self._close_by:
                if not self._protocol.close_expected():
                    self._given_up = f"no answer within {self._opening:g} s"
                self._end()
            elif self._asked is not None and now - self._asked > self._alive:
                self._protocol.fail(1011, "keepalive ping timeout")
                self._collect()
                self._send()
                self._end()
            elif now >= self._ping_due and self._is_open():
                self._ping_due = now + self._alive / 4
                self._asked = now if self._asked is None else self._asked
                self._protocol.send_ping(b"")
                self._collect()
                self._send()

    def forgive(self) -> None:
        """Forget that a ping is unanswered: the answer was not read."""
        self._asked = None

    def close(self, code: int, reason: str) -> None:
        """Say goodbye; the link is over when the other side does too, or after a second."""
        with self._lock:
            self._outbox.clear()
            if self._is_open():
                self._protocol.send_close(code, reason.encode()[:120].decode(errors="ignore"))
                self._collect()
                self._send()
            self._close_by = time.monotonic() + CLOSING

    def abort(self) -> None:
        """End it without a word."""
        with self._lock:
            self._give_up("it was given up")

    def shut(self) -> None:
        """Let the socket go."""
        with self._lock:
            self._end()
            self._socket.close()

    # Under the lock

    def _is_open(self) -> bool:
        return self._protocol.state.name == "OPEN" and not self._is_over

    def _receive(self) -> bytes | None:
        """Return what has come, nothing at the end, None where there was nothing yet."""
        try:
            data = self._socket.recv(PIECE)
            while data and getattr(self._socket, "pending", int)():  # decrypted already: no selector would tell
                data += self._socket.recv(PIECE)
        except BLOCKED:
            return None
        except OSError:
            return b""
        return data

    def _take(self, event: Any) -> list[bytes]:
        """Return the message that an event completes."""
        name = type(event).__name__
        if name == "Request":
            self._protocol.send_response(self._protocol.accept(event))
        if name in ("Request", "Response") and self._is_open():
            self._close_by = float("inf")
        elif name == "Frame" and event.opcode.name in ("TEXT", "BINARY", "CONT"):
            if event.data:
                self._parts.append(bytes(event.data))
            if event.fin:
                whole, self._parts = b"".join(self._parts), []
                return [whole]
        return []

    def _collect(self) -> None:
        """Take from the protocol what is to be sent."""
        for piece in self._protocol.data_to_send():
            if piece:
                self._rest += piece
            else:
                self._half_closed = True

    def _send(self) -> None:
        while not self._is_over:
            while self._outbox and len(self._rest) < BATCH and self._is_open():
                self._protocol.send_text(self._outbox.pop().encode())
                self._collect()
            if not self._rest:
                self._control = 0
                if self._half_closed:
                    self._say_end()
                return
            try:
                del self._rest[: self._socket.send(self._rest)]
            except BLOCKED:
                return
            except OSError:
                self._give_up("the connection broke")

    def _say_end(self) -> None:
        try:
            self._socket.shutdown(socket.SHUT_WR)
        except OSError:
            self._end()

    def _give_up(self, reason: str) -> None:
        self._given_up = self._given_up or reason
        self._end()
        try:
            self._socket.shutdown(socket.SHUT_RDWR)  # which whoever watches the socket notices
        except OSError:
            return

    def _end(self) -> None:
        if not self._is_over:
            self._is_over = True
            self._rest.clear()
            self._outbox.clear()
            self._protocol.receive_eof()
