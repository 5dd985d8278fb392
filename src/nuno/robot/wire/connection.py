"""Connection: a client of the rosbridge protocol, to Nuno's server or to rosbridge_suite."""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from nuno.errors import (
    ConnectionLostError,
    InvalidInputError,
    MessageError,
    NotConnectedError,
    RefusedError,
    RobotTimeoutError,
)
from nuno.robot.wire.bridge import import_websockets
from nuno.robot.wire.protocol import FROM_SERVERS, UNKNOWN, Message, decode, encode
from nuno.validation import number

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

CLOSING = 1.0
"""[s] That the other side has to answer when this one closes."""


class SentGoal:
    """A goal that was sent to an action.

    Attributes:
        identity: What it is called on the wire.
        action: The action's name.
    """

    def __init__(self, connection: Connection, identity: str, action: str, feedback: Callable[[Fields], None] | None):
        self.identity, self.action = identity, action
        self._connection, self._feedback = connection, feedback
        self._answer: Future[tuple[int, Any, bool]] = Future()

    @property
    def done(self) -> bool:
        """Return True if there is a result, or none will come as the connection is lost."""
        return self._answer.done()

    def result(self, timeout: float | None = None) -> tuple[int, Any, bool]:
        """Wait for the result and return it.

        Args:
            timeout: How long at most [s] of real time; None waits as long as the connection lasts.

        Returns:
            The status (action_msgs/msg/GoalStatus: 4 succeeded, 5 cancelled, 6 aborted, 0 unknown), the result's
            fields, or what is said in place of them, and whether the goal was accepted at all.

        Raises:
            ConnectionLostError: the connection is lost.
            RobotTimeoutError: there was no result in time.
        """
        return self._connection.wait_for(self._answer, timeout, f"a result of {self.action}")

    def when_done(self, call: Callable[[SentGoal], None]) -> None:
        """Call ``call(self)`` when it is done, in the connection's thread; at once where it is."""
        self._answer.add_done_callback(lambda _: call(self))

    def cancel(self) -> None:
        """Ask the robot to stop it; the result comes as ever."""
        self._connection.send({"op": "cancel_action_goal", "id": self.identity, "action": self.action})


