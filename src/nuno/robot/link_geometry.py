"""The meshes of a robot's links: as shapes for bodies, and which of them run into each other."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import MeshError
from nuno.robot.fingers import fingers_of
from nuno.robot.pinocchio import pin
from nuno.robot.placement import quaternion_of
from nuno.shapes import quaternion as quat
from nuno.shapes.compound import Compound, Part
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Shape, Sphere, TriangleMesh

if TYPE_CHECKING:
    from nuno.robot.robot_model import RobotModel

logger = logging.getLogger(__name__)

SIMPLE = 2e-3
"""[m] By how much the hulls of links that move dynamically may be smaller than the links' own."""
SOLE = 1e-4
"""[m] Likewise of feet, which tilt by that much over their length, and of fingers."""
BARE = 0.01
"""[m] Radius of what stands for a joint that carries no shape; it touches nothing."""


@dataclass(frozen=True, eq=False)
class LinkShape:
    """A shape that a joint carries.

    Attributes:
        link: The link's name.
        joint: Pinocchio's index of the joint.
        shape: The shape.
        position: (3,) float [m], of the shape's centre in the joint's frame.
        quaternion: (4,) float, (w, x, y, z), likewise.
        color: (r, g, b) in [0, 1], as the URDF gives it.
    """

    link: str
    joint: int
    shape: Shape
    position: np.ndarray
    quaternion: np.ndarray
    color: tuple[float, float, float]

    @property
    def is_bare(self) -> bool:
        """Return True if this only stands for a joint that carries no shape."""
        return isinstance(self.shape, Sphere) and self.shape.radius == BARE


