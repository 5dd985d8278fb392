"""One CUDA device for each process of a machine, where it has several."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path as FilePath
from typing import IO

_held: dict[int, tuple[str, IO[str]]] = {}  # by process: a forked one takes its own


def own_device() -> str | None:
    """Return "cuda:k", the same at every call of a process; None where there is one device, or none.

    A device belongs to the process that holds a lock on its file in the temporary folder, until the process ends. Where
    there are more processes than devices, they share them by their process number. Devices that
    ``CUDA_VISIBLE_DEVICES`` hides are not counted: a scheduler that gives each worker its own needs nothing of this.
    """
    devices = _cuda_devices()
    if devices < 2:
        return None
    pid = os.getpid()
    if pid not in _held:
        _held.clear()
        _held[pid] = _take(devices)
    return _held[pid][0]


def _cuda_devices() -> int:
    import warp as wp

    return wp.get_cuda_device_count()


def _take(devices: int) -> tuple[str, IO[str]]:
    import fcntl

    folder = FilePath(tempfile.gettempdir()) / f"nuno-devices-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    for k in range(devices):
        file = open(folder / f"cuda-{k}", "a")  # held, and locked, as long as the process lives
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            continue
        return f"cuda:{k}", file
    chosen = os.getpid() % devices
    return f"cuda:{chosen}", open(folder / f"cuda-{chosen}", "a")
