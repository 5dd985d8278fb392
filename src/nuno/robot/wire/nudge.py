"""Nudge: wakes a thread that waits for sockets."""

from __future__ import annotations

import socket
from contextlib import suppress


class Nudge:
    """A socket pair that a selector watches, so that other threads can wake who waits there."""

    def __init__(self) -> None:
        self._out, self._in = socket.socketpair()
        self._out.setblocking(False)
        self._in.setblocking(False)

    def fileno(self) -> int:
        """Return what selectors want to know."""
        return self._in.fileno()

    def give(self) -> None:
        """Wake who waits; from any thread, also when it is too late."""
        with suppress(OSError):  # full of nudges that are not taken yet, or closed
            self._out.send(b"\0")

    def take(self) -> None:
        """Forget the nudges there were, so that the next wait is one."""
        with suppress(OSError):
            self._in.recv(4096)

    def close(self) -> None:
        """End it."""
        self._out.close()
        self._in.close()
