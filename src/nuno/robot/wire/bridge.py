"""Bridge: a rosbridge server, with topics, services and actions that a program provides; nothing of robots."""

from __future__ import annotations

import logging
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from nuno.errors import MessageError, MissingPackageError
from nuno.robot.wire.bridge_client import Client, Subscription
from nuno.robot.wire.link import Link
from nuno.robot.wire.outbox import KEPT, KEPT_MOST
from nuno.robot.wire.protocol import FROM_CLIENTS, Message, decode, encode
from nuno.robot.wire.sockets import Sockets

logger = logging.getLogger(__name__)

SUBSCRIPTIONS = 1000
"""So many topics one client may listen to: each is remembered, whether there is such a topic or not."""
OPENING = 10.0
"""[s] Who connects has so long to ask for a websocket."""


class Bridge:
    """The server: it runs in a thread of its own from when it is made until ``close``.

    A program that would only wait for what clients send may watch the sockets itself meanwhile, by ``pump``: then no
    thread has to be woken for a message.

    Args:
        receive: Called with a client and each of its messages on topics (subscriptions too), services and actions, in
            the thread that watches the sockets, so it must not take long; ``client.done()`` once that is dealt with.
        left: Called likewise with each client that is no longer there.
        host: The address to listen at.
        port: [0, 65535]; 0 takes a free one.
        max_message: Size of the longest message that is read [bytes]; who sends a longer one is disconnected.
        alive: Who is silent for so long [s] is no longer there.
        origins: Web pages that may connect, as browsers name them; None lets programs only.

    Raises:
        MissingPackageError: websockets is not installed.
        NotConnectedError: the port is taken, or the address is not this machine's.
    """

    def __init__(
        self, receive: Callable[[Client, Message], None], left: Callable[[Client], None], host: str, port: int,
        max_message: int, alive: float, origins: Sequence[str] | None,
    ) -> None:  # fmt: skip
        self._websockets = import_websockets("a robot's server")
        self._receive, self._left = receive, left
        self._max_message, self._alive, self._origins = max_message, alive, [None, *(origins or ())]
        self._subscribers: dict[str, tuple[Client, ...]] = {}  # replaced, never changed: other threads read it
        self._latched: dict[str, str] = {}
        self._gathering: int | None = None  # the thread that sends several things at once
        self._gathered: set[Client] = set()
        self._sockets = Sockets(host, port, alive, self._welcome, self._take, self._leave)
        self.host, self.port = host, int(self.listening[0].getsockname()[1])
        self.pump, self.wake = self._sockets.pump, self._sockets.wake

    @property
    def listening(self) -> tuple[socket.socket, ...]:
        """The sockets that it listens at."""
        return self._sockets.listening

    @property
    def clients(self) -> frozenset[Client]:
        """Those that are there."""
        return frozenset(self._sockets.clients)

    def close(self, reason: str = "") -> None:
        """Disconnect all, saying why, and end; a second time does nothing."""
        self._sockets.close(1011 if reason else 1001, reason)  # an error of the server, or it goes away

    def has_subscribers(self, topic: str) -> bool:
        """Return whether anyone would get what is published."""
        return topic in self._subscribers

    def publish(self, topic: str, message: Message, latched: bool = False) -> None:
        """Send a message to all that have subscribed to its topic; from any thread, without waiting.

        Args:
            topic: Its name.
            message: The message's fields.
            latched: Whether those that subscribe later get it too.
        """
        clients = self._subscribers.get(topic, ())
        if not clients and not latched:
            return
        text = encode({"op": "publish", "topic": topic, "msg": message})
        if latched:
            self._latched[topic] = text
        now = time.monotonic()
        for client in clients:
            wanted = client.subscriptions.get(topic)
            if wanted is not None and now - wanted.sent >= wanted.interval:
                wanted.sent = now
                client.link.add(text, topic, wanted.keep)
                if self._gathering == threading.get_ident():
                    self._gathered.add(client)
                else:
                    client.flush()

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let what this thread publishes meanwhile go out at the end, or with what is no publication."""
        self._gathering = threading.get_ident()
        try:
            yield
        finally:
            self._gathering = None
            for client in self._gathered:
                client.flush()
            self._gathered.clear()

    # In the thread that watches the sockets

    def _welcome(self, own: socket.socket, name: str) -> Client:
        protocol = self._websockets.ServerProtocol(origins=self._origins, max_size=self._max_message)
        return Client(Link(own, protocol, self._alive, OPENING), name, self._sockets.call)

    def _leave(self, client: Client) -> None:
        for topic in list(client.subscriptions):
            self._unsubscribe(client, topic)
        self._left(client)

    def _take(self, client: Client, data: bytes) -> None:
        try:
            message = decode(data, FROM_CLIENTS)
            op, topic = message["op"], message.get("topic", "")
            if op == "subscribe":
                self._subscribe(client, message)
                self._pass_on(client, message)  # the newcomer gets what there is
            elif op == "unsubscribe":
                if topic not in client.subscriptions:
                    raise MessageError(f"not subscribed to {topic!r}", message.get("id"))
                self._unsubscribe(client, topic, message.get("id"))
            elif op not in ("unadvertise", "set_level"):  # nothing follows from these
                self._pass_on(client, message)
        except MessageError as error:
            client.complain(str(error), error.identity)
        except Exception:  # the others must go on
            logger.exception("a message of %s could not be dealt with", client.name)
            client.link.close(1011, "the server failed")

    def _pass_on(self, client: Client, message: Message) -> None:
        client.begin()
        self._receive(client, message)

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
        wanted.keep = min(message.get("queue_length") or KEPT, KEPT_MOST)
        if client not in self._subscribers.get(topic, ()):
            self._subscribers = self._subscribers | {topic: (*self._subscribers.get(topic, ()), client)}
        if topic in self._latched:
            client.link.add(self._latched[topic])
            client.flush()

    def _unsubscribe(self, client: Client, topic: str, identity: str | int | None = None) -> None:
        wanted = client.subscriptions[topic]
        wanted.ids.discard(identity)
        if identity is not None and wanted.ids:
            return
        del client.subscriptions[topic]
        others = tuple(other for other in self._subscribers[topic] if other is not client)
        self._subscribers = {name: own for name, own in self._subscribers.items() if name != topic}
        if others:
            self._subscribers |= {topic: others}


def import_websockets(purpose: str) -> Any:
    """Return what is used of websockets, as one namespace.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        from types import SimpleNamespace

        from websockets.client import ClientProtocol
        from websockets.exceptions import WebSocketException
        from websockets.server import ServerProtocol
        from websockets.uri import parse_uri
    except ImportError as error:
        raise MissingPackageError("websockets", "wire", purpose) from error
    return SimpleNamespace(
        ClientProtocol=ClientProtocol, ServerProtocol=ServerProtocol, WebSocketException=WebSocketException,
        parse_uri=parse_uri,
    )  # fmt: skip
