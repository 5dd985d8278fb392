"""The visual meshes that a robot's links are drawn as, while the bodies that touch things are their hulls."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from nuno.coordinates import Pose, compose, invert
from nuno.viewer.cast import Garment

if TYPE_CHECKING:
    from nuno.body import Body
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links

LOG = logging.getLogger(__name__)


class Wardrobe:
    """What bodies are drawn as, by body key; nothing of links that are visual meshes already.

    A visual mesh goes along with the first body of its joint, in place of all bodies of that joint. Where there is
    none, as at two joints in G1's waist, it goes along with the joint before, turned as the joint was at first.

    Args:
        robots: Links whose bodies are in the world as copies; of the others, their bodies tell.
    """

    def __init__(self, robots: Iterable[Links] = ()) -> None:
        self._known: list[Links] = []
        self._garments: dict[str, list[Garment]] = {}
        for links in robots:
            self._take(links)

    def of(self, body: Body) -> list[Garment] | None:
        """Return what to draw in place of a body; None is the body itself.

        Raises:
            MeshError: a visual mesh that cannot be read.
        """
        links = body._links
        if links is not None and not any(links is known for known in self._known):
            self._take(links)
        return self._garments.get(body.key)

    def _take(self, links: Links) -> None:
        self._known.append(links)
        if any(body.group == 0 for body in links.bodies):
            return
        hulls = links.robot.geometry.shapes("collision")
        carriers: dict[int, int] = {}
        for k, hull in enumerate(hulls):
            carriers.setdefault(hull.joint, k)
        worn: dict[str, list[Garment]] = {body.key: [] for body in links.bodies}
        frames = _joint_frames(links.robot)
        names: Counter[str] = Counter()
        for shape in links.robot.geometry.shapes("visual"):
            joint, own = shape.joint, (shape.position, shape.quaternion)
            while joint not in carriers and joint > 0:
                own, joint = compose(frames[joint], own), int(links.robot.model.parents[joint])
            if joint not in carriers:
                LOG.warning("the visual mesh of %r has no body to go along with and is not drawn", shape.link)
                continue
            k = carriers[joint]
            place, turn = compose(invert((hulls[k].position, hulls[k].quaternion)), own)
            names[shape.link] += 1
            name = shape.link if names[shape.link] == 1 else f"{shape.link}_{names[shape.link]}"
            pose = (place, turn / np.linalg.norm(turn))
            worn[links.bodies[k].key].append(Garment((links.robot.name, name), shape.shape, pose, shape.color))
        self._garments |= worn


def _joint_frames(robot: Humanoid) -> list[Pose]:
    """Return where each joint is in the frame of the joint before it, as the robot stands now."""
    import pinocchio as pin

    data = robot.model.createData()  # not the robot's own, which its program may be using
    pin.forwardKinematics(robot.model, data, robot.configuration())
    placed = np.array([pin.SE3ToXYZQUAT(placement) for placement in data.liMi])
    return [(row[:3], row[[6, 3, 4, 5]]) for row in placed]
