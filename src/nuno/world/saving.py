"""Saving a world: snapshots and files, and imagined worlds of which one is adopted."""

from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING, cast

from nuno.errors import BodyStateError, InvalidInputError
from nuno.validation import count
from nuno.world.running import Running
from nuno.world.snapshot import Snapshot, apply, capture, check_world_index

if TYPE_CHECKING:
    from nuno.world.world import World

logger = logging.getLogger(__name__)


class Saving(Running):
    """A simulation with the verbs of time, and those of copies."""

    def save(self, path: str | os.PathLike[str] | None = None) -> Snapshot:
        """Return everything that the world is, and write it to ``path`` (.npz) where one is given."""
        with self._change("save"):
            snapshot = capture(self)
        if path is not None:
            from nuno.world.snapshot_file import write_snapshot

            write_snapshot(snapshot, path)
        return snapshot

    def restore(self, saved: Snapshot | str | os.PathLike[str]) -> None:
        """Make the world what it was. Bodies removed since come back, bodies added since go.

        Body and Grip objects keep their identity; a file of another process finds its bodies by name and
        shape.

        Raises:
            FileFormatError: the file cannot be read, or its format is unknown or newer.
            InvalidInputError: neither a snapshot nor a path.
        """
        snapshot = saved
        if isinstance(snapshot, str | os.PathLike):
            from nuno.world.snapshot_file import read_snapshot

            snapshot = read_snapshot(snapshot)
        if not isinstance(snapshot, Snapshot):
            raise InvalidInputError(f"restore needs what save returned, or a path, got {type(saved).__name__}")
        with self._change("restore"):
            apply(snapshot, self)

    def imagine(self, n: int, device: str | None = None) -> World:
        """Return a batch of ``n`` copies of this world as it is now, with everything in it.

        Args:
            n: How many.
            device: Where they run; None is where this world runs.

        A driver, such as a simulated robot, moves this world only: what it moves stands still in the copies, which is
        said once, as a warning.

        Raises:
            BodyStateError: this world is a batch itself.
        """
        worlds = count("n", n)
        with self._change("imagine"):
            if self.world_count != 1:
                raise BodyStateError(f"only a single world can be imagined further; this one has {self.world_count}")
            self._tell_of_drivers()
            futures = cast("type[World]", type(self))(device=self._device if device is None else device)
            snapshot = capture(self)
        apply(snapshot.spread(worlds), futures)
        futures._family, futures._quiet = self._family, self._quiet
        return futures

    def adopt(self, futures: World, k: int) -> None:
        """Become world ``k`` of a batch that was imagined from this one; Body objects keep their identity.

        Raises:
            InvalidInputError: not imagined from this world, or ``k`` out of range.
            BodyStateError: this world is a batch itself.
        """
        if not isinstance(futures, Saving) or futures is self or futures._family != self._family:
            raise InvalidInputError("adopt needs a world that imagine of this world returned")
        with futures._change("adopt"):
            snapshot = capture(futures).pick(check_world_index(k, futures.world_count))
        with self._change("adopt"):
            if self.world_count != 1:
                raise BodyStateError("a batch cannot adopt a world; adopt it in the single world")
            apply(snapshot, self)

    def _tell_of_drivers(self) -> None:
        """Say once of each driver that imagined worlds are without it."""
        for driver in self.drivers:
            if driver not in self._left_out:
                self._left_out.append(driver)
                logger.warning(
                    "imagine leaves %r out: in the imagined worlds what it moves stands still where it is now; "
                    "let it follow paths there (world.move), or lead grips along the paths that are planned", driver,
                )  # fmt: skip
