"""Looks: the visual meshes of a robot's links, on the bodies that stand for the links in a world."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.link_geometry import LinkShape
from nuno.robot.pinocchio import pin
from nuno.shapes.coordinates import Pose, compose, invert

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.robot import Robot

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Look:
    """A visual mesh.

    Attributes:
        body: Which of the links' bodies it goes along with.
        shape: The mesh, and the link that it is of.
        pose: Where it is in the frame of that body.
    """

    body: int
    shape: LinkShape
    pose: Pose


def looks_of(links: Links) -> list[Look]:
    """Return what links look like.

    A mesh goes along with its link's body, or with another one of its joint. Where there is none, as at two joints in
    G1's waist, it goes along with the joint before, turned as its own is now.

    Raises:
        MeshError: a visual mesh that cannot be read.
    """
    robot = links.robot
    by_link: dict[str, int] = {}
    by_joint: dict[int, int] = {}
    for number, link in enumerate(links.names):
        by_link.setdefault(link, number)
        by_joint.setdefault(links.joints[number], number)
    for finger, numbers in zip(links.finger_bodies.fingers, links.finger_bodies.bodies, strict=True):
        for link in finger.links if numbers else ():
            by_link.setdefault(link, numbers[0])
    frames = _joint_frames(robot)
    found = []
    for shape in robot.geometry.shapes("visual"):
        joint, own = shape.joint, (shape.position, shape.quaternion)
        k = by_link.get(shape.link)
        while k is None and joint > 0:
            k = by_joint.get(joint)
            if k is None:
                own, joint = compose(frames[joint], own), int(robot.model.parents[joint])
        if k is None:
            logger.warning("the visual mesh of %r has no body to go along with and is not drawn", shape.link)
            continue
        place, turn = compose(invert(links.offset_of(k)), own)
        found.append(Look(k, shape, (place, turn / np.linalg.norm(turn))))
    return found


def _joint_frames(robot: Robot) -> list[Pose]:
    """Return where each joint is in the frame of the joint before it, as the robot stands now."""
    data = robot.model.createData()  # not the robot's own, which its program may be using
    pin.forwardKinematics(robot.model, data, robot.configuration())
    placed = np.array([pin.SE3ToXYZQUAT(placement) for placement in data.liMi])
    return [(row[:3], row[[6, 3, 4, 5]]) for row in placed]
