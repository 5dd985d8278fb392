"""LinkBatch: the links of a robot's copies in a batch of worlds, worked out and sent on their way together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.pinocchio import pin
from nuno.robot.spatial_arrays import placement_arrays
from nuno.tables.path_batch import KinematicGroup

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links
    from nuno.world.world import World


class LinkBatch:
    """The links of copies of a robot, one in each world of a batch.

    Frames are one path batch of all links in all worlds. Each link goes, to the bit, as that of a robot alone.

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

    def lead(self, start: float, ends: np.ndarray, configurations: np.ndarray, angles: np.ndarray) -> None:
        """Send the links to where the robots are at the ends of frames, on a path for each world.

        Args:
            start: When the first frame begins [s], now.
            ends: (k,) [s], when each ends.
            configurations: Pinocchio's (k, worlds, nq) at the ends.
            angles: (k, worlds, dof) of the joints there.
        """
        (frames, worlds), count = angles.shape[:2], len(self._bodies)
        # worlds under the same commands are in the same posture: one of them says where all their links are
        numbers: dict[bytes, int] = {}
        firsts: list[int] = []
        which = []
        for k, q in enumerate(configurations.reshape(frames * worlds, -1)):
            number = numbers.setdefault(q.tobytes(), len(firsts))
            if number == len(firsts):
                firsts.append(k)
            which.append(number)
        configurations, angles = (part.reshape(frames * worlds, -1)[firsts] for part in (configurations, angles))
        parts = []
        for k in range(0, len(firsts), worlds):
            parts.append(self._poses(configurations[k : k + worlds], angles[k : k + worlds]))
        aims = [np.concatenate(part) for part in zip(*parts, strict=True)]
        begins = self._group.arrived(self._bodies, start, (worlds,) if worlds > 1 else ())
        keys = []
        for begin, aim in zip(begins, aims, strict=True):
            every = np.empty((count, worlds, frames + 1, aim.shape[-1]))
            every[:, :, 0] = begin.reshape(count, -1, aim.shape[-1])
            found = aim if len(firsts) == len(which) else aim[which]
            every[:, :, 1:] = found.reshape(frames, worlds, count, -1).transpose(2, 1, 0, 3)
            keys.append(every if worlds > 1 else every[:, 0])
        self._group.lead(self._bodies, self._world, np.array([start, *ends]), keys[0], keys[1])

    def _poses(self, configurations: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the links are in n configurations: (n, links, 3) [m] and (n, links, 4)."""
        axes, origins = (np.empty((len(angles), *part.shape)) for part in (self._axes, self._origins))
        for k, q in enumerate(configurations):
            pin.forwardKinematics(self._model, self._data, q)
            axes[k], origins[k] = self._axes, self._origins
        return self._links.poses_at(axes, origins, angles)
