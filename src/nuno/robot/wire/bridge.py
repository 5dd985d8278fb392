"""Bridge: a rosbridge server, with topics, services and actions that a program provides; nothing of robots."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from nuno.errors import MessageError, MissingPackageError, NotConnectedError
from nuno.robot.wire.bridge_client import Client, Subscription, frame_of
from nuno.robot.wire.outbox import KEPT, MAX_KEPT
from nuno.robot.wire.protocol import FROM_CLIENTS, Message, decode, encode

logger = logging.getLogger(__name__)

SUBSCRIPTIONS = 1000
"""So many topics one client may listen to: each is remembered, whether there is such a topic or not."""
OPENING = 10.0
"""[s] Who connects has so long to ask for a websocket."""
CLOSING = 1.0
"""[s] That the other side has to answer when this one closes."""
LOOK = 0.02
"""[s] Between two looks at what waits for slow readers."""


class Bridge:
    """The server, in the event loop that it is opened in: that of the thread which also does what clients ask.

    So a message wakes one thread, and the answer is written to the socket by the same one.

    Args:
        receive: Awaited with a client and each of its messages on topics (subscriptions too), services and actions;
            the next message of that client is read when it has returned.
        left: Awaited likewise with each client that is no longer there.
        host: The address to listen at; empty stands for all of this machine.
        port: [0, 65535]; 0 takes a free one.
        max_message: Size of the longest message that is read [bytes]; who sends a longer one is disconnected.
        alive: Who is silent for so long [s] is no longer there.
        origins: Web pages that may connect, as browsers name them; None lets programs only.

    Raises:
        MissingPackageError: websockets is not installed.
    """

    def __init__(
        self, receive: Callable[[Client, Message], Awaitable[None]], left: Callable[[Client], Awaitable[None]],
        host: str, port: int, max_message: int, alive: float, origins: Sequence[str] | None,
    ) -> None:  # fmt: skip
        import_websockets("a robot's server")
        self._receive, self._left = receive, left
        self.host, self.port = host, port
        self._max_message, self._alive = max_message, alive
        self._origins: list[Any] = [None, *(origins or ())]
        self._subscribers: dict[str, dict[Client, Subscription]] = {}
        self._latched: dict[str, bytes] = {}
        self._recent: dict[str, bytes] = {}
        self.clients: set[Client] = set()
        self._thread: int | None = None

    async def open(self) -> None:
        """Begin to listen.

        Raises:
            NotConnectedError: the port is taken, or the address is not this machine's.
        """
        from websockets.asyncio.server import serve

        self._loop, self._thread = asyncio.get_running_loop(), threading.get_ident()
        try:
            self._server = await serve(
                self._stay, self.host or None, self.port, origins=self._origins, compression=None,
                max_size=self._max_message, open_timeout=OPENING, close_timeout=CLOSING,
                ping_interval=0.5 * self._alive, ping_timeout=0.5 * self._alive, logger=_quiet(),
            )  # fmt: skip
        except (OSError, UnicodeError) as error:
            raise NotConnectedError(f"cannot listen at {self.host} port {self.port}: {error}") from error
        self.port = int(self.addresses[0][1])
        self._looking = asyncio.create_task(self._look())

    async def close(self, reason: str = "") -> None:
        """Disconnect all, saying why, and end."""
        self._looking.cancel()
        code = 1011 if reason else 1001  # an error of the server, or it goes away
        self._server.close(code=code, reason=reason.encode()[:120].decode(errors="ignore"))
        await self._server.wait_closed()

    @property
    def addresses(self) -> list[Any]:
        """Addresses and ports that it listens at."""
        return [own.getsockname() for own in self._server.sockets]

    def has_subscribers(self, topic: str) -> bool:
        """Return True if anyone would get what is published."""
        return topic in self._subscribers

    def publish(self, topic: str, message: Message, latched: bool = False) -> None:
        """Send a message to all that have subscribed to its topic; from any thread, without waiting.

        It is made into a frame once, whoever gets it.

        Args:
            topic: Its name.
            message: The message's fields.
            latched: Whether those that subscribe later get it too.
        """
        if topic not in self._subscribers and not latched:
            return
        frame = frame_of(encode({"op": "publish", "topic": topic, "msg": message}))
        self._recent[topic] = frame
        if latched:
            self._latched[topic] = frame
        if self._thread in (None, threading.get_ident()):
            self._publish(topic, frame)
        else:
            self._loop.call_soon_threadsafe(self._publish, topic, frame)

    def forget(self) -> None:
        """Note that what was published so far is no longer how things are."""
        self._recent.clear()

    def resend(self, topic: str, client: Client) -> bool:
        """Send a client what was published on a topic since ``forget``; returns whether there was anything."""
        if topic not in self._recent:
            return False
        if topic not in self._latched:  # of those it got the last one with its subscription
            client.write(self._recent[topic])
        return True

    def flush(self) -> None:
        """Hand all that was published to the system now, not only at the end of this turn of the event loop."""
        for client in self.clients:
            client.flush()

    # In the event loop

    def _publish(self, topic: str, frame: bytes) -> None:
        now = time.monotonic()
        for client, wanted in tuple(self._subscribers.get(topic, {}).items()):
            if now - wanted.sent >= wanted.interval:
                wanted.sent = now
                client.write(frame, topic, wanted.keep)

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK)
            for client in tuple(self.clients):
                client.look()

    async def _stay(self, connection: Any) -> None:
        """Serve a client until it goes."""
        from websockets.exceptions import ConnectionClosed

        client = Client(connection)
        self.clients.add(client)
        logger.info("%s connected", client.name)
        try:
            while True:
                await self._take(client, await connection.recv(decode=False))
        except ConnectionClosed as end:
            logger.info("%s left: %s", client.name, end)
        finally:
            self.clients.discard(client)
            for topic in list(client.subscriptions):
                self._unsubscribe(client, topic)
            await self._left(client)

    async def _take(self, client: Client, data: bytes) -> None:
        try:
            message = decode(data, FROM_CLIENTS)
            op, topic = message["op"], message.get("topic", "")
            if op == "subscribe":
                self._subscribe(client, message)
                await self._receive(client, message)  # the newcomer gets what there is
            elif op == "unsubscribe":
                if topic not in client.subscriptions:
                    raise MessageError(f"not subscribed to {topic!r}", message.get("id"))
                self._unsubscribe(client, topic, message.get("id"))
            elif op not in ("unadvertise", "set_level"):  # nothing follows from these
                await self._receive(client, message)
        except MessageError as error:
            client.complain(str(error), error.identity)
        except Exception:  # the others must go on
            logger.exception("a message of %s could not be dealt with", client.name)
            await client.connection.close(1011, "the server failed")

    def _subscribe(self, client: Client, message: Message) -> None:
        topic = message["topic"]
        if message.get("compression") not in (None, "none"):
            raise MessageError(f"compression must be none, got {message['compression']!r}", message.get("id"))
        count = sum(len(own.ids) for own in client.subscriptions.values())
        if count >= SUBSCRIPTIONS:
            raise MessageError(f"no more than {SUBSCRIPTIONS} subscriptions are kept for a client", message.get("id"))
        wanted = client.subscriptions.setdefault(topic, Subscription())
        wanted.ids.add(message.get("id"))
        wanted.interval = max(0.0, 0.001 * (message.get("throttle_rate") or 0.0))
        wanted.keep = min(message.get("queue_length") or KEPT, MAX_KEPT)
        self._subscribers.setdefault(topic, {})[client] = wanted
        if topic in self._latched:
            client.write(self._latched[topic])

    def _unsubscribe(self, client: Client, topic: str, identity: str | int | None = None) -> None:
        wanted = client.subscriptions[topic]
        wanted.ids.discard(identity)
        if identity is not None and wanted.ids:
            return
        del client.subscriptions[topic]
        del self._subscribers[topic][client]
        if not self._subscribers[topic]:
            del self._subscribers[topic]


def import_websockets(purpose: str) -> Any:
    """Return the module websockets.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        import websockets
    except ImportError as error:
        raise MissingPackageError("websockets", "wire", purpose) from error
    return websockets


def _quiet() -> logging.Logger:
    """Return a log of the websockets package that says of a bad client what the bridge says of others, not more."""
    own = logging.getLogger(f"{__name__}.websockets")
    own.setLevel(logging.CRITICAL)
    return own
