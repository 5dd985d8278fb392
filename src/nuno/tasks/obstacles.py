"""Obstacles: bodies of a world that a robot's trunk and arms must not run into."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.coal_shapes import primitive, surface
from nuno.robot.pinocchio import pin
from nuno.shapes.shape import Plane

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.humanoid import Humanoid


class Obstacles:
    """Bodies where they are now, against the links that some joints carry.

    Args:
        robot: The robot.
        bodies: The bodies; planes are passed over, as a robot stands on them.
        carried_by: Joints (Pinocchio's index) of which any carries the links that count.
    """

    def __init__(self, robot: Humanoid, bodies: Iterable[Body], carried_by: Iterable[int]) -> None:
        self._robot, joints = robot, set(carried_by)
        self._model = robot.geometry._read(pin.GeometryType.COLLISION)
        links = [
            k for k, part in enumerate(self._model.geometryObjects)
            if joints & set(robot.model.supports[part.parentJoint])
        ]  # fmt: skip
        for body in bodies:
            if isinstance(body.shape, Plane):
                continue
            place = pin.SE3.Identity()
            position, (w, x, y, z) = body.pose()
            if (shape := primitive(body.shape)) is not None:
                place = pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), np.array(position))
            else:
                shape = surface(body.vertices, body.faces)
            index = self._model.addGeometryObject(pin.GeometryObject(body.name, 0, place, shape))
            for link in links:
                self._model.addCollisionPair(pin.CollisionPair(link, index))
        self._data, self._own = self._model.createData(), robot.model.createData()

    def met(self, q: np.ndarray) -> tuple[str, str] | None:
        """Return a link and a body that overlap in a configuration (nq,), None where none do."""
        if not pin.computeCollisions(self._robot.model, self._own, self._model, self._data, q, True):
            return None
        for pair, found in zip(self._model.collisionPairs, self._data.collisionResults, strict=True):
            if found.isCollision():
                link, body = (self._model.geometryObjects[k] for k in (pair.first, pair.second))
                return str(self._robot.model.frames[link.parentFrame].name), str(body.name)
        return None