class Connection:
    """A connection to a robot, which a thread of its own serves until ``close`` or until it is lost.

    Args:
        url: "ws://host:port".
        timeout: How long to wait for a connection, and for answers unless asked otherwise [s].
        max_message: Size of the longest message that is read [bytes].
        alive: A server that is silent for so long [s] is no longer there.

    Raises:
        InvalidInputError: another kind of address, or a value out of range.
        MissingPackageError: websockets is not installed.
        NotConnectedError: nobody listens there, or does not speak websockets.
    """

    def __init__(self, url: str, timeout: float = 5.0, max_message: int = 2**24, alive: float = 20.0) -> None:
        self._websockets = import_websockets("a robot on the wire")
        if not isinstance(url, str) or not url.startswith(("ws://", "wss://")):
            raise InvalidInputError(f"url must be like 'ws://127.0.0.1:9090', got {url!r}")
        self.url, self.timeout = url, number("timeout", timeout, above=0.0)
        self._max_message, self._alive = max_message, number("alive", alive, above=0.0)
        self._numbers = itertools.count(1)
        self._heard: dict[str, list[Callable[[Fields], None]]] = {}
        self._advertised: set[str] = set()
        self._pending: dict[str, Future[tuple[bool, Any]]] = {}
        self._goals: dict[str, SentGoal] = {}
        self._lost: ConnectionLostError | None = None
        self._closing = False
        self._lock = threading.Lock()  # of the tables above, against a connection that is lost meanwhile
        self._socket = self._connect()
        self._thread = threading.Thread(target=self._stay, name="nuno-wire", daemon=True)
        self._thread.start()

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def lost(self) -> ConnectionLostError | None:
        """Return why there is no connection any more; None while there is."""
        return self._lost

    def check(self) -> None:
        """Raise if there is no connection any more.

        Raises:
            ConnectionLostError: there is none.
        """
        if self._lost is not None:
            raise ConnectionLostError(str(self._lost)) from self._lost

    def close(self) -> None:
        """Disconnect; a second time does nothing."""
        self._closing = True
        self._socket.close()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    # Topics

    def subscribe(self, topic: str, kind: str, call: Callable[[Fields], None]) -> None:
        """Let ``call`` have the fields of each message on a topic, in the connection's thread.

        Args:
            topic: Its name.
            kind: The type of its messages ("sensor_msgs/msg/JointState").
            call: What is called; it must not wait for anything on this connection.
        """
        with self._lock:
            self._heard.setdefault(topic, []).append(call)
            is_first = len(self._heard[topic]) == 1
        if is_first:
            # One message in the queue: a state that is out of date is of no use
            self.send({"op": "subscribe", "topic": topic, "type": kind, "queue_length": 1})

    def unsubscribe(self, topic: str, call: Callable[[Fields], None]) -> None:
        """Let ``call`` have no more of a topic."""
        with self._lock:
            calls = self._heard.get(topic, [])
            if call not in calls:
                return
            calls.remove(call)
            is_last = not calls
        if is_last:
            self.send({"op": "unsubscribe", "topic": topic})

    def publish(self, topic: str, kind: str, fields: Fields) -> None:
        """Publish a message on a topic."""
        if topic not in self._advertised:
            self._advertised.add(topic)
            self.send({"op": "advertise", "topic": topic, "type": kind})
        self.send({"op": "publish", "topic": topic, "msg": fields})

    # Services and actions

    def call(self, service: str, kind: str, fields: Fields, timeout: float | None = None) -> Fields:
        """Call a service and return its answer.

        Args:
            service: Its name.
            kind: Its type ("rosapi_msgs/srv/GetTime").
            fields: Of the request.
            timeout: How long to wait [s] of real time; None is the connection's own.

        Raises:
            RefusedError: there is no such service, or it fails.
            RobotTimeoutError: no answer came in time.
            ConnectionLostError: there is no connection any more.
        """
        identity, future = f"call:{service}:{next(self._numbers)}", Future[tuple[bool, Any]]()
        with self._lock:
            self.check()
            self._pending[identity] = future
        self.send({"op": "call_service", "id": identity, "service": service, "type": kind, "args": fields})
        longest = self.timeout if timeout is None else timeout
        try:
            good, values = self.wait_for(future, longest, f"an answer of {service}")
        finally:
            self._pending.pop(identity, None)
        if not good:
            raise RefusedError(f"{service} refused: {values}")
        return values if isinstance(values, dict) else {}

    def send_goal(
        self, action: str, kind: str, fields: Fields, feedback: Callable[[Fields], None] | None = None
    ) -> SentGoal:
        """Send a goal to an action, without waiting.

        Args:
            action: Its name.
            kind: Its type ("control_msgs/action/FollowJointTrajectory").
            fields: Of the goal.
            feedback: Called with the fields of each feedback, in the connection's thread.

        Raises:
            ConnectionLostError: there is no connection any more.
        """
        goal = SentGoal(self, f"goal:{action}:{next(self._numbers)}", action, feedback)
        with self._lock:
            self.check()
            self._goals[goal.identity] = goal
        self.send({
            "op": "send_action_goal", "id": goal.identity, "action": action, "action_type": kind, "args": fields,
            "feedback": feedback is not None,
        })  # fmt: skip
        return goal

    def wait_for(self, future: Future[Any], timeout: float | None, what: str) -> Any:
        """Return what a future brings.

        Raises:
            RobotTimeoutError: nothing came in time.
            ConnectionLostError: there is no connection any more.
            InvalidInputError: asked in the connection's own thread, which would wait for itself.
        """
        if threading.current_thread() is self._thread and not future.done():
            raise InvalidInputError(f"{what} cannot be waited for in a callback of the connection")
        try:
            return future.result(timeout)
        except TimeoutError:
            raise RobotTimeoutError(f"{self.url} did not send {what} within {timeout} s") from None

    def send(self, message: Message) -> None:
        """Send a message of the protocol.

        Raises:
            ConnectionLostError: there is no connection any more.
        """
        self.check()
        try:
            self._socket.send(encode(message))
        except self._websockets.ConnectionClosed as end:
            lost = ConnectionLostError(f"the connection to {self.url} is lost: {self._reason(end)}")
            self._lost = self._lost or lost  # also where the thread that receives has not noticed yet
            raise lost from end

    def _connect(self) -> Any:
        from websockets.sync.client import connect

        try:
            return connect(
                self.url, open_timeout=self.timeout, close_timeout=CLOSING, compression=None, proxy=None,
                max_size=self._max_message, ping_interval=0.5 * self._alive, ping_timeout=0.5 * self._alive,
            )  # fmt: skip
        except (OSError, ValueError, EOFError, self._websockets.WebSocketException) as error:
            reason = f"no answer within {self.timeout:g} s" if isinstance(error, TimeoutError) else error
            raise NotConnectedError(f"cannot connect to {self.url}: {reason}") from error

    def _reason(self, end: Any) -> str:
        """Return why a connection was closed."""
        if self._closing:
            return "it was closed here"
        if end.rcvd is not None:
            return f"the other side closed it, code {end.rcvd.code}{end.rcvd.reason and ', '}{end.rcvd.reason}"
        if end.sent is not None:
            return f"given up, code {end.sent.code}, {end.sent.reason}"
        return "the other side went away without a word"

    # In the connection's thread

    def _stay(self) -> None:
        reason = "this side failed"
        try:
            while True:
                self._hear(self._socket.recv(decode=False))
        except self._websockets.ConnectionClosed as end:
            reason = self._reason(end)
        finally:  # whatever happened, nobody is to wait for ever
            self._lose(reason)

    def _hear(self, data: bytes) -> None:
        try:
            self._take(decode(data, FROM_SERVERS))
        except MessageError as error:
            logger.warning("%s: %s", self.url, error)
        except Exception:
            logger.exception("what was called with a message of %s raised", self.url)

    def _take(self, message: Message) -> None:
        op, identity = message["op"], message.get("id")
        if op == "publish":
            for call in tuple(self._heard.get(message["topic"], ())):
                call(message["msg"])
        elif op == "service_response":
            self._answer(identity, message["result"], message.get("values"))
        elif op == "action_feedback":
            goal = self._goals.get(str(identity))
            if goal is not None and goal._feedback is not None:
                goal._feedback(message["values"])
        elif op == "action_result":
            self._finish(identity, message.get("status", UNKNOWN), message.get("values"), message["result"])
        elif message["level"] in ("error", "warning"):
            logger.warning("%s says: %s", self.url, message.get("msg"))
            if message["level"] == "error" and identity is not None:
                self._answer(identity, False, message.get("msg"))
                self._finish(identity, UNKNOWN, message.get("msg"), False)

    def _answer(self, identity: Any, good: bool, values: Any) -> None:
        future = self._pending.pop(str(identity), None)
        if future is not None:
            future.set_result((good, values))

    def _finish(self, identity: Any, status: int, values: Any, accepted: bool) -> None:
        goal = self._goals.pop(str(identity), None)
        if goal is not None:
            goal._answer.set_result((status, values, accepted))

    def _lose(self, reason: str) -> None:
        with self._lock:
            self._lost = ConnectionLostError(f"the connection to {self.url} is lost: {reason}")
            waiting: list[Future[Any]] = [*self._pending.values(), *(goal._answer for goal in self._goals.values())]
            self._pending, self._goals = {}, {}
        for future in waiting:
            future.set_exception(ConnectionLostError(str(self._lost)))
