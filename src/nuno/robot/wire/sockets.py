"""Sockets: those that a server listens at and those of its clients, and who watches them."""

from __future__ import annotations

import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from nuno.robot.wire.bridge_client import Client
from nuno.robot.wire.listening import listen
from nuno.robot.wire.nudge import Nudge

logger = logging.getLogger(__name__)

LENT = 0.05
"""[s] Who watches the sockets in the place of their own thread is relied upon to do so again within this."""
LOOK = 0.25
"""[s] Between two looks at who is still there, at most."""
CLOSING = 1.2
"""[s] All have so long to say goodbye, a little longer than one has."""


class Sockets:
    """The sockets of a server, watched by a thread of their own from when they are made until ``close``.

    A program that would only wait for what clients send may watch them itself meanwhile, by ``pump``: then no thread
    has to be woken for a message.

    Args:
        host: The address to listen at.
        port: [0, 65535]; 0 takes a free one.
        alive: Who is silent for so long [s] is no longer there.
        welcome: Makes a client of a socket and its name.
        take: Called with a client and each of its messages, in the thread that watches, so it must not take long.
        left: Called likewise with each client that is no longer there.

    Raises:
        NotConnectedError: the port is taken, or the address is not this machine's.
    """

    def __init__(
        self, host: str, port: int, alive: float, welcome: Callable[[socket.socket, str], Client],
        take: Callable[[Client, bytes], None], left: Callable[[Client], None],
    ) -> None:  # fmt: skip
        self._alive, self._welcome, self._take, self._left = alive, welcome, take, left
        self.clients: set[Client] = set()
        self._calling: set[Client] = set()  # that are to be seen to
        self.listening = listen(host, port)
        self._selector, self._nudge = selectors.DefaultSelector(), Nudge()
        self._selector.register(self._nudge, selectors.EVENT_READ)
        self._is_listening = False
        self._look_due = 0.0
        self._watching = threading.Lock()  # whoever watches the sockets holds it
        self._lent = -1e9  # when another than their own thread last did
        self._over, self._closing = threading.Event(), threading.Lock()
        self._thread = threading.Thread(target=self._serve, name="nuno-bridge", daemon=True)
        self._thread.start()

    def close(self, code: int, reason: str) -> None:
        """Disconnect all, saying why, and end; a second time does nothing."""
        with self._closing:
            if self._over.is_set():
                return
            self._over.set()
            self._nudge.give()
            self._thread.join()
            with self._watching:
                self._say_goodbye(code, reason)

    def call(self, client: Client) -> None:
        """Let whoever watches see to a client; from any thread."""
        self._calling.add(client)
        self._nudge.give()

    def pump(self, timeout: float) -> None:
        """Pass on what has come, or what comes first within ``timeout`` [s], in the place of the sockets' own thread.

        One thread only may do so. When it has not for a twentieth of a second, their own does again.
        """
        self._lent = time.monotonic()
        if not self._watching.acquire(blocking=False):
            self._nudge.give()
            self._watching.acquire()
        try:
            if not self._over.is_set():
                self._pump(timeout)
        finally:
            self._lent = time.monotonic()
            self._watching.release()

    def wake(self) -> None:
        """Let ``pump`` return; from any thread."""
        self._nudge.give()

    def _serve(self) -> None:
        while not self._over.is_set():
            rest = self._lent + LENT - time.monotonic()
            if rest <= 0.0 and self._watching.acquire(blocking=False):
                try:
                    self._pump(LOOK)
                finally:
                    self._watching.release()
            else:
                self._over.wait(max(rest, LENT))

    # In the thread that watches

    def _pump(self, timeout: float) -> None:
        while self._calling:
            self._attend(self._calling.pop())
        if time.monotonic() >= self._look_due:
            self._look()
        for key, _ in self._selector.select(min(timeout, LOOK)):
            if key.fileobj is self._nudge:
                self._nudge.take()
            elif key.data is None:
                self._accept(key.fileobj)
            else:
                client = key.data
                client.link.flush()
                if client.has_room:
                    client.unread += client.link.read()
                self._attend(client)

    def _accept(self, listening: Any) -> None:
        try:
            own, address = listening.accept()
        except (BlockingIOError, ConnectionError):
            return
        except OSError as error:  # most often too many files are open: who waits is not to be asked again at once
            logger.error("nobody can connect for the moment: %s", error)
            self._listen(False)
            self._look_due = time.monotonic() + LOOK
            return
        client = self._welcome(own, ":".join(str(part) for part in address[:2]))
        self.clients.add(client)
        logger.info("%s connected", client.name)
        self._attend(client)

    def _listen(self, whether: bool) -> None:
        if whether != self._is_listening:
            for own in self.listening:
                if whether:
                    self._selector.register(own, selectors.EVENT_READ)
                else:
                    self._selector.unregister(own)
            self._is_listening = whether

    def _look(self) -> None:
        """See who is still there."""
        now = time.monotonic()
        self._look_due = now + min(LOOK, self._alive / 8)
        self._listen(not self._over.is_set())
        for client in tuple(self.clients):
            if not client.has_room:
                client.link.forgive()  # its answer may be there, and is not read yet
            client.link.look(now)
            self._attend(client)

    def _attend(self, client: Client) -> None:
        """Pass on what a client said, and watch its socket for what is to be done next."""
        while client.unread and client.has_room and not self._over.is_set():
            self._take(client, client.unread.popleft())
        if client.link.is_over:
            self._drop(client)
            return
        wanted = selectors.EVENT_READ if client.has_room else 0
        wanted |= selectors.EVENT_WRITE if client.link.wants_room else 0
        self._watch(client, wanted)

    def _watch(self, client: Client, wanted: int) -> None:
        if wanted == client.watched:
            return
        if client.watched == 0:
            self._selector.register(client.link, wanted, client)
        elif wanted == 0:
            self._selector.unregister(client.link)
        else:
            self._selector.modify(client.link, wanted, client)
        client.watched = wanted

    def _drop(self, client: Client) -> None:
        if client not in self.clients:
            return
        self._watch(client, 0)
        self.clients.discard(client)
        logger.info("%s left: %s", client.name, client.link.end)
        client.link.shut()
        self._left(client)

    def _say_goodbye(self, code: int, reason: str) -> None:
        self._listen(False)
        for own in self.listening:
            own.close()
        for client in tuple(self.clients):
            client.link.close(code, reason)
            self._attend(client)
        end = time.monotonic() + CLOSING
        while self.clients and time.monotonic() < end:
            self._pump(CLOSING)
        for client in tuple(self.clients):
            client.link.abort()
            self._drop(client)
        self._selector.close()
        self._nudge.close()
