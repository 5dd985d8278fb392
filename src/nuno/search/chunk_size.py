"""The size of a batch: as many worlds as help, fit the memory, and finish soon enough to be worth recording."""

from __future__ import annotations

import os
from pathlib import Path as FilePath
from typing import Any

LANES = 16
"""Worlds that a CPU core takes at once."""
ON_CUDA = 256
"""Worlds from which a CUDA device is about full."""
SOON, LATE = 15.0, 60.0
"""[s] A batch that took less is followed by one twice as large, one that took longer by one of half: what is killed
loses the batch that it is in."""
SHARE = 0.5
"""Of the free memory, that a batch may take."""


class ChunkSize:
    """Chooses the size of the next batch from what the last one took.

    Args:
        device: "cpu" or "cuda:0" ...
        limit: At most so many; None leaves it to time and memory.
    """

    def __init__(self, device: str, limit: int | None) -> None:
        self._device, self._limit = device, limit
        full = ON_CUDA if device.startswith("cuda") else LANES * (os.cpu_count() or 1)
        self._floor = full
        self._size = limit if limit is not None else LANES  # the first one tells how much memory a world takes
        self._first = True
        self._before = (0, 0)

    def begin(self) -> int:
        """Return the size of the batch that is run next."""
        self._before = used_memory(self._device)
        return self._size

    def end(self, world_count: int, seconds: float) -> None:
        """Learn from a batch that has run."""
        if self._limit is not None or world_count < self._size:
            return
        if self._first or seconds < SOON:
            wanted = max(self._floor if self._first else 0, 2 * self._size)
        else:
            wanted = max(self._size // 2, self._floor) if seconds > LATE else self._size
        self._first = False
        now, highest = self._before
        peak = used_memory(self._device)[1]
        if peak > highest:
            fits = int(SHARE * free_memory(self._device) * world_count / (peak - now))
        else:  # it took less than something before it did: how much is not known
            fits = 2 * self._size
        self._size = max(1, min(wanted, fits))


def used_memory(device: str) -> tuple[int, int]:
    """Return what is used now and what was used at most so far [bytes]: of this process, or of Warp's CUDA pool."""
    if device.startswith("cuda"):
        wp = _warp()
        return wp.get_mempool_used_mem_current(device), wp.get_mempool_used_mem_high(device)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            now = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        now = peak  # no Linux: memory is then taken as endless
    return now, peak


def free_memory(device: str) -> int:
    """Return the memory that can be had [bytes], of the machine or of a CUDA device."""
    if device.startswith("cuda"):
        now, peak = used_memory(device)
        return int(_warp().get_device(device).free_memory) + peak - now  # the pool keeps what was given back
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            free = next(int(line.split()[1]) * 1024 for line in file if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        free = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2
    try:  # a container may have less than its machine
        used, limit = (FilePath(f"/sys/fs/cgroup/memory.{name}").read_text() for name in ("current", "max"))
        free = min(free, int(limit) - int(used))
    except (OSError, ValueError):
        pass
    return max(free, 0)


def _warp() -> Any:
    import warp as wp

    return wp
