"""The server that a viewer's page comes from and is kept up to date by: on this machine only, unless told otherwise."""

from __future__ import annotations

import asyncio
import errno
import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from nuno.errors import MissingPackageError, ViewerError
from nuno.viewer.page import live_page, mesh_viewer

try:
    import tornado.httpserver
    import tornado.iostream
    import tornado.netutil
    import tornado.web
    import tornado.websocket
except ImportError as error:
    raise MissingPackageError("tornado", "viewer", "the viewer") from error

logger = logging.getLogger(__name__)

FIRST_PORT, PORTS = 7000, 100  # where a free port is looked for
BEHIND = 1 << 24  # [bytes] that may wait for a page before it is sent everything anew
LOOPBACK = ("127.0.0.1", "localhost", "::1")


class Server:
    """A web server on a thread of its own.

    Args:
        host: Which of this machine's addresses it listens on.
        port: The port; None is the first that is free from 7000 on.
        everything: Returns the message that brings a new page up to date; called on the server's thread.
        heard: Called on the server's thread with each message of a page; None lets pages say nothing.

    Raises:
        ViewerError: the port is taken, or the address is none of this machine's.
        MissingPackageError: meshcat is not installed.
    """

    def __init__(
        self, host: str, port: int | None, everything: Callable[[], bytes],
        heard: Callable[[str], None] | None = None,
    ) -> None:  # fmt: skip
        mesh_viewer()  # read now: a page that asks for it could not be told that it is missing
        self._everything, self._heard = everything, heard
        self._clients: set[_Socket] = set()
        self._sockets, self.port = _bound(host, port)
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"
        self._allowed = LOOPBACK if host in LOOPBACK else None
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="nuno-viewer-server", daemon=True)
        self._thread.start()
        self._ready.wait()

    @property
    def client_count(self) -> int:
        """Return how many pages look on."""
        return len(self._clients)

    @property
    def is_open(self) -> bool:
        """Return True if it serves."""
        return self._thread.is_alive()

    def send(self, message: bytes) -> None:
        """Send a message to all pages; to one that is too slow for it, everything as soon as it can take that.

        Raises:
            ViewerError: the server is closed.
        """
        self._call(lambda: self._broadcast(message))

    def refresh(self) -> None:
        """Send everything to all pages.

        Raises:
            ViewerError: the server is closed.
        """
        self._call(lambda: self._broadcast(self._everything()))

    def close(self) -> None:
        """End it; nothing where it has ended."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            if threading.current_thread() is not self._thread:
                self._thread.join()

    def _call(self, action: Callable[[], None]) -> None:
        try:
            self._loop.call_soon_threadsafe(action)
        except RuntimeError as error:
            raise ViewerError(f"the viewer at {self.url} is closed") from error

    def _broadcast(self, message: bytes) -> None:
        for client in tuple(self._clients):
            client.offer(message)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        routes: list[Any] = [
            (r"/", _Page, {"allowed": self._allowed, "content": live_page, "kind": "text/html"}),
            (r"/meshcat.js", _Page, {"allowed": self._allowed, "content": mesh_viewer, "kind": "text/javascript"}),
            (r"/feed", _Socket, {
                "allowed": self._allowed, "clients": self._clients, "everything": self._everything,
                "heard": self._heard,
            }),
        ]  # fmt: skip
        server = tornado.httpserver.HTTPServer(tornado.web.Application(routes, log_function=_log))
        server.add_sockets(self._sockets)
        self._loop.call_soon(self._ready.set)
        try:
            self._loop.run_forever()
        finally:
            server.stop()
            for client in tuple(self._clients):
                client.close()
            self._loop.run_until_complete(asyncio.sleep(0.05))  # so that pages are told
            # a browser would ask the next viewer at this port over a connection that it kept, and wait for ever
            self._loop.run_until_complete(server.close_all_connections())
            waiting = asyncio.all_tasks(self._loop)
            for task in waiting:
                task.cancel()
            self._loop.run_until_complete(asyncio.gather(*waiting, return_exceptions=True))
            self._loop.close()


class _Local(tornado.web.RequestHandler):
    """A request that only counts if it names this machine, so that no other site's name can be pointed here."""

    def initialize(self, allowed: tuple[str, ...] | None, **rest: Any) -> None:
        self.allowed = allowed
        self.__dict__.update(rest)

    def prepare(self) -> None:
        name = self.request.host_name.strip("[]")
        if self.allowed is not None and name not in self.allowed:
            raise tornado.web.HTTPError(403, reason="this viewer answers to its own machine only")


class _Page(_Local):
    content: Callable[[], str]
    kind: str

    def get(self) -> None:
        self.set_header("Content-Type", f"{self.kind}; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.finish(self.content())


class _Socket(_Local, tornado.websocket.WebSocketHandler):
    """One page's connection."""

    clients: set[_Socket]
    everything: Callable[[], bytes]
    heard: Callable[[str], None] | None

    def open(self, *args: str, **kwargs: str) -> None:
        self._waiting: deque[bytes] = deque()
        self._delivery: asyncio.Future[None] | None = None
        self.clients.add(self)
        self.offer(self.everything())

    def on_message(self, message: str | bytes) -> None:
        """Hand on what a page says, where pages may say anything."""
        if self.heard is not None and isinstance(message, str):
            self.heard(message)

    def on_close(self) -> None:
        self.clients.discard(self)

    def offer(self, message: bytes) -> None:
        """Send a message after those before; to a page that is too far behind, everything in place of them."""
        self._waiting.append(message)
        if len(self._waiting) > 1 and sum(len(waiting) for waiting in self._waiting) > BEHIND:
            self._waiting.clear()
            self._waiting.append(self.everything())
        if self._delivery is None or self._delivery.done():
            self._delivery = asyncio.ensure_future(self._deliver())

    async def _deliver(self) -> None:
        try:
            while self._waiting:
                await self.write_message(self._waiting.popleft(), binary=True)
        except (tornado.websocket.WebSocketClosedError, tornado.iostream.StreamClosedError):
            self.clients.discard(self)


def _bound(host: str, port: int | None) -> tuple[list[Any], int]:
    tried = [*range(FIRST_PORT, FIRST_PORT + PORTS), 0] if port is None else [port]  # 0: any that is free
    for number in tried:
        try:
            sockets = tornado.netutil.bind_sockets(number, address=host)
        except OSError as error:
            if error.errno == errno.EADDRINUSE and port is None:
                continue
            taken = "taken" if error.errno == errno.EADDRINUSE else "not to be had"
            raise ViewerError(
                f"the port {number} of {host} is {taken} ({error.strerror or error}); choose another, or port=None for "
                "one that is free"
            ) from error
        return sockets, int(sockets[0].getsockname()[1])
    raise ViewerError(f"no port of {host} is free")


def _log(handler: Any) -> None:
    logger.debug("%d %s", handler.get_status(), handler.request.uri)
