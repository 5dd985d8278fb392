"""A robot's arms as what a carried thing lies on: the shapes of their links, and where those are along a motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError, RobotModelError
from nuno.robot.link_geometry import LinkShape
from nuno.robot.pinocchio import pin
from nuno.robot.placement import quaternion_of
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates
from nuno.shapes.shape import Box, Hull, TriangleMesh
from nuno.tasks.simple_hull import simple_hull

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

HANDS = ("left_hand", "right_hand")
SHAPES = ("hulls", "boxes")
ERROR = 1e-3
"""[m] How far the hulls that are touched may be from those of the links: a twentieth of what the mat is thick."""
SMALLEST = 1e-4
"""[m3] Links in smaller boxes (sensors between two links) add nothing that their neighbours lack."""
LEVEL = np.array([0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)])
"""(w, x, y, z) of a hand that points forward, its x axis up."""


@dataclass(frozen=True, eq=False)
class ArmShape:
    """A shape of the arms or of the trunk between them.

    Attributes:
        part: The shape, in the frame of its joint.
        side: 0 of the left arm, 1 of the right one, -1 of the trunk.
    """

    part: LinkShape
    side: int


def arm_shapes(robot: Humanoid, kind: str = "hulls") -> tuple[ArmShape, ...]:
    """Return the shapes of both arms and of the link that carries them.

    A hand with all that is on it is one convex shape: a mat lies on a gripper and does not go into it, where its
    vertices would pass between the fingers.

    Args:
        robot: A robot with the frames "left_hand" and "right_hand".
        kind: "hulls", the convex hulls of the links' collision shapes, with fewer faces and no farther from them than
            ``ERROR``; or "boxes", the smallest box around each.

    Raises:
        InvalidInputError: another kind.
        RobotModelError: the robot has no two hands.
    """
    if kind not in SHAPES:
        raise InvalidInputError(f"arms must be one of {SHAPES}, got {kind!r}")
    left, right = (_chain(robot, hand) for hand in HANDS)
    shared = set(left) & set(right)
    own = [[j for j in chain if j not in shared] for chain in (left, right)]
    if not own[0] or not own[1]:
        raise RobotModelError(f"the hands of {robot.name!r} are on one arm; two arms are needed to carry")
    trunk = max(shared)
    parts: dict[tuple[int, str], list[LinkShape]] = {}
    for part in robot.geometry.shapes("collision"):
        above = set(robot.model.supports[part.joint])
        for side in range(2):
            if own[side][-1] in above:
                parts.setdefault((side, HANDS[side]), []).append(part)
            elif own[side][0] in above:
                parts.setdefault((side, part.link), []).append(part)
        if part.joint == trunk:
            parts.setdefault((-1, part.link), []).append(part)
    pin.forwardKinematics(robot.model, robot.scratch, robot.posture_configuration())
    placed = robot.scratch.oMi
    found = []
    for (side, name), group in parts.items():
        whole = group[0] if len(group) == 1 else _joined(name, group, placed)
        if np.prod(np.ptp(whole.shape.mesh()[0], axis=0)) >= SMALLEST:
            found.append(ArmShape(_boxed(whole) if kind == "boxes" else _simple(whole), side))
    return tuple(found)


def hands_level(robot: Humanoid, distance: float, forward: float, height: float) -> np.ndarray:
    """Return the configuration (nq,) of a robot that stands at the origin with its hands level, side by side.

    Args:
        robot: Which stands in its posture afterwards, as before.
        distance: Between the hands [m].
        forward: Of the hands from the middle of the soles [m].
        height: Of the hands above the floor [m].

    Raises:
        RobotModelError: the robot has no legs, or its arms do not reach there.
    """
    if not robot.description.feet:
        raise RobotModelError(f"{robot.name!r} has no legs to carry anything with: its description names no feet")
    missing = [hand for hand in HANDS if hand not in robot.description.frames]
    if missing:
        raise RobotModelError(f"{robot.name!r} has no {missing[0]}: its description names none")
    robot.stand()
    targets = {
        hand: Coordinates((forward, side * 0.5 * distance, height), LEVEL)
        for hand, side in zip(HANDS, (1.0, -1.0), strict=True)
    }
    # the base keeps its place too: a walk sets it upright, and what it leaned before would count as unsteadiness
    found = robot.reach(targets, stance=(*robot.feet, robot.model.names[1]))
    q = robot.configuration()
    robot.stand()
    if not found:
        raise RobotModelError(
            f"the arms of {robot.name!r} cannot be held {distance:.3f} m apart, {forward:.3f} m ahead and "
            f"{height:.3f} m high: {found.reason}"
        )
    return q


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """Poses of arms along a motion.

    Attributes:
        base: (k, 3) [m], of the robot's base link.
        hands: (k, 2, 3) [m], of the frames of the left and the right hand.
        joints: (k, joints, 7), the poses of the robot's joints as Pinocchio gives them.
    """

    base: np.ndarray
    hands: np.ndarray
    joints: np.ndarray

    @classmethod
    def of(cls, robot: Humanoid, configurations: np.ndarray) -> ArmMotion:
        """Return the motion through configurations (k, nq)."""
        data: Any = robot.scratch
        frames = [robot.frame_index(hand) for hand in HANDS]
        hands = np.empty((len(configurations), 2, 3))
        joints = np.empty((len(configurations), robot.model.njoints, 7))
        for k, q in enumerate(configurations):
            pin.framesForwardKinematics(robot.model, data, q)
            hands[k] = [data.oMf[frame].translation for frame in frames]
            joints[k] = [pin.SE3ToXYZQUAT(place) for place in data.oMi]
        return cls(np.array(configurations)[:, :3], hands, joints)

    def poses(self, shapes: Iterable[ArmShape]) -> tuple[np.ndarray, np.ndarray]:
        """Return where shapes are: positions (shapes, k, 3) [m] and quaternions (shapes, k, 4)."""
        chosen = list(shapes)
        places = self.joints[:, [shape.part.joint for shape in chosen]].transpose(1, 0, 2)
        turns = places[..., [6, 3, 4, 5]]
        offsets = np.array([shape.part.position for shape in chosen])[:, None]
        own = np.array([shape.part.quaternion for shape in chosen])[:, None]
        positions = places[..., :3] + quat.rotate(turns, np.broadcast_to(offsets, turns[..., :3].shape))
        return positions, quat.multiply(turns, np.broadcast_to(own, turns.shape))


def _chain(robot: Humanoid, hand: str) -> list[int]:
    """Return the joints from the base to a hand."""
    if hand not in robot.description.frames:
        raise RobotModelError(f"{robot.name!r} has no {hand}: its description names none")
    return [int(j) for j in robot.model.supports[robot.model.frames[robot.frame_index(hand)].parentJoint]]


def _joined(name: str, group: list[LinkShape], placed: Any) -> LinkShape:
    """Return the convex hull of shapes, in the frame of the first one's joint, as the joints are placed."""
    first = group[0]
    back = placed[first.joint].inverse()
    points = []
    for part in group:
        vertices = part.position + quat.rotate(part.quaternion, part.shape.mesh()[0])
        to_first = back * placed[part.joint]
        points.append(vertices @ to_first.rotation.T + to_first.translation)
    shape = Hull.of(np.concatenate(points))
    return LinkShape(name, first.joint, shape, shape.centre, quat.IDENTITY, first.color)


def _simple(part: LinkShape) -> LinkShape:
    """Return a shape of triangles as a hull of fewer faces, in its place."""
    if not isinstance(part.shape, TriangleMesh):
        return part
    shape, _ = simple_hull(part.shape.mesh()[0], ERROR)
    return replace(part, shape=shape, position=part.position + quat.rotate(part.quaternion, shape.centre))


def _boxed(part: LinkShape) -> LinkShape:
    """Return the smallest box around a shape, turned as it need be, in the shape's place."""
    from trimesh.bounds import oriented_bounds

    if isinstance(part.shape, Box):
        return part
    to_box, size = oriented_bounds(part.shape.mesh()[0])
    placement = np.linalg.inv(to_box)
    return replace(
        part, shape=Box(tuple(size)), position=part.position + quat.rotate(part.quaternion, placement[:3, 3]),
        quaternion=quat.multiply(part.quaternion, quaternion_of(placement[:3, :3])),
    )  # fmt: skip
