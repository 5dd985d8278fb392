"""Memory that is free, and whether a mesh of so many vertices has room in it."""

from __future__ import annotations

import os

from nuno.errors import NotEnoughMemoryError

SHEET_BYTES = 150
"""Of each vertex of a sheet while its triangles are made: 24 of the vertex, 24 of two faces, and indices on the way."""
CLOTH_BYTES = 2_100
"""Of each vertex of a cloth while its dynamics are made, measured on sheets of 200 x 200 and 400 x 400 cells."""


def check_host_memory(what: str, needed: int, hint: str = "take fewer, larger cells") -> None:
    """Check that the host has so many bytes free; ``hint`` says what helps where it has not.

    Raises:
        NotEnoughMemoryError: it has not.
    """
    free = free_bytes("cpu")
    if needed > free:
        raise NotEnoughMemoryError(what, needed, free, hint)


def free_bytes(device: str) -> int:
    """Return the free memory of a device or, of "cpu", of this machine [bytes]."""
    if device != "cpu":
        import warp as wp

        return int(wp.get_device(device).free_memory)
    try:
        with open("/proc/meminfo") as lines:
            found = next(line for line in lines if line.startswith("MemAvailable:"))
        return 1024 * int(found.split()[1])
    except (OSError, StopIteration):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")  # not Linux: all that there is
