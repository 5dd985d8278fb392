"""A thread for each core of the CPU: Warp's CPU launches release the GIL."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from itertools import count
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
    """Call functions without arguments on this thread and others, and return when all are done.

    Each thread takes the next call until there are none. So few tasks are handed over, which takes longer than many a
    call, and this thread does its part.
    """
    left = count()

    def work() -> None:
        while (k := next(left)) < len(calls):
            calls[k]()

    work_together(work, len(calls))


def work_together(work: Callable[[], Any], most: int) -> None:
    """Call one function on this thread and others, one a core and ``most`` in all, and return when all are done."""
    others = [thread_pool().submit(work) for _ in range(min(core_count(), most) - 1)]
    try:
        work()
    finally:
        wait(others)
    for other in others:
        other.result()
