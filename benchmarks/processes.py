"""Independent parts of a benchmark in processes, each on a core of its own."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any


def _begin(counter: Any) -> None:
    """Keep a process to one core, and its libraries to one thread."""
    with counter.get_lock():
        number = counter.value
        counter.value += 1
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[number % len(cores)]})
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


def in_processes(function: Callable[..., Any], parts: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[Any]:
    """Yield what a function returns of each part's arguments, as it comes; with one job here, in order.

    The first part is gone through alone on all cores, so that the others find its kernels compiled.
    """
    if not parts:
        return
    yield function(*parts[0])
    if jobs <= 1:
        for part in parts[1:]:
            yield function(*part)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, initializer=_begin, initargs=(context.Value("i", 0),)) as pool:
        for done in as_completed([pool.submit(function, *part) for part in parts[1:]]):
            yield done.result()
