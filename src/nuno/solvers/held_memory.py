"""Memory of solvers that nobody refers to any more.

A world and its bodies refer to each other, so that Python's collector of cycles alone frees them. It goes by how many
objects there are, of which a batch has few, and knows nothing of their arrays. So it is called where these have become
many; what it then leaves is in use, and may grow by as much again before it is called the next time.
"""

from __future__ import annotations

import gc
import weakref
from threading import RLock

FLOOR = 1 << 30
"""Bytes up to which it is never called."""


class HeldMemory:
    """The memory that owners hold on a device, and the collector's turn when it is much.

    Args:
        floor: Bytes up to which the collector is never called.

    Attributes:
        held: By owners that were not freed yet [bytes].
        limit: What makes the collector's turn [bytes].
    """

    def __init__(self, floor: int = FLOOR) -> None:
        self.held, self.limit = 0, floor
        self._floor = floor
        self._lock = RLock()  # the collector may come, and with it `_release`, while this thread has it

    def hold(self, owner: object, count: int) -> None:
        """Count ``count`` bytes until the owner is freed; what was forgotten is freed before, where they are much."""
        if self.held + count > self.limit:
            gc.collect(1)  # takes a hundredth of the time: what was just made is young
            if self.held + count > self.limit:
                gc.collect()
                self.limit = max(self._floor, 2 * (self.held + count))
        with self._lock:
            self.held += count
        weakref.finalize(owner, self._release, count).atexit = False

    def _release(self, count: int) -> None:
        with self._lock:
            self.held -= count


_devices: dict[str, HeldMemory] = {}


def hold_memory(owner: object, device: str, count: int) -> None:
    """Count the bytes that an owner holds on a device; see `HeldMemory`."""
    if device not in _devices:
        import warp as wp

        # a sixteenth of a large GPU's memory: plans are to go on for some rounds in between
        whole = 0 if device == "cpu" else int(wp.get_device(device).total_memory)
        _devices[device] = HeldMemory(max(FLOOR, whole // 16))
    _devices[device].hold(owner, count)
