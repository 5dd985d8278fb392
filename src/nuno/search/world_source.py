"""Sources of the worlds of trials: copies of one world, made anew or restored in every process."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nuno.errors import InvalidInputError
from nuno.search.device_share import own_device
from nuno.search.trial import check_importable, name_of
from nuno.world.device import checked_device, found_device
from nuno.world.snapshot import Snapshot
from nuno.world.world import World


@dataclass(frozen=True, eq=False)
class WorldSource:
    """The source of the world that trials get copies of, in any process.

    Attributes:
        function: Returns the world; None where ``snapshot`` holds it, or trials get no world.
        snapshot: The world.
        device: Where the copies run; None is the device of the world.
        home: Device that a world from ``snapshot`` is made on.
    """

    function: Callable[[], World] | None
    snapshot: Snapshot | None
    device: str | None
    home: str = "auto"

    def world(self) -> World | None:
        """Make the world.

        Raises:
            InvalidInputError: the function raises, or does not return a single world.
        """
        if self.function is None and self.snapshot is None:
            return None
        if self.function is None:
            assert self.snapshot is not None
            restored = World(device=self.home)
            restored.restore(self.snapshot)
            return restored
        try:
            made = self.function()
        except Exception as problem:
            raise InvalidInputError(f"{name_of(self.function)} raised {type(problem).__name__}: {problem}") from problem
        if not isinstance(made, World) or made.world_count != 1:
            raise InvalidInputError(f"{name_of(self.function)} must return a single World, got {made!r}")
        return made

    @property
    def name(self) -> str | None:
        """The function's name, "a world" where one was given, None where there is none."""
        if self.function is not None:
            return name_of(self.function)
        return None if self.snapshot is None else "a world"

    def check_importable(self) -> None:
        """Raise unless another process can make the world."""
        if self.function is not None:
            check_importable(self.function, "the world's function")


def make_source(world: Any, device: str | None) -> WorldSource:
    """Return the source of a world that is given as such, as a function that makes it, or not at all.

    Raises:
        InvalidInputError: neither of these, or a batch.
    """
    if device is not None:
        checked_device(device)
    if world is None:
        return WorldSource(None, None, device)
    if isinstance(world, World):
        if world.world_count != 1:
            raise InvalidInputError(f"trials need a single world to start from, got a batch of {world.world_count}")
        return WorldSource(None, world.save(), device, "cpu" if world.device == "cpu" else "auto")
    if callable(world):
        return WorldSource(world, None, device)
    raise InvalidInputError(f"world must be a World, a function that makes one, or None, got {type(world).__name__}")


class Worlds:
    """The world of a source in this process, and its copies.

    Args:
        source: What makes it.
        given: The world itself, where it is in this process; ``Body`` objects of it can then be used in its copies.
        share: Take a CUDA device that no other process has, where there are several and none was named.
    """

    def __init__(self, source: WorldSource, given: World | None = None, share: bool = False) -> None:
        self._world = source.world() if given is None else given
        self._device = source.device
        if share and source.device in (None, "auto", "cuda") and self.device.startswith("cuda"):
            self._device = own_device() or source.device

    @property
    def device(self) -> str:
        """Return where the copies run, "cpu" or "cuda:0" ..."""
        if self._device is not None:
            return found_device(self._device)
        return "cpu" if self._world is None else self._world.device

    def copies(self, world_count: int) -> World | None:
        """Return a batch of copies; None where trials get no world."""
        return None if self._world is None else self._world.imagine(world_count, device=self._device)


_cached: dict[str, Worlds] = {}


def worlds_in_worker(source: WorldSource, sweep: str) -> Worlds:
    """Return the worlds of a sweep in this process, made at its first task; the last sweep's are kept."""
    key = f"{os.getpid()} {sweep}"  # a forked process makes its own
    if key not in _cached:
        worlds = Worlds(source, share=True)
        _cached.clear()
        _cached[key] = worlds
    return _cached[key]
