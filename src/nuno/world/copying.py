"""Copying a world: snapshots and files, and imagined worlds of which one is adopted."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError, InvalidInputError
from nuno.files.whole_file import file_path
from nuno.validation import count, flag
from nuno.world.capture import apply, capture
from nuno.world.memory import check_memory
from nuno.world.reset import checked_worlds, reset_worlds
from nuno.world.running import Running
from nuno.world.snapshot import Snapshot, check_world_index

if TYPE_CHECKING:
    from nuno.world.driver import Driver

logger = logging.getLogger(__name__)


class Copying(Running):
    """A simulation with the verbs of time, and those of copies."""

    def save(self, path: str | os.PathLike[str] | None = None) -> Snapshot:
        """Return everything that the world is, and write it to ``path`` (.npz) where one is given.

        Raises:
            InvalidInputError: ``path`` is no path.
            FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
        """
        if path is not None:
            file_path(path)
        with self._change("save"):
            snapshot = capture(self)
        if path is not None:
            from nuno.world.snapshot_file import write_snapshot

            write_snapshot(snapshot, path)
        return snapshot

    def restore(self, saved: Snapshot | str | os.PathLike[str]) -> None:
        """Make the world what it was. Bodies removed since come back, bodies added since go.

        Body and Grip objects keep their identity; a file of another process finds its bodies by name and
        shape. A file says where a robot's links are and not how it moves: the robot is at rest there.

        Raises:
            BodyStateError: a batch with imagined robots, and not what ``save`` of this batch returned.
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
            recorded = [driver for driver, _ in snapshot.drivers]
            unrecorded = [driver for driver in self.drivers if driver not in recorded]
            for driver in unrecorded:
                if hasattr(driver, "original"):
                    raise BodyStateError(f"the snapshot does not say how {driver!r} moves; imagine such a batch anew")
            apply(snapshot, self)
            for driver in unrecorded:
                if (restored := getattr(driver, "restored", None)) is not None:
                    restored()

    def _go_by(self, **changed: Any) -> None:
        """Let all that moves go by other settings: become what is now, with solvers that are made for them."""
        apply(replace(capture(self), **changed), self)

    def reset(self, worlds: ArrayLike, saved: Snapshot) -> None:
        """Let some worlds of a batch become what was saved, and leave all others as they are, to the bit.

        Bodies, dynamics, materials and rules stay those of the batch; what was gripped or let go since is gripped as
        it was. The worlds' own clocks (``clock``) go back, ``time`` goes on for all: what is under way in the snapshot
        goes on from now, as ``saved.at(world.time)`` says. A static body that follows a path in other worlds, and none
        in ``saved``, stands where it was, to the bit.

        Args:
            worlds: Indices of the worlds, one or (k,), or a mask (worlds,) bool.
            saved: What ``save`` returned: of a single world, which each of them becomes; or of a batch of as many
                worlds, each of which becomes what it was itself.

        Raises:
            BodyStateError: the snapshot has other bodies, dynamics, materials, rules or settings, or a path or push is
                under way in it and in other worlds at different times.
            InvalidInputError: no snapshot, one of another number of worlds, or worlds that there are not.
        """
        if not isinstance(saved, Snapshot):
            raise InvalidInputError(f"reset needs what save returned, got {type(saved).__name__}")
        with self._change("reset"):
            if self.drivers:
                raise BodyStateError("a world with a driver, such as a robot, is one world: use restore")
            reset_worlds(self, checked_worlds(worlds, self.world_count), saved)

    def imagine(
        self, n: int, device: str | None = None, *, world: int | None = None, thorough: bool = True,
        engine: str | None = None,
    ) -> Self:  # fmt: skip
        """Return a batch of ``n`` copies of this world as it is now, with everything in it.

        Args:
            n: How many.
            device: Where they run; None is where this world runs.
            world: Which world of a batch is copied; None where this is a single world.
            thorough: Whether frames in which a fast cloth may pass through itself are gone through again with more
                substeps, as in any other world. Without, a future is rougher there, and up to several times as fast.
            engine: What moves the copies, as of ``World``; None is what moves this world. Another takes over shapes,
                poses, velocities, grips and rules; contacts begin anew.

        A simulated robot goes along, with what it is about to do: ``robot`` of the batch commands its copies. Other
        drivers move this world only: what they move stands still in the copies, which is said once, as a warning.

        Raises:
            BodyStateError: this world is a batch itself, and ``world`` does not say which one is meant.
            InvalidInputError: no such world, or more copies than there is memory for.
            UnknownNameError: there is no such engine.
            EngineCapabilityError: the engine lacks something that is in this world.
        """
        worlds, careful = count("n", n), flag("thorough", thorough)
        with self._change("imagine"):
            chosen = self._chosen("imagine", world)
            other = self._engine.name if engine is None else engine
            futures = type(self)(device=self._device if device is None else device, engine=other)
            check_memory(self, worlds, futures.device, partial(self.imagine, device=futures.device, world=chosen))
            snapshot = capture(self, other).pick(chosen)
        apply(snapshot.spread(worlds), futures)
        futures._family, futures._quiet = self._family, self._quiet or not careful
        for driver in self.drivers:
            copied = getattr(driver, "imagined", None)
            if copied is None:
                self._tell_of(driver)
            elif (own := copied(futures, chosen)) is not None:
                futures.drivers.append(own)
        return futures

    def adopt(
        self, futures: Self, k: int, *, world: int | None = None, only: Literal["commands"] | None = None
    ) -> None:  # fmt: skip
        """Become world ``k`` of a batch that was imagined from this one; Body objects keep their identity.

        Args:
            futures: The batch.
            k: Which of its worlds.
            world: Which world of this batch becomes that one, as by ``reset``; None where this is a single world.
            only: "commands" leaves the world as it is, and lets its robots do from now on what their copies were told
                in that future: trajectories under way as it was imagined, and those that were sent in it, each as long
                after the first as there. None takes all.

        Raises:
            InvalidInputError: not imagined from this world, ``k`` or ``world`` out of range, or no such ``only``.
            BodyStateError: this world is a batch itself, and ``world`` does not say which one is meant. Of commands
                alone: there is no robot, or it is not in the futures, as one that has left this world; or it walks, or
                did as they were imagined, and time has passed since.
        """
        if not isinstance(futures, Copying) or futures is self or futures._family != self._family:
            raise InvalidInputError("adopt needs a world that imagine of this world returned")
        if only is not None:
            if not (isinstance(only, str) and only == "commands"):
                raise InvalidInputError(f'only must be "commands" or None, got {only!r}')
            self._adopt_commands(futures, check_world_index(k, futures.world_count), world)
            return
        with futures._change("adopt"):
            snapshot = capture(futures, self._engine.name).pick(check_world_index(k, futures.world_count))
        with self._change("adopt"):
            chosen = self._chosen("adopt", world)
            if self.world_count > 1:
                reset_worlds(self, np.array([chosen]), snapshot)
            else:
                apply(snapshot, self)
            for driver in self.drivers:
                take = getattr(driver, "take_future", None)
                if take is not None:
                    take(futures, int(k))

    def _adopt_commands(self, futures: Self, k: int, world: int | None) -> None:
        """Let the robots of this world do from now on what their copies were told in world ``k`` of a batch."""
        with futures._change("adopt"), self._change("adopt"):
            self._chosen("adopt", world)
            tellers = [getattr(driver, "future_commands", None) for driver in self.drivers]
            commands = [tell(futures, k) for tell in tellers if tell is not None]
            if not commands:
                raise BodyStateError("there is no robot in this world whose commands could be adopted")
            for carry_out in commands:
                carry_out()

    def _chosen(self, what: str, world: int | None) -> int:
        """Return which world is meant.

        Raises:
            BodyStateError: none is named, and there are several.
        """
        if world is not None:
            return check_world_index(world, self.world_count, "world")
        if self.world_count != 1:
            raise BodyStateError(f"{what} needs world=k, one of the {self.world_count} worlds of this batch")
        return 0

    @property
    def robot(self) -> Any:
        """The simulated robot of this world; of a batch, its copies, which are commanded by world.

        Raises:
            BodyStateError: there is none, or there are several: see ``drivers``.
        """
        if len(self.drivers) != 1:
            more = ": drivers[k] are they, in the order in which they came" if self.drivers else ""
            raise BodyStateError(f"a world with one robot is needed, this one has {len(self.drivers)} drivers{more}")
        return self.drivers[0]

    def _tell_of(self, driver: Driver) -> None:
        """Say once of a driver that imagined worlds are without it."""
        if driver not in self._left_out:
            self._left_out.append(driver)
            logger.warning(
                "imagine leaves %r out: in the imagined worlds what it moves stands still where it is now; "
                "let it follow paths there (world.move), or lead grips along the paths that are planned", driver,
            )  # fmt: skip
