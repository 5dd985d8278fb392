"""Watchers: what looks at a world as its time passes, such as a viewer or a film."""

from __future__ import annotations

from typing import Protocol


class Watcher(Protocol):
    """The watcher of a world: called for each piece of a run, its lock held."""

    @property
    def frames(self) -> int:
        """Return how many frames a piece may have, at least 1."""

    def seen(self) -> None:
        """Be told that a piece is done: the world is as it is at its end. Nothing may be raised."""
