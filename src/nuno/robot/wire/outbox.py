"""Outbox: what waits to be sent to one peer, which may read slowly."""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Awaitable, Callable
from contextlib import suppress

KEPT = 16
"""How many publications of one topic wait for a slow reader, unless it asks for another number; the oldest go first."""


class Outbox:
    """A queue in which publications may be dropped and all else may not.

    Senders never wait: what a slow reader does not take is dropped where it is out of date anyway, and where it is not
    the reader is given up once too much has gathered.

    Args:
        loop: The loop that sends.
        send: Sends one text, waiting as long as the peer's buffers are full.
        give_up: Called in the loop, once, when ``limit`` texts that may not be dropped are waiting.
        limit: How many.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, send: Callable[[str], Awaitable[None]], give_up: Callable[[], None],
        limit: int = 1000,
    ) -> None:  # fmt: skip
        self._loop, self._send, self._give_up, self._limit = loop, send, give_up, limit
        self._waiting: deque[tuple[str | None, str]] = deque()
        self._counts: Counter[str] = Counter()
        self._filled = asyncio.Event()
        self._closed = False

    def put(self, text: str, topic: str | None = None, keep: int = KEPT) -> None:
        """Send a text when its turn comes; from any thread, without waiting.

        Args:
            text: What is sent.
            topic: Of a publication: then only ``keep`` of one topic wait.
            keep: How many.
        """
        with suppress(RuntimeError):  # the loop has ended, and the connection with it
            self._loop.call_soon_threadsafe(self.add, text, topic, keep)

    def add(self, text: str, topic: str | None = None, keep: int = KEPT) -> None:
        """Do as ``put``, in the loop's own thread."""
        if self._closed:
            return
        if topic is not None:
            if self._counts[topic] >= max(1, keep):
                del self._waiting[next(k for k, (own, _) in enumerate(self._waiting) if own == topic)]
                self._counts[topic] -= 1
            self._counts[topic] += 1
        elif len(self._waiting) - self._counts.total() >= self._limit:
            self._closed = True
            self._give_up()
            return
        self._waiting.append((topic, text))
        self._filled.set()

    async def run(self) -> None:
        """Send what comes, until the connection ends."""
        while True:
            await self._filled.wait()
            while self._waiting:
                topic, text = self._waiting.popleft()
                if topic is not None:
                    self._counts[topic] -= 1
                await self._send(text)
            self._filled.clear()
