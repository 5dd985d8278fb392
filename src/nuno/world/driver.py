"""Drivers: what moves static bodies of a world from frame to frame, such as a robot's controllers."""

from __future__ import annotations

from typing import Any, Protocol


class Driver(Protocol):
    """The driver of bodies of a world, asked around each frame, its lock held; see ``World.drivers``.

    One that goes along into imagined worlds has besides ``imagined(futures, world)``, which returns the driver of its
    copies in a batch, and ``take_future(futures, k)``, by which it becomes its copy in world ``k`` of one. Where it is
    commanded, ``future_commands(futures, k)`` returns a function that lets it do from now on what that copy was told.

    One that can go on from where its bodies are has ``restored()``, which is called where the world was restored from
    what ``save`` of it is not part of, such as a file.

    One that knows many frames ahead has ``frames_ahead(start, ends)``: how many of the frames that end at ``ends`` [s]
    it can be asked for at once, one at least. ``begin_frame`` may then be for so many of them, or fewer.
    """

    def begin_frame(self, start: float, end: float) -> None:
        """Send bodies on their way in the frame from ``start`` to ``end`` [s]."""

    def end_frame(self) -> None:
        """Be told that the frame is done."""

    def cancel_frame(self) -> None:
        """Be told that the frame failed: the world is as it was at its start."""

    def save(self) -> Any:
        """Return all that it is, never to be written to, as part of a snapshot that is kept in memory."""

    def load(self, saved: Any) -> None:
        """Become what it was when ``save`` returned ``saved``."""
