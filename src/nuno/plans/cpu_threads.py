"""A thread for each core of the CPU: Warp's CPU launches release the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

_threads: ThreadPoolExecutor | None = None


def thread_pool() -> ThreadPoolExecutor:
    """Return the threads, one a core."""
    global _threads
    if _threads is None:
        _threads = ThreadPoolExecutor(core_count(), thread_name_prefix="nuno-lanes")
    return _threads


def core_count() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0))


def run_together(calls: Sequence[Callable[[], Any]]) -> None:
    """Call functions without arguments on the threads, and return when all are done."""
    if len(calls) == 1 or core_count() == 1:
        for call in calls:
            call()
        return
    list(thread_pool().map(lambda call: call(), calls))
