"""Outbox: what waits to be sent to one peer, which may read slowly."""

from __future__ import annotations

from collections import Counter, deque

KEPT = 16
"""Publications of one topic that wait for a slow reader, unless it asks for another number; the oldest go first."""
MAX_KEPT = 100
"""The greatest number that it may ask for: they are kept in this program's memory."""
LIMIT = 1000
"""So many texts that may not be dropped wait for a slow reader, and no more."""


class Outbox:
    """A queue in which publications may be dropped and all else may not.

    What a slow reader does not take is dropped where it is out of date anyway; where it is not, ``add`` says when too
    much has gathered.

    Args:
        limit: How many texts that may not be dropped wait at most.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._limit = limit
        self._waiting: deque[tuple[str | None, bytes]] = deque()
        self._counts: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, text: bytes, topic: str | None = None, keep: int = KEPT) -> bool:
        """Let a text wait for its turn.

        Args:
            text: What is sent, in a frame.
            topic: Of a publication: then only ``keep`` of one topic wait.
            keep: How many.

        Returns:
            Whether there was room; where there was not, the text is not in it.
        """
        if topic is not None:
            if self._counts[topic] >= max(1, keep):
                del self._waiting[next(k for k, (own, _) in enumerate(self._waiting) if own == topic)]
                self._counts[topic] -= 1
            self._counts[topic] += 1
        elif len(self._waiting) - self._counts.total() >= self._limit:
            return False
        self._waiting.append((topic, text))
        return True

    def pop(self) -> bytes:
        """Return the text whose turn it is, which waits no more."""
        topic, text = self._waiting.popleft()
        if topic is not None:
            self._counts[topic] -= 1
        return text

    def clear(self) -> None:
        """Forget all that waits."""
        self._waiting.clear()
        self._counts.clear()
