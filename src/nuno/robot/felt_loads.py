"""FeltLoads: what joints under a servo command feel in a frame, which goes along with the robot into snapshots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nuno.robot.loads import BodyLoads, LinkLoads, Load

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links
    from nuno.robot.world_reader import WorldReader


class FeltLoads:
    """The loads that bodies put on a robot's links in the frame before, as joints under a servo command feel them.

    They are read as each frame ends, since no world can tell them once it was restored or copied; the robot keeps them.

    Args:
        links: The links.
        reader: As of ``LinkLoads``.
        bodies: Likewise.
        index: Likewise.
    """

    def __init__(
        self, links: Links, *, reader: WorldReader | None = None, bodies: Sequence[Body] = (), index: int = 0
    ) -> None:  # fmt: skip
        self._world = links.world if reader is None else reader.world
        self._loads = LinkLoads(links, reader=reader, bodies=bodies, index=index)
        self._kept: tuple[float, tuple[BodyLoads, ...]] | None = None  # when they were read [s]

    def begin(self) -> None:
        """Begin to feel: read what bears now, where that is not known."""
        if not self._is_of_now():
            self._loads.note()  # so that nothing from before counts
            self.take()

    def take(self) -> None:
        """Read what bore on the links in the frame that ends."""
        moving = any(own.is_dynamic for own in self._world.bodies)
        self._kept = self._world.time, tuple(self._loads.of_frame()) if moving else ()

    def read(self) -> list[Load]:
        """Return the loads of the frame that has ended, less those of what has let go since, as another begins."""
        self.begin()
        self._loads.note()
        assert self._kept is not None
        return [load for own in self._kept[1] for load in self._loads.of_now(own)]

    def forget(self) -> None:
        """Forget what was, as in a world that is another now."""
        self._kept = None

    def save(self) -> tuple[BodyLoads, ...] | None:
        """Return what is kept of the frame that has ended, for ``load``; None where nothing is felt."""
        return self._kept[1] if self._kept is not None and self._is_of_now() else None

    def load(self, saved: tuple[BodyLoads, ...] | None) -> None:
        """Go on from what was kept when the world was as it is now."""
        self._kept = None if saved is None else (self._world.time, saved)

    def _is_of_now(self) -> bool:
        return self._kept is not None and self._kept[0] == self._world.time
