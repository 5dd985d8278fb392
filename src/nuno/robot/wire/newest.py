"""Newest: what a robot on the wire said last on each topic, and threads that wait for more."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from nuno.errors import RefusedError, RobotModelError, RobotTimeoutError
from nuno.robot.wire import messages as ros
from nuno.robot.wire.connection import Connection

logger = logging.getLogger(__name__)

Fields = dict[str, Any]

LOOK = 0.05
"""[s] Of real time, after which a waiting program looks even if nothing came."""


class Newest:
    """The newest messages of topics that are subscribed to when they are first asked for.

    Args:
        connection: To the robot.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.count = 0  # of all that came
        self._news = threading.Condition()
        self._latest: dict[str, Any] = {}  # by topic
        self._names: dict[str, list[str] | None] = {}  # what there is; None where that is not told

    def tell(self) -> None:
        """Wake those that wait."""
        with self._news:
            self.count += 1
            self._news.notify_all()

    def wait_for_news(self, count: int, timeout: float = LOOK) -> None:
        """Wait until more has come than a count, up to ``timeout`` [s] of real time."""
        with self._news:
            self._news.wait_for(lambda: self.count != count, timeout)

    def wait(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Wait until a condition holds, up to ``timeout`` [s] of real time, and return whether it does.

        Raises:
            ConnectionLostError: there is no connection any more.
        """
        end = time.monotonic() + timeout
        while not condition():
            self.connection.check()
            count, left = self.count, end - time.monotonic()
            if left <= 0.0:
                return condition()
            if condition():
                return True
            self.wait_for_news(count, min(left, LOOK))
        return True

    def peek(self, topic: str, kind: str, read: Callable[[Fields], Any]) -> Any:
        """Return what was last heard on a topic, None before that; it is subscribed to when it is first asked for."""
        self.connection.check()
        if topic not in self._latest:
            self._latest[topic] = None

            def take(fields: Fields) -> None:
                self._latest[topic] = read(fields)
                self.tell()

            self.connection.subscribe(topic, kind, take)
        return self._latest[topic]

    def read(self, topic: str, kind: str, read: Callable[[Fields], Any]) -> Any:
        """Return what was last heard on a topic, or the first that comes.

        Raises:
            RobotModelError: there is no such topic.
            RobotTimeoutError: nothing came.
        """
        if self._latest.get(topic) is None:
            if not self.is_there("topics", topic):
                raise RobotModelError(f"{self.connection.url} has no topic {topic!r}")
            self.peek(topic, kind, read)
            if not self.wait(lambda: self._latest[topic] is not None, self.connection.timeout):
                raise RobotTimeoutError(f"nothing came on {topic} within {self.connection.timeout:g} s")
        return self.peek(topic, kind, read)

    def take(self, topic: str, kind: str, read: Callable[[Fields], Any]) -> Any:
        """Return the first that comes on a topic from now on; nothing more is heard of it after that.

        Raises:
            RobotModelError: there is no such topic.
            RobotTimeoutError: nothing came.
        """
        if not self.is_there("topics", topic):
            raise RobotModelError(f"{self.connection.url} has no topic {topic!r}")
        came: list[Any] = []

        def hear(fields: Fields) -> None:
            came.append(read(fields))
            self.tell()

        self.connection.subscribe(topic, kind, hear)
        try:
            if not self.wait(lambda: bool(came), self.connection.timeout):
                raise RobotTimeoutError(f"nothing came on {topic} within {self.connection.timeout:g} s")
        finally:
            self.connection.unsubscribe(topic, hear)
        return came[0]

    def is_there(self, what: str, name: str) -> bool:
        """Return True if the robot has one of its "topics" or "action_servers"; true where it does not tell."""
        names = self.names_of(what, name)
        return names is None or name in names

    def names_of(self, what: str, name: str) -> list[str] | None:
        """Return the robot's actions or topics, None where untold; asked for again if a name is not among them."""
        if what not in self._names or name not in (self._names[what] or (name,)):
            try:
                answer = self.connection.call(f"/rosapi/{what}", "", {})
                self._names[what] = [str(own) for own in ros.field(answer, what, list, default=[])]
            except (RefusedError, RobotTimeoutError) as error:
                logger.warning("it cannot be known which %s there are: %s", what.replace("_", " "), error)
                self._names[what] = None
        return self._names[what]
