"""Modules of kernels loaded on other threads, compiled where they are not cached, and launches that wait for them.

Warp's compilers do not hold Python's lock. A kernel that is launched while its module is being loaded would be compiled
once more, so whoever launches waits first.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any

from nuno.kernels.compile_watch import waited

_loads: dict[tuple[str, str, int | None], Future[Any]] = {}
_written: dict[tuple[str, str, int | None], threading.Event] = {}


def load_ahead(modules: Iterable[tuple[Any, int | None]], device: str, threads: int) -> None:
    """Begin to load modules, in their order, but those that are being loaded.

    Args:
        modules: Warp modules, each with the threads of the blocks by which its kernels are launched; None: Warp's own
            number.
        device: "cpu" or "cuda:0" ...
        threads: How many are loaded at once.
    """
    import warp as wp

    wp.init()  # once, before threads do
    pool = ThreadPoolExecutor(threads, thread_name_prefix="nuno-compile")
    for module, block in modules:
        key = (module.name, device, block)
        options: dict[str, Any] = {} if block is None else {"block_dim": block}
        if key not in _loads or _loads[key].done():
            _written[key] = threading.Event()
            _loads[key] = pool.submit(_load, partial(wp.load_module, module, device, **options), _written[key])
    pool.shutdown(wait=False)


def _load(load: Callable[[], Any], written: threading.Event) -> None:
    from nuno.kernels.precompiled_headers import compiling

    with compiling(written):
        load()


def wait_for_source(module: Any, device: str, block: int | None = None) -> None:
    """Wait until the source of a module that is being loaded has been written, or the load is over.

    Until then Python's lock is what its thread needs; from then on the compiler has work for a core, and none for
    Python.

    Args:
        module: As in `wait_for_load`.
        device: As in `load_ahead`.
        block: As in `load_ahead`.
    """
    if written := _written.get((module.name, device, block)):
        written.wait()


def wait_for_load(module: Any, device: str, block: int | None = None) -> None:
    """Wait for a module if it is being loaded, and raise what went wrong; how long it took is told as for any other.

    Args:
        module: The Warp module of a kernel that is to be launched.
        device: As in `load_ahead`.
        block: As in `load_ahead`.
    """
    if not _loads:
        return
    load = _loads.pop((module.name, device, block), None)
    if load is None:
        return
    start, was_done = time.perf_counter(), load.done()
    load.result()
    if not was_done:
        waited(module.name, time.perf_counter() - start)
