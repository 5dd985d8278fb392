"""A channel: a page that gets its messages from the program itself, as in a notebook."""

from __future__ import annotations

from typing import Protocol


class Channel(Protocol):
    """The way to a page that no server is needed for."""

    @property
    def is_open(self) -> bool:
        """Return True if the page still looks on."""

    def offer(self, message: bytes) -> None:
        """Send a message after those before."""

    def close(self) -> None:
        """End the channel."""
