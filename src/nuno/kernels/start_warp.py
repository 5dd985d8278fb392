"""Warp as commands start it: silent, for a command's output is its answer; and soon."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache


def start_warp() -> None:
    """Let Warp say nothing but errors."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with without_lines(b"Warp CUDA warning: Could not find or load"):  # most machines have no such driver
        wp.init()


def begin_to_start_warp(kernels: str | None = None) -> Future[None]:
    """Begin to start Warp as `start_warp` does, on a thread: the time is the driver's, which holds no lock of Python's.

    Kernels may be declared meanwhile. What is returned is to be waited for before any is loaded.

    Args:
        kernels: A module that is to be compiled for the CPU if there is no other device. While nothing of it is in the
            cache, Warp's headers are read for the compiler, which takes longer than to declare kernels.
    """
    pool = ThreadPoolExecutor(1, thread_name_prefix="nuno-start")
    started = pool.submit(start_warp)
    if kernels is not None:
        from nuno.kernels import precompiled_headers  # noqa: F401 (it declares a kernel, which is not for a thread)

        pool.submit(_read_headers_for, kernels)
    pool.shutdown(wait=False)
    return started


def _read_headers_for(kernels: str) -> None:
    import warp as wp

    from nuno.kernels.kernel_cache import is_cached
    from nuno.kernels.precompiled_headers import begin_to_read_headers

    if not wp.get_cuda_device_count() and not is_cached(f"{kernels}_*", "o"):
        begin_to_read_headers()


@contextmanager
def importing_kernels() -> Iterator[None]:
    """Let Python look for no garbage meanwhile, as it would hundreds of times: a sixth of what importing takes.

    Nor does it look among what is there then, 300,000 objects, until and when the process ends, which took 0.7 s of CPU
    time there. Warp looks for function arguments only where there are any (`nuno.kernels.function_arguments`).
    """
    from nuno.kernels.function_arguments import look_for_function_arguments_where_taken

    was_enabled = gc.isenabled()
    gc.disable()
    try:
        look_for_function_arguments_where_taken()
        yield
    finally:
        gc.freeze()
        _freeze_at_exit()
        if was_enabled:
            gc.enable()


@cache
def _freeze_at_exit() -> None:
    """Let the end of the process take all objects as they are: what they hold goes back with the process."""
    atexit.register(gc.freeze)


@contextmanager
def without_lines(beginning: bytes) -> Iterator[None]:
    """Leave out lines of standard error that begin so, also where a library's own code writes them."""
    sys.stderr.flush()
    try:
        terminal = os.dup(2)
    except OSError:  # there is no standard error
        yield
        return
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            said.seek(0)
            for line in said:
                if not line.startswith(beginning):
                    os.write(terminal, line)
            os.close(terminal)
