"""Pace: how fast the frames of a world may follow each other, whoever makes them."""

from __future__ import annotations

import logging
import threading
import time

logger = logging.getLogger(__name__)

LATE = 0.25  # a thread that is later than this [s] gives the lost time up instead of rushing after it


class Pace:
    """The pace of a world's frames: free, paused, one by one, or at a factor of real time.

    It holds up whoever runs the world before the next frames, without the world's lock, so that the world can be read
    and changed meanwhile. It changes no result: a run that was held up gives what it gives alone.

    Attributes:
        factor: Simulated over real time, in place of the program's own; None is the program's, ``inf`` no limit.
    """

    def __init__(self) -> None:
        self.factor: float | None = None
        self._changed = threading.Condition()
        self._paused = False
        self._permits = 0  # frames that may be made while it is paused
        self._waiting = 0
        self._due = 0.0  # [s] of the real clock, when the next frame of a slowed run is due
        self._exempt: set[int] = set()  # threads whose frames are held up by nothing
        self._warned = False

    @property
    def is_paused(self) -> bool:
        """Return True if frames are held up."""
        return self._paused

    @property
    def is_awaited(self) -> bool:
        """Return True if somebody waits to make frames."""
        return self._waiting > 0

    def pause(self) -> None:
        """Hold up all frames from now on."""
        with self._changed:
            self._paused, self._permits, self._warned = True, 0, False

    def resume(self) -> None:
        """Let frames go on."""
        with self._changed:
            self._paused, self._due = False, time.perf_counter()
            self._changed.notify_all()

    def let(self, frames: int) -> None:
        """Let so many frames through while it is paused."""
        with self._changed:
            self._permits += frames
            self._changed.notify_all()

    def set_factor(self, factor: float | None) -> None:
        """Set ``factor``; a run that waits goes by it at once."""
        with self._changed:
            self.factor, self._due = factor, time.perf_counter()
            self._changed.notify_all()

    def exempt(self, on: bool) -> None:
        """Hold up nothing that this thread makes, or, with ``on=False``, treat it as all others again."""
        (self._exempt.add if on else self._exempt.discard)(threading.get_ident())

    def next_stop(self, now: float, end: float, frame: float) -> float:
        """Wait until a run may go on, and return up to when [s].

        Args:
            now: The world's clock [s].
            end: Where the run would stop otherwise [s].
            frame: Length of a frame [s].
        """
        if (not self._paused and self.factor is None) or threading.get_ident() in self._exempt:
            return end
        with self._changed:
            self._waiting += 1
            try:
                if not self._wait_for_turn(frame):
                    return end
            finally:
                self._waiting -= 1
        return end if end - now < (1.0 + 1e-6) * frame else now + frame

    def may_go(self, timeout: float) -> bool:
        """Return True if a frame may be made now, after waiting for that up to ``timeout`` [s]; ``spend`` follows."""
        if not self._paused:
            return True
        with self._changed:
            self._waiting += 1
            try:
                return self._changed.wait_for(lambda: not self._paused or self._permits > 0, timeout)
            finally:
                self._waiting -= 1

    def spend(self) -> None:
        """Count a frame that was made in the background."""
        if self._paused:
            with self._changed:
                self._permits = max(0, self._permits - 1)

    def _wait_for_turn(self, frame: float) -> bool:
        """Wait for the next frame of a run; return whether it is to stop after that one."""
        while True:
            if self._paused and not self._permits:
                if not self._warned:
                    self._warned = True
                    logger.warning("the world is paused; its run goes on when the viewer's page or resume() lets it")
                self._changed.wait()
                continue
            if self._paused:
                self._permits -= 1
                return True
            if self.factor is None or self.factor == float("inf"):
                return False
            now = time.perf_counter()
            self._due = max(self._due, now - LATE)
            if self._due <= now:
                self._due += frame / self.factor
                return True
            self._changed.wait(self._due - now)
