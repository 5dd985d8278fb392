"""PlannedFutures: the batch in which plans of a world are imagined, made by the first and set back by the others."""

from __future__ import annotations

from nuno.world.snapshot import Snapshot
from nuno.world.world import World


class PlannedFutures:
    """The futures that plans of one world imagine, one plan after the other.

    Making a batch takes several times as long as setting it back, and the bits are the same. Copies of a robot have
    goals and trajectories of their own, and what is thorough remembers how cloths came apart: those are made anew.

    Args:
        world: The world.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._made: tuple[World, tuple[int, str | None]] | None = None

    def begin(self, count: int, device: str | None, thorough: bool, again: bool) -> tuple[World, Snapshot | None]:
        """Return futures of the world as it is now, and what they go back to, None where that is not needed.

        Args:
            count: How many.
            device: Where they run; None is where the world runs.
            thorough: As of ``World.imagine``.
            again: Whether they are to go back.
        """
        world, asked = self._world, (count, device)
        with world.lock:  # what futures go back to is the world as they were made of it
            if self._made is not None and self._made[1] == asked and not (thorough or world.drivers):
                batch, saved = self._made[0], world.save().spread(count)
                batch.restore(saved)
                return batch, saved
            self._made = None  # its memory is free for the next
            batch = world.imagine(count, device, thorough=thorough)
            if not (thorough or batch.drivers):
                self._made = batch, asked
            if not again:
                return batch, None
            # of a robot's copies each has a state; all else is alike in all futures
            return batch, batch.save() if batch.drivers else world.save().spread(count)
