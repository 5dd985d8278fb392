"""LinkBatch: the links of a robot's copies in a batch of worlds, worked out and sent on their way together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.spatial_arrays import placement_arrays
from nuno.tables.kinematic_motion import KinematicGroup

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links
    from nuno.world.world import World


class LinkBatch:
    """The links of copies of a robot, one in each world of a batch.

    A frame is one path batch of all links in all worlds. Each link goes, to the bit, as that of a robot alone.

    Args:
        links: Those of the robot itself.
        world: The batch.
        bodies: The links' copies there, in their order.
    """

    def __init__(self, links: Links, world: World, bodies: Sequence[Body]) -> None:
        self._links, self._world, self._bodies = links, world, bodies
        self._group = KinematicGroup(tuple(body.key for body in bodies))
        self._model = links.robot.model
        self._data = self._model.createData()
        self._axes, self._origins = placement_arrays(self._data.oMi.tolist())

    def lead(self, start: float, end: float, configurations: Sequence[np.ndarray], angles: np.ndarray) -> None:
        """Send the links to where the robots are at the end of a frame, on a path for each world.

        Args:
            start: When the frame begins [s], now.
            end: When it ends [s].
            configurations: Pinocchio's (nq,), of each world, at the end.
            angles: (worlds, dof) of the joints there.
        """
        worlds, count = len(angles), len(self._bodies)
        # worlds under the same commands are in the same posture: one of them says where all their links are
        numbers: dict[bytes, int] = {}
        which = [numbers.setdefault(q.tobytes(), len(numbers)) for q in configurations]
        firsts = [which.index(k) for k in range(len(numbers))]
        axes, origins = (np.empty((len(firsts), *part.shape)) for part in (self._axes, self._origins))
        for k, w in enumerate(firsts):
            pin.forwardKinematics(self._model, self._data, configurations[w])
            axes[k], origins[k] = self._axes, self._origins
        aims = self._links.poses_at(axes, origins, angles[firsts])
        if len(firsts) < worlds:
            aims = (aims[0][which], aims[1][which])
        begins = self._group.arrived(self._bodies, start, (worlds,) if worlds > 1 else ())
        keys = []
        for begin, aim in zip(begins, aims, strict=True):
            both = np.empty((count, worlds, 2, aim.shape[-1]))
            both[:, :, 0], both[:, :, 1] = begin.reshape(count, -1, aim.shape[-1]), aim.swapaxes(0, 1)
            keys.append(both if worlds > 1 else both[:, 0])
        self._group.lead(self._bodies, self._world, np.array([start, end]), keys[0], keys[1])