class Geometry:
    """Shapes of a robot's links from its URDF, read where first asked for.

    Args:
        robot: Whose; its posture tells which links overlap of themselves.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._data = robot.model.createData()

    def shapes(self, meshes: str) -> tuple[LinkShape, ...]:
        """Return the shapes of all links, "collision" (convex hulls) or "visual" (as they are)."""
        return self._collision_shapes if meshes == "collision" else self._visual_shapes

    def of_joints(self) -> tuple[LinkShape, ...]:
        """Return one shape for each joint, the base's first, then one for each finger that slides.

        It is what the joint carries, in its own frame; a finger's is in the frame of the joint that carries the hand,
        with open fingers. A joint that carries no shape gets a small ball, called after the joint.
        """
        robot, found = self._robot, []
        feet = {int(robot.model.frames[robot.frame_index(foot)].parentJoint) for foot in robot.description.feet}
        fingers = fingers_of(robot)
        apart = {link for finger in fingers for link in finger.links}
        groups: list[tuple[int, Any]] = [(joint, None) for joint in range(1, robot.model.njoints)]
        for joint, finger in groups + [(finger.joint, finger) for finger in fingers]:
            own = [part for part in self._collision_shapes if part.joint == joint and part.link not in apart]
            if finger is not None:
                own = [part for part in self._collision_shapes if part.link in finger.links]
            name = own[0].link if own else str(robot.model.names[joint])
            smaller = SOLE if finger is not None or joint in feet else SIMPLE
            parts = tuple(_simple_part(part, smaller) for part in own)
            shape = Compound(parts) if own else Sphere(BARE)  # type: ignore[arg-type]
            color = own[0].color if own else (0.5, 0.5, 0.5)
            found.append(LinkShape(name, joint, shape, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), color))
        return tuple(found)

    def collisions(self, q: np.ndarray, first_only: bool = False) -> list[tuple[str, str]]:
        """Return the pairs of links that overlap in a configuration (nq,)."""
        model, data = self._collision_model
        if not pin.computeCollisions(self._robot.model, self._data, model, data, q, first_only):
            return []
        return self._colliding(model, data)

    @cached_property
    def _collision_shapes(self) -> tuple[LinkShape, ...]:
        return tuple(self._link_shape(part, True) for part in self._read(pin.GeometryType.COLLISION).geometryObjects)

    @cached_property
    def _visual_shapes(self) -> tuple[LinkShape, ...]:
        return tuple(self._link_shape(part, False) for part in self._read(pin.GeometryType.VISUAL).geometryObjects)

    @cached_property
    def _collision_model(self) -> tuple[Any, Any]:
        robot = self._robot
        made = self._read(pin.GeometryType.COLLISION)
        made.addAllCollisionPairs()
        parents = robot.model.parents
        if robot.description.srdf is not None:
            pin.removeCollisionPairs(robot.model, made, str(robot.description.srdf), False)
        joint = [part.parentJoint for part in made.geometryObjects]
        # numbers, as the pairs themselves change when one before them is removed
        pairs = [(pair.first, pair.second) for pair in made.collisionPairs]
        kept = [(m, n) for m, n in pairs if joint[m] != joint[n]]
        if robot.description.srdf is None:
            kept = [(m, n) for m, n in kept if parents[joint[m]] != joint[n] and parents[joint[n]] != joint[m]]
        _set_pairs(made, kept)
        data = made.createData()
        pin.computeCollisions(robot.model, self._data, made, data, robot.posture_configuration(), False)
        overlapping = [found.isCollision() for found in data.collisionResults]
        if any(overlapping):
            named = ", ".join(" and ".join(pair) for pair in self._colliding(made, data))
            logger.info("%s overlap in the posture of %r and are not checked: %s", sum(overlapping), robot.name, named)
            _set_pairs(made, [pair for pair, over in zip(kept, overlapping, strict=True) if not over])
        return made, made.createData()

    def _read(self, kind: Any) -> Any:
        own = self._robot.description
        folders = [str(folder) for folder in own.package_dirs]
        try:
            return pin.buildGeomFromUrdf(self._robot.model, str(own.urdf), kind, package_dirs=folders)
        except (ValueError, RuntimeError) as error:
            raise MeshError(f"cannot read the meshes of {own.name!r}: {error}") from error

    def _colliding(self, model: Any, data: Any) -> list[tuple[str, str]]:
        return [
            (self._link_of(model.geometryObjects[pair.first]), self._link_of(model.geometryObjects[pair.second]))
            for pair, found in zip(model.collisionPairs, data.collisionResults, strict=True)
            if found.isCollision()
        ]

    def _link_of(self, part: Any) -> str:
        return str(self._robot.model.frames[part.parentFrame].name)

    def _link_shape(self, part: Any, as_hull: bool) -> LinkShape:
        shape, offset = shape_of(part, as_hull)
        placement = part.placement
        position = placement.translation + placement.rotation @ offset
        color = tuple(float(c) for c in np.clip(part.meshColor[:3], 0.0, 1.0))
        return LinkShape(
            self._link_of(part), int(part.parentJoint), shape, position,
            quaternion_of(placement.rotation), color,  # type: ignore[arg-type]
        )  # fmt: skip


def _set_pairs(model: Any, pairs: Sequence[tuple[int, int]]) -> None:
    model.removeAllCollisionPairs()
    for m, n in pairs:
        model.addCollisionPair(pin.CollisionPair(m, n))


def shape_of(part: Any, as_hull: bool) -> tuple[Shape, np.ndarray]:
    """Return a shape, and where its centre is in the frame of the geometry."""
    own, origin = part.geometry, np.zeros(3)
    kind = type(own).__name__
    if kind == "Box":
        return Box(tuple(2.0 * own.halfSide)), origin
    if kind == "Sphere":
        return Sphere(own.radius), origin
    if kind == "Cylinder":
        return Cylinder(own.radius, 2.0 * own.halfLength), origin
    if kind == "Capsule":
        return Capsule(own.radius, 2.0 * own.halfLength), origin
    if kind.startswith("Convex"):
        vertices, faces = convex_hull(np.array(own.points()).reshape(-1, 3))
        shape = TriangleMesh(vertices, faces)
        return shape, shape.centre
    if not hasattr(own, "num_tris"):
        raise MeshError(
            f"the geometry {part.name!r} is a {kind}; Nuno takes meshes, hulls, boxes, spheres, cylinders, capsules"
        )
    vertices = np.array(own.vertices())
    if as_hull:
        vertices, faces = convex_hull(vertices)
    else:
        triangles = [own.tri_indices(k) for k in range(own.num_tris)]
        faces = np.array([(t[0], t[1], t[2]) for t in triangles], dtype=np.int64)
        if np.prod(part.meshScale) < 0.0:  # a mirrored mesh is inside out
            faces = faces[:, ::-1]
    a, b, c = faces.T
    shape = TriangleMesh(vertices, faces[(a != b) & (b != c) & (c != a)])
    return shape, shape.centre


def convex_hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (k, 3) and faces (m, 3), looking outwards, of the convex hull of points (n, 3)."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    number = np.zeros(len(points), dtype=np.int64)
    number[hull.vertices] = np.arange(len(hull.vertices))
    return points[hull.vertices], number[faces]


def _simple_part(part: LinkShape, smaller: float) -> Part:
    """Return a link's shape as a part of a compound, its hull up to ``smaller`` [m] smaller."""
    shape, position = part.shape, part.position
    if isinstance(shape, TriangleMesh):
        shape = Hull.of(few_corners(np.asarray(shape.mesh()[0], dtype=float), smaller))
        position = position + quat.rotate(part.quaternion, shape.centre)
    return shape, tuple(position), tuple(part.quaternion)  # type: ignore[return-value]


def few_corners(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Return some of the points (n, 3) [m], whose hull leaves none of the others out by ``tolerance`` or more."""
    from scipy.spatial import ConvexHull

    along = points @ _directions().T
    chosen = sorted({int(k) for k in (*along.argmax(axis=0), *along.argmin(axis=0))})
    while True:
        planes = ConvexHull(points[chosen]).equations
        outside = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        if outside.max() < tolerance:
            return points[chosen]
        chosen.append(int(outside.argmax()))


def _directions() -> np.ndarray:
    """The 13 directions of a cube's faces, edges and corners, (13, 3)."""
    grid = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid[:13]
