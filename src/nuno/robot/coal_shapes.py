"""Shapes as coal has them, the library that measures how far two are from each other, or how deep in each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.link_geometry import convex_hull
from nuno.robot.pinocchio import coal
from nuno.shapes import quaternion as quat
from nuno.shapes.compound import Compound
from nuno.shapes.shape import Box, Capsule, Cylinder, Hull, Plane, Sphere

if TYPE_CHECKING:
    from nuno.robot.robot import Robot
    from nuno.shapes.shape import Shape


@dataclass(frozen=True, eq=False)
class SolidPart:
    """A shape that is fixed in a frame.

    Attributes:
        geometry: Coal's.
        position: (3,) float [m], in the frame.
        rotation: (3, 3) float, likewise.
    """

    geometry: Any
    position: np.ndarray
    rotation: np.ndarray


class LinkHulls:
    """The convex hulls of a robot's collision shapes, each in the frame of the joint that carries it.

    Args:
        robot: The robot; only its model counts.

    Attributes:
        names: Of the links, m of them.
        joints: (m,) int, Pinocchio's indices of the joints.
        centres: (m, 3) float [m], of balls around the hulls, in the joints' frames.
        radii: (m,) float [m], of those.
    """

    def __init__(self, robot: Robot) -> None:
        parts = robot.geometry.shapes("collision")
        self.names = tuple(part.link for part in parts)
        self.joints = np.array([part.joint for part in parts], dtype=int)
        self._parts = parts
        corners = [quat.rotate(part.quaternion, np.asarray(part.shape.mesh()[0])) + part.position for part in parts]
        self.centres = np.array([0.5 * (own.min(axis=0) + own.max(axis=0)) for own in corners]).reshape(-1, 3)
        far = [np.linalg.norm(own - centre, axis=1).max() for own, centre in zip(corners, self.centres, strict=True)]
        self.radii = np.array(far)

    @cached_property
    def hulls(self) -> tuple[Any, ...]:
        """Coal's hulls, about ``centres``, along the joints' axes."""
        made = []
        for part, centre in zip(self._parts, self.centres, strict=True):
            corners = quat.rotate(part.quaternion, np.asarray(part.shape.mesh()[0])) + part.position
            made.append(convex(corners - centre))
        return tuple(made)


def solid_parts(shape: Shape) -> tuple[SolidPart, ...]:
    """Return a shape as coal has it; planes have all that is below them, closed meshes their surface alone."""
    if isinstance(shape, Compound):
        found = []
        for own, place, turn in shape.parts:
            axes = quat.to_matrix(np.array(turn))
            found += [
                SolidPart(part.geometry, axes @ part.position + np.array(place), axes @ part.rotation)
                for part in solid_parts(own)
            ]
        return tuple(found)
    return (SolidPart(_geometry(shape), np.zeros(3), np.eye(3)),)


def convex(points: np.ndarray) -> Any:
    """Return coal's hull of points (n, 3) [m]."""
    vertices, faces = convex_hull(points)
    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in vertices:
        corners.append(vertex)
    for a, b, c in faces.tolist():
        triangles.append(coal.Triangle(a, b, c))
    return coal.Convex(corners, triangles)


def primitive(shape: Shape) -> Any:
    """Return a shape that coal has too, about its own origin; else None."""
    if isinstance(shape, Box):
        return coal.Box(*shape.size)
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius)
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius, shape.height)
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius, shape.height)
    return None


def surface(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Return triangles (m, 3) between vertices (n, 3) [m] as coal has them; their inside does not count."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(np.asarray(vertices, dtype=float))
    mesh.addTriangles(np.asarray(faces, dtype=np.int64))
    mesh.endModel()
    return mesh


def _geometry(shape: Shape) -> Any:
    if (found := primitive(shape)) is not None:
        return found
    if isinstance(shape, Plane):
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    vertices, faces = shape.mesh()
    if isinstance(shape, Hull):
        return convex(np.asarray(vertices, dtype=float))
    return surface(vertices, faces)
