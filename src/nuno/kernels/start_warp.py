"""Warp as commands start it: silent, for a command's output is its answer; and soon."""

from __future__ import annotations

import gc
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


def start_warp() -> None:
    """Let Warp say nothing but errors."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with without_lines(b"Warp CUDA warning: Could not find or load"):  # most machines have no such driver
        wp.init()


@contextmanager
def importing_kernels() -> Iterator[None]:
    """Let Python look for no garbage meanwhile, as it would hundreds of times: a sixth of what importing takes."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


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
