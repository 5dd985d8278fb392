"""Quiet: Warp says nothing of its start and of kernels that it finds in its cache."""

from __future__ import annotations

import logging
import re
from typing import Any

log = logging.getLogger(__name__)

LOADED = re.compile(r"Module (\S+) .*took ([\d.]+) ms +\((compiled|cached)\)")
LOGGED_AFTER = 2.0
"""[s] What is quicker is not worth a word."""


def quiet_warp() -> None:
    """Take what Warp prints on standard output into ``logging``, unless the program has chosen a log level or a logger.

    Its warnings and errors are given as before. What is left of the rest is one warning for each module of kernels
    that takes longer than two seconds to compile; the other lines are there at level DEBUG.
    """
    import warp as wp

    own = wp.get_logger()
    if wp.config.log_level == wp.LOG_INFO and type(own).__module__.split(".")[0] == "warp":
        wp.set_logger(_Quiet(own))


class _Quiet:
    """Warp's logger, without what it only informs of.

    Args:
        logger: Warp's own.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger

    def debug(self, message: str) -> None:
        """Hand on."""
        self._logger.debug(message)

    def info(self, message: str) -> None:
        """Log it, for everybody where it took long."""
        found = LOADED.search(message)
        if found is not None and found[3] == "compiled" and float(found[2]) / 1000.0 > LOGGED_AFTER:
            log.warning(
                "waited %.1f s for the kernels of %s, which are kept for later runs; nuno compile makes them ahead",
                float(found[2]) / 1000.0, found[1],
            )  # fmt: skip
        else:
            log.debug("%s", message)

    def warning(self, message: str, category: Any = None, stacklevel: int = 1) -> None:
        """Hand on."""
        self._logger.warning(message, category, stacklevel + 1)

    def error(self, message: str) -> None:
        """Hand on."""
        self._logger.error(message)
