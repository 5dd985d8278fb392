"""Client: a program that has connected to a bridge, as the bridge sees it."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from nuno.robot.wire.link import Link
from nuno.robot.wire.outbox import KEPT
from nuno.robot.wire.protocol import Message, encode

logger = logging.getLogger(__name__)

UNANSWERED = 64
"""So many commands of one client may wait for the robot; before the next is read, one of them has to be done."""
TOLD = 20
"""So many of what one client does wrong the log warns of; nobody is to fill disks."""


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

    Args:
        link: To it.
        name: What it is called: its address.
        call: Called with it, from any thread, when whoever watches the sockets is to see to it.
    """

    def __init__(self, link: Link, name: str, call: Callable[[Client], None]) -> None:
        self.link, self.name = link, name
        self.subscriptions: dict[str, Subscription] = {}
        self.unread: deque[bytes] = deque()  # that came with what was read, while too many commands wait
        self.watched = 0  # for what a selector watches its socket
        self._call = call
        self._complaints = 0
        self._begun = self._done = 0  # each counted in one thread only

    def __repr__(self) -> str:
        return f"<Client {self.name}>"

    @property
    def has_room(self) -> bool:
        """Return whether another command of its may wait."""
        return self._begun - self._done < UNANSWERED

    def send(self, message: Message) -> None:
        """Send a message that may not be lost; from any thread."""
        self.link.add(encode(message))
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as the client reads."""
        self.link.flush()
        if self.link.wants_room or self.link.is_over:
            self._call(self)

    def answer(self, request: Message, values: Any, good: bool = True) -> None:
        """Answer the call of a service; what went wrong, where it did, is a text."""
        answer = {"op": "service_response", "service": request["service"], "values": values, "result": good}
        self.send(answer | told(request))

    def complain(self, text: str, identity: str | int | None = None) -> None:
        """Tell the client what was wrong with a message of its."""
        self._complaints += 1
        logger.log(logging.WARNING if self._complaints <= TOLD else logging.DEBUG, "%s: %s", self.name, text)
        self.send({"op": "status", "level": "error", "msg": text} | told({"id": identity}))

    def begin(self) -> None:
        """Count a command that is passed on; in the thread that watches the sockets."""
        self._begun += 1

    def done(self) -> None:
        """Count a command as done; in the thread that they are passed to."""
        had_room = self.has_room
        self._done += 1
        if not had_room:
            self._call(self)


def told(message: Message) -> Message:
    """Return the id of a message, for the answer; empty where it has none."""
    return {} if message.get("id") is None else {"id": message["id"]}
