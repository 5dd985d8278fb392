"""Running a world in the background at real time: the lock that frames are made under, and the thread."""

from __future__ import annotations

import os
import threading
import time
import weakref
from typing import Protocol

from nuno.errors import BodyStateError
from nuno.world.pace import LATE, Pace


class FramedWorld(Protocol):
    """A world as the thread sees it that makes its frames."""

    @property
    def frame_rate(self) -> float:
        """[1/s]."""

    @property
    def lock(self) -> FrameLock:
        """The lock that frames are made under."""

    @property
    def _pace(self) -> Pace:
        """The pace at which frames may follow each other."""

    def _advance(self, duration: float) -> None:
        """Advance everything by ``duration`` [s]."""


class FrameLock:
    """A re-entrant lock that knows whether anyone waits for it.

    A plain lock starves the caller when frames take longer than real time: the thread that lets it go takes
    it again at once.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._waiting = 0
        self._count = threading.Lock()
        _locks.add(self)

    def __enter__(self) -> FrameLock:
        if not self._lock.acquire(blocking=False):
            with self._count:
                self._waiting += 1
            try:
                self._lock.acquire()
            finally:
                with self._count:
                    self._waiting -= 1
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def acquire(self, timeout: float) -> bool:
        """Take the lock within ``timeout`` [s], without counting as a waiting caller."""
        return self._lock.acquire(timeout=timeout)

    def release(self) -> None:
        """Let the lock go."""
        self._lock.release()

    def let_others(self) -> None:
        """Wait until no caller waits, up to 50 ms."""
        for _ in range(100):
            if not self._waiting:
                return
            time.sleep(0.0005)

    def forked(self) -> None:
        """Be free in a forked process, where the thread that held it does not exist."""
        if self._lock.acquire(blocking=False):
            self._lock.release()
        else:
            self._lock, self._waiting, self._count = threading.RLock(), 0, threading.Lock()


_locks: weakref.WeakSet[FrameLock] = weakref.WeakSet()


def _free_locks() -> None:
    for lock in _locks:
        lock.forked()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_free_locks)


class Background:
    """The thread that makes a world's frames.

    It holds the world weakly, so that a world that is dropped ends its thread.

    Args:
        world: The world to run.
        real_time_factor: Simulated over real time; ``inf`` is as fast as possible.
    """

    def __init__(self, world: FramedWorld, real_time_factor: float) -> None:
        self.error: BaseException | None = None
        self._stop = threading.Event()
        self._frame = threading.Condition()
        self._process = os.getpid()
        arguments = (weakref.ref(world), world.lock, world._pace, real_time_factor)
        self._thread = threading.Thread(target=self._loop, args=arguments, name="nuno-world", daemon=True)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """Return True if frames are still made.

        Raises:
            BodyStateError: in a process forked from the one that makes them, where they never come.
        """
        if os.getpid() != self._process:
            raise BodyStateError("the world ran in the background when this process was forked: stop it before that")
        return self._thread.is_alive() and not self._stop.is_set() and self.error is None

    @property
    def is_current_thread(self) -> bool:
        """Return True if the caller is the background thread itself."""
        return threading.current_thread() is self._thread

    def stop(self) -> None:
        """End the thread after the frame that it is in."""
        self._stop.set()
        if not self.is_current_thread:
            self._thread.join()

    def wait_for_frame(self) -> None:
        """Sleep until a frame is done, or for 0.1 s."""
        with self._frame:
            self._frame.wait(0.1)

    def _loop(self, reference: weakref.ref[FramedWorld], lock: FrameLock, pace: Pace, factor: float) -> None:
        due = time.perf_counter()
        while not self._stop.is_set():
            if not pace.may_go(timeout=0.05):
                due = time.perf_counter()
                continue
            if not lock.acquire(timeout=0.05):
                continue
            try:
                world = reference()
                if world is None:
                    return
                if self._stop.is_set():
                    return
                span = 1.0 / world.frame_rate
                world._advance(span)
                pace.spend()
            except BaseException as error:
                self.error = error  # raised again in the caller's next call
                return
            finally:
                world = None
                lock.release()
                with self._frame:
                    self._frame.notify_all()
            lock.let_others()
            now = time.perf_counter()
            due = max(due + span / (factor if pace.factor is None else pace.factor), now - LATE)
            if due > now:
                self._stop.wait(due - now)
