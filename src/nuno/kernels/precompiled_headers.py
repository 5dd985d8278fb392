"""Warp's C++ headers, read once and ahead for all threads that compile kernels for the CPU.

The compiler reads them before each module: 1 s of CPU time, or hardly any with a precompiled form of them, which takes
1.6 s to make. Warp makes one on each thread, when the source of its first module has been written. Here one is made
while kernels are still being declared and written, and threads get copies: two seconds less of the wait for a first
answer, and the same machine code to the byte.

The folder of a thread's precompiled headers is private to Warp. Where a version of Warp has none, every thread reads
the headers itself; `tests/kernels/test_precompiled_headers.py` says so.
"""

from __future__ import annotations

import shutil
import tempfile
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import warp as wp

from nuno.kernels.warp_functions import wrap_function
from nuno.numbers.cpu_compiler import compile_quickly

MODULE = "nuno.kernels.precompiled_headers"
"""A Warp module that is nothing but headers, compiled as those of an estimate are."""

PATIENCE = 30.0
"""[s] A thread that has waited so long for the headers reads them itself."""

_here = threading.local()
_lock = threading.Lock()
_made: Future[list[Path]] | None = None


def _nothing() -> None:
    pass


compile_quickly(MODULE)
wp.kernel(_nothing, enable_backward=False, module=MODULE)


def begin_to_read_headers() -> Future[list[Path]]:
    """Begin to make the precompiled headers on a thread, unless that was done before; Warp must have been started.

    Returns:
        The files, once they are there.
    """
    global _made
    with _lock:
        if _made is None:
            pool = ThreadPoolExecutor(1, thread_name_prefix="nuno-headers")
            _made = pool.submit(_read)
            pool.shutdown(wait=False)
        return _made


@contextmanager
def compiling(source_written: threading.Event) -> Iterator[None]:
    """Let this thread compile a module with the headers that were read ahead, if any were.

    Args:
        source_written: Set as soon as the source of the module has been written, or no compiler is needed.
    """
    _take_headers()
    _here.source_written = source_written
    try:
        yield
    finally:
        _here.source_written = None
        source_written.set()


def _read() -> list[Path]:
    wp.set_module_options({"block_dim": 1}, module=wp.get_module(MODULE))  # as the CPU has it
    with tempfile.TemporaryDirectory(prefix="nuno-headers-") as folder:
        wp.compile_aot_module(MODULE, device="cpu", module_dir=folder)
    made = _own_folder()
    return [] if made is None else sorted(Path(made()).iterdir())


def _read_ahead() -> list[Path]:
    """The files, if there are any: none where reading has failed, or does not end, as in a process that was forked."""
    try:
        return [] if _made is None else _made.result(PATIENCE)
    except Exception:
        return []


def _copy(files: list[Path], folder: Path) -> None:
    """Copy what is not there yet, each file whole or not at all."""
    for path in files:
        if not (folder / path.name).exists():
            with suppress(OSError):
                shutil.copyfile(path, folder / f"{path.name}.part")
                (folder / f"{path.name}.part").replace(folder / path.name)


def _own_folder() -> Any:
    """Warp's function that gives the folder of a thread's precompiled headers; None if it has no such function."""
    from warp._src import context

    return getattr(context.runtime, "get_clang_pch_dir", None)


def _take_headers() -> bool:
    """Have threads that are `compiling` take what was read ahead, and return whether this version of Warp can."""
    from warp._src import context

    return wrap_function(context.runtime, "get_clang_pch_dir", _taking_headers)


def _taking_headers(own: Any) -> Any:
    def get_clang_pch_dir() -> str | None:
        folder: str | None = own()
        written: threading.Event | None = getattr(_here, "source_written", None)
        if written is not None:
            written.set()
            if folder is not None:
                _copy(_read_ahead(), Path(folder))
        return folder

    return get_clang_pch_dir
