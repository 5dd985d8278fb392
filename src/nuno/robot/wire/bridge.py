"""Bridge: a rosbridge server, with topics, services and actions that a program provides; nothing of robots."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from nuno.errors import MessageError, MissingPackageError, NotConnectedError
from nuno.robot.wire.outbox import KEPT, Outbox
from nuno.robot.wire.protocol import FROM_CLIENTS, Message, decode, encode

logger = logging.getLogger(__name__)

UNANSWERED = 64
"""So many commands of one client may wait for the robot; before the next is read, one of them has to be done."""


@dataclass(eq=False)
class Subscription:
    """What one client wants of a topic.

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

    Args:
        socket: Its websocket.
        loop: The loop that serves it.
        later: Calls something in the loop, from any thread.
    """

    def __init__(self, socket: Any, loop: asyncio.AbstractEventLoop, later: Callable[..., None]) -> None:
        self.name = ":".join(str(part) for part in (socket.remote_address or ("?",))[:2])
        self.subscriptions: dict[str, Subscription] = {}
        self.outbox = Outbox(loop, socket.send, self._give_up)
        self._socket, self._later = socket, later
        self._unanswered, self._room, self._is_closing = 0, asyncio.Event(), False
        self._room.set()

    def __repr__(self) -> str:
        return f"<Client {self.name}>"

    def send(self, message: Message) -> None:
        """Send a message that may not be lost; from any thread."""
        self._later(self.outbox.add, encode(message))

    def answer(self, request: Message, values: Any, good: bool = True) -> None:
        """Answer the call of a service; what went wrong, where it did, is a text."""
        answer = {"op": "service_response", "service": request["service"], "values": values, "result": good}
        self.send(answer | told(request))

    def complain(self, text: str, identity: str | int | None = None) -> None:
        """Tell the client what was wrong with a message of its."""
        logger.warning("%s: %s", self.name, text)
        self.send({"op": "status", "level": "error", "msg": text} | told({"id": identity}))

    def begin(self) -> None:
        """Count a command that is passed on; in the loop."""
        self._unanswered += 1
        if self._unanswered >= UNANSWERED:
            self._room.clear()

    def done(self) -> None:
        """Count a command as done; from any thread."""
        self._later(self._done)

    async def room(self) -> bool:
        """Wait until not too many commands wait; returns whether more are to be read at all."""
        await self._room.wait()
        return not self._is_closing

    async def close(self, code: int, reason: str) -> None:
        """Disconnect it; in the loop."""
        self._is_closing = True
        self._room.set()  # what is not read by now is read no more
        await self._socket.close(code, reason[:120])

    def _done(self) -> None:
        self._unanswered -= 1
        self._room.set()

    def _give_up(self) -> None:
        logger.warning("%s reads too slowly and is disconnected", self.name)
        self._socket.transport.abort()


class Bridge:
    """The server: it runs in a thread of its own from when it is made until ``close``.

    Args:
        receive: Called with a client and each of its messages on topics (subscriptions too), services and actions, in
            the bridge's thread, so it must not take long; ``client.done()`` once that is dealt with.
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
        self._max_message, self._alive, self._origins = max_message, alive, origins
        self._subscribers: dict[str, tuple[Client, ...]] = {}  # replaced, never changed: other threads read it
        self._latched: dict[str, str] = {}
        self._clients: set[Client] = set()
        self._calls: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._gathering: int | None = None  # the thread that sends several things at once
        self._reason = ""
        ready: Future[int] = Future()
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve(host, port, ready)), name="nuno-bridge", daemon=True
        )
        self._thread.start()
        self.host, self.port = host, ready.result()

    def close(self, reason: str = "") -> None:
        """Disconnect all, saying why, and end; a second time does nothing."""
        self._reason = self._reason or reason
        with suppress(RuntimeError):  # the loop has ended already
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    def has_subscribers(self, topic: str) -> bool:
        """Whether anyone would get what is published."""
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
                self._call_later(client.outbox.add, text, topic, wanted.keep)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Let what this thread sends meanwhile go out at the end: to wake the bridge's thread takes longest of all."""
        self._gathering = threading.get_ident()
        try:
            yield
        finally:
            self._gathering = None
            self._wake()

    def _call_later(self, call: Callable[..., None], *arguments: Any) -> None:
        self._calls.append((call, arguments))
        if self._gathering != threading.get_ident():
            self._wake()

    def _wake(self) -> None:
        if self._calls:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._catch_up)

    def _catch_up(self) -> None:
        while self._calls:
            call, arguments = self._calls.popleft()
            call(*arguments)

    async def _serve(self, host: str, port: int, ready: Future[int]) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        try:
            server = await self._websockets.serve(
                self._attend, host, port, compression=None, max_size=self._max_message, close_timeout=1.0,
                ping_interval=self._alive / 4, ping_timeout=self._alive, origins=[None, *(self._origins or ())],
            )  # fmt: skip
        except OSError as error:
            ready.set_exception(NotConnectedError(f"cannot listen at {host} port {port}: {error}"))
            return
        self.sockets = tuple(server.sockets)
        ready.set_result(server.sockets[0].getsockname()[1])
        await self._stop.wait()
        code = 1011 if self._reason else 1001  # an error of the server, or it goes away
        await asyncio.gather(*(client.close(code, self._reason) for client in self._clients))
        server.close()
        await server.wait_closed()

    async def _attend(self, socket: Any) -> None:
        client = Client(socket, self._loop, self._call_later)
        logger.info("%s connected", client.name)
        self._clients.add(client)
        sending = asyncio.create_task(client.outbox.run())
        sending.add_done_callback(lambda task: task.cancelled() or task.exception())  # that it closed is known below
        try:
            async for data in socket:
                if not await client.room():
                    break
                self._take(client, data)
        except self._websockets.ConnectionClosed as error:
            logger.info("%s: %s", client.name, error)
        finally:
            sending.cancel()
            self._clients.discard(client)
            for topic in list(client.subscriptions):
                self._unsubscribe(client, topic)
            logger.info("%s left", client.name)
            self._left(client)

    def _take(self, client: Client, data: str | bytes) -> None:
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

    def _pass_on(self, client: Client, message: Message) -> None:
        client.begin()
        self._receive(client, message)

    def _subscribe(self, client: Client, message: Message) -> None:
        topic = message["topic"]
        if message.get("compression") not in (None, "none"):
            raise MessageError(f"compression must be none, got {message['compression']!r}", message.get("id"))
        wanted = client.subscriptions.setdefault(topic, Subscription())
        wanted.ids.add(message.get("id"))
        wanted.interval = max(0.0, 0.001 * (message.get("throttle_rate") or 0.0))
        wanted.keep = message.get("queue_length") or KEPT
        if client not in self._subscribers.get(topic, ()):
            self._subscribers = self._subscribers | {topic: (*self._subscribers.get(topic, ()), client)}
        if topic in self._latched:
            client.outbox.add(self._latched[topic])

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


def told(message: Message) -> Message:
    """Return the id of a message, for the answer; empty where it has none."""
    return {} if message.get("id") is None else {"id": message["id"]}


def import_websockets(purpose: str) -> Any:
    """Return what is used of websockets, as one namespace.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        from types import SimpleNamespace

        from websockets.asyncio.client import connect
        from websockets.asyncio.server import serve
        from websockets.exceptions import ConnectionClosed, WebSocketException
    except ImportError as error:
        raise MissingPackageError("websockets", "wire", purpose) from error
    return SimpleNamespace(
        connect=connect, serve=serve, ConnectionClosed=ConnectionClosed, WebSocketException=WebSocketException
    )
