"""The seconds that compiling kernels takes, as Warp tells them: a stage of a run, and a warning where it waits long."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from nuno.kernels.quiet import LOADED, LOGGED_AFTER, quiet_warp

log = logging.getLogger(__name__)

_here = threading.local()
_lock = threading.Lock()
_watch: _Watch | None = None


class Stages:
    """Wall time by stage [s]; compiling is one of them, ``compile``, in the midst of whichever it happens.

    Args:
        names: The stages, in order.
    """

    def __init__(self, *names: str) -> None:
        self.seconds = dict.fromkeys(names, 0.0)
        self._since, self._compiled = time.perf_counter(), _compile_seconds()

    def end(self, name: str) -> None:
        """Give a stage all time since the last one ended."""
        now, compiled = time.perf_counter(), _compile_seconds()
        self.seconds["compile"] += compiled - self._compiled
        self.seconds[name] += now - self._since - (compiled - self._compiled)
        self._since, self._compiled = now, compiled

    def total(self) -> dict[str, float]:
        """Return the seconds by stage and their sum, ``total``."""
        return self.seconds | {"total": sum(self.seconds.values())}


@contextmanager
def compiling_watched() -> Iterator[None]:
    """Count the seconds for which this thread loads and compiles kernels, and log a warning that names what took long.

    Warp says it to its logger, which gets what it would have got without. Where that logger says it, nothing is logged.
    """
    import warp as wp

    quiet_warp()
    global _watch
    with _lock:
        if _watch is None:
            _watch = _Watch(wp.get_logger(), wp.config.log_level)
            wp.set_logger(_watch)
            wp.config.log_level = min(_watch.level, wp.LOG_INFO)
        _watch.users += 1
        watch = _watch
    _here.depth = getattr(_here, "depth", 0) + 1
    try:
        yield
    finally:
        _here.depth -= 1
        with _lock:
            watch.users -= 1
            if not watch.users:
                wp.set_logger(watch.logger)
                wp.config.log_level = watch.level
                _watch = None


def waited(module: str, seconds: float) -> None:
    """Count seconds for which this thread waited for another that compiled a module, as those it compiles itself."""
    if getattr(_here, "depth", 0) > 0:
        _here.seconds = _compile_seconds() + seconds
    if seconds > LOGGED_AFTER:
        _tell(module, seconds)


def _tell(module: str, seconds: float) -> None:
    log.warning(
        "waited %.1f s for the kernels of %s, which are kept for later runs; nuno compile makes them ahead",
        seconds, module,
    )  # fmt: skip


def _compile_seconds() -> float:
    return float(getattr(_here, "seconds", 0.0))


class _Watch:
    """Warp's logger in the place of another, which is told no more than its level asks for.

    Attributes:
        users: How many watch by it.
    """

    def __init__(self, logger: Any, level: int) -> None:
        self.logger, self.level, self.users = logger, level, 0

    def debug(self, message: str) -> None:
        """Hand on; Warp asks only at that level."""
        self.logger.debug(message)

    def info(self, message: str) -> None:
        """Note a module that was loaded."""
        import warp as wp

        found = LOADED.search(message)
        if found is not None and getattr(_here, "depth", 0) > 0:
            seconds = float(found[2]) / 1000.0
            _here.seconds = _compile_seconds() + seconds
            if seconds > LOGGED_AFTER and self.level > wp.LOG_INFO:
                _tell(found[1], seconds)
        if self.level <= wp.LOG_INFO:
            self.logger.info(message)

    def warning(self, message: str, category: Any = None, stacklevel: int = 1) -> None:
        """Hand on what was asked for."""
        import warp as wp

        if self.level <= wp.LOG_WARNING:
            self.logger.warning(message, category, stacklevel)

    def error(self, message: str) -> None:
        """Hand on."""
        self.logger.error(message)
