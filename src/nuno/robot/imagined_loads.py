"""ImaginedLoads: what bodies do to the links of a robot's copies that are under a servo command."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.felt_loads import FeltLoads
from nuno.robot.pinocchio import pin
from nuno.robot.servo import external_forces
from nuno.robot.world_reader import WorldReader

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links
    from nuno.world.world import World


class ImaginedLoads:
    """The loads on a robot's copies, without dynamics, one in each world of a batch.

    Args:
        links: The robot's own links.
        world: The batch.
        bodies: The links' copies there, in their order.
        saved: For each copy, what ``FeltLoads.save`` returned.
    """

    def __init__(self, links: Links, world: World, bodies: Sequence[Body], saved: Sequence[Any]) -> None:
        self._links, self._reader = links, WorldReader(world)
        self._data = links.robot.model.createData()
        self._of_worlds = [FeltLoads(links, reader=self._reader, bodies=bodies, index=k) for k in range(len(saved))]
        self.load(saved)

    def renew(self) -> None:
        """Read the batch anew: a frame has gone by, or something changed."""
        self._reader.renew()

    def take(self) -> None:
        """Read what bore on the links in the frame that ends."""
        self.renew()
        for own in self._of_worlds:
            own.take()
        self.renew()  # which frees what was read of all worlds

    def on_joints(self, world: int, q: np.ndarray) -> Any:
        """Return forces on the joints in their own frames in one world, as Pinocchio takes them; None for none.

        Args:
            world: Which.
            q: (nq,) the configuration of the copy there.
        """
        loads = self._of_worlds[world].read()
        if not loads:
            return None
        pin.forwardKinematics(self._links.robot.model, self._data, q)
        return external_forces(self._links, loads, self._data.oMi)

    def save(self) -> list[Any]:
        """Return of each world what is kept of the frame that has ended, for ``load``."""
        return [own.save() for own in self._of_worlds]

    def load(self, saved: Sequence[Any]) -> None:
        """Go on from what was kept when the batch was as it is now."""
        self.renew()
        for own, kept in zip(self._of_worlds, saved, strict=True):
            own.load(kept)
