"""LinkBatch: the links of a robot's copies in a batch of worlds, worked out and sent on their way together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.joint_placements import JointPlacements
from nuno.shapes.coordinates import Pose
from nuno.tables.path_batch import KinematicGroup

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links
    from nuno.world.world import World


TOGETHER = 256
"""Postures whose links are worked out at once: fewer take longer each, and many more no longer fit caches."""


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
        model = links.robot.model
        self._placements = JointPlacements(model, model.createData())
        # on which numbers of a configuration it depends where a link is, (links, nq)
        columns = [np.arange(own.idx_q, own.idx_q + own.nq) for own in model.joints.tolist()[1:]]
        self._depends = np.zeros((len(bodies), model.nq), dtype=bool)
        for k, joint in enumerate(links.joints):
            for above in model.supports[joint].tolist()[1:]:
                self._depends[k, columns[above - 1]] = True
        fingers = links.finger_bodies
        for finger, own in zip(fingers.fingers, fingers.bodies, strict=True):
            self._depends[own, columns[finger.row + 1][0]] = True

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
        configurations, angles = (part.reshape(frames * worlds, -1) for part in (configurations, angles))
        if len(firsts) < len(which):
            configurations, angles = configurations[firsts], angles[firsts]
        # where links that nothing moves are is worked out once for all
        moving = (self._depends & (configurations != configurations[0]).any(axis=0)).any(axis=1)
        still = self._poses(configurations[:1], angles[:1], np.flatnonzero(~moving))
        moved = self._poses(configurations, angles, np.flatnonzero(moving))
        begins = self._group.arrived(self._bodies, start, (worlds,) if worlds > 1 else ())
        keys = []
        for begin, *aims in zip(begins, still, moved, strict=True):
            every = np.empty((count, worlds, frames + 1, begin.shape[-1]))
            every[:, :, 0] = begin.reshape(count, -1, begin.shape[-1])
            every[~moving, :, 1:] = aims[0].transpose(1, 0, 2)[:, :, None]
            found = aims[1] if len(firsts) == len(which) else aims[1][which]
            every[moving, :, 1:] = found.reshape(frames, worlds, *found.shape[1:]).transpose(2, 1, 0, 3)
            keys.append(every if worlds > 1 else every[:, 0])
        self._group.lead(self._bodies, self._world, np.array([start, *ends]), keys[0], keys[1])

    def _poses(self, configurations: np.ndarray, angles: np.ndarray, links: np.ndarray) -> Pose:
        """Return where some links are in n configurations: (n, links, 3) [m] and (n, links, 4)."""
        found = np.empty((len(angles), len(links), 3)), np.empty((len(angles), len(links), 4))
        for k in range(0, len(angles) if len(links) else 0, TOGETHER):
            part = slice(k, k + TOGETHER)
            axes, origins = self._placements.at(configurations[part])
            found[0][part], found[1][part] = self._links.poses_at(axes, origins, angles[part], links)
        return found
