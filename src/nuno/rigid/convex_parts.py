"""Shapes as the convex parts that rigid bodies are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from nuno.errors import MeshError
from nuno.rigid.convex import BOX_PART, CAPSULE_PART, CYLINDER_PART, FLAT, HULL, SHELL, SPHERE_PART, SURFACE
from nuno.shapes import quaternion
from nuno.shapes.shape import Box, Capsule, Cylinder, Plane, Shape, Sphere

INSET = 0.25
"""Share of its smallest half side by which a part's core is smaller: how far parts may press into each other before the
direction between them is found more coarsely."""
ENDLESS = 1.0e9
"""[m] How far a plane reaches."""
REMEMBERED = 4096
"""Points of a hull, up to which its part is kept for who asks again: 25 MB for as many as are kept."""


@dataclass(frozen=True, eq=False)
class RigidPart:
    """A convex part, or a mesh, in the frame of its body's shape.

    Attributes:
        kind: One of the numbers of `nuno.rigid.convex`.
        half: (3,) float [m], half sides of a box; of round ones the radius and half the height.
        rim: Radius [m] around sphere, capsule and open mesh.
        low, high: (3,) float [m], bounds in the part's frame.
        position: (3,) float [m], where the part's frame is.
        quaternion: (4,) float, (w, x, y, z).
        corners: (n, 3) float [m] of a convex mesh.
        cores: (k, 3) float [m], of the same mesh smaller all round by ``inset``.
        loops: The corners of each face, in a round.
        normals: (faces, 3) float, outwards.
        inset: By how much the core is smaller [m].
        vertices, faces: Of a mesh that is not convex; vertices (n, 3) or (worlds, n, 3).
    """

    kind: int
    half: np.ndarray
    low: np.ndarray
    high: np.ndarray
    rim: float = 0.0
    inset: float = 0.0
    position: np.ndarray | None = None
    quaternion: np.ndarray | None = None
    corners: np.ndarray | None = None
    cores: np.ndarray | None = None
    loops: tuple[np.ndarray, ...] = ()
    normals: np.ndarray | None = None
    vertices: np.ndarray | None = None
    faces: np.ndarray | None = None

    @property
    def radius(self) -> float:
        """Of a sphere [m] around the middle of the bounds."""
        return min(0.5 * float(np.linalg.norm(self.high - self.low)), ENDLESS)

    def placed(self, position: np.ndarray, turn: np.ndarray) -> RigidPart:
        """Return the part where its frame's frame stands at a position, turned by a quaternion."""
        own = np.zeros(3) if self.position is None else self.position
        own_turn = quaternion.IDENTITY if self.quaternion is None else self.quaternion
        return replace(
            self, position=position + quaternion.rotate(turn, own), quaternion=quaternion.multiply(turn, own_turn)
        )


def rigid_shape(shape: Shape, *, moves: bool = True, thickness: float = 0.0, vertices: Any = None,
                is_solid: bool | None = None) -> tuple[RigidPart, ...]:  # fmt: skip
    """Return the convex parts of a body's shape, in the shape's frame.

    Args:
        shape: Any shape; of a mesh that moves, its convex hull counts (a `Compound` has as many parts as one likes).
        moves: Whether the body is to be dynamic. A mesh that is not is taken as it is, triangle by triangle.
        thickness: Of a cloth or an open mesh [m].
        vertices: (n, 3) float [m], or (worlds, n, 3) of what does not move, where the vertices of a mesh or cloth are,
            in the frame that the body's pose is given in; None takes the shape's own.
        is_solid: Whether a mesh that does not move has an inside; None asks the shape.

    Raises:
        MeshError: a mesh without volume or area, or a plane that is to move.
    """
    from nuno.shapes.compound import Compound

    if isinstance(shape, Compound):
        return tuple(
            part.placed(np.asarray(position, float), np.asarray(turn, float))
            for each, position, turn in shape.parts
            for part in rigid_shape(each, moves=moves, thickness=thickness)
        )
    if vertices is None and isinstance(shape, Box | Sphere | Capsule | Cylinder | Plane):
        if isinstance(shape, Plane) and moves:
            raise MeshError("a plane is endless and cannot move; take a box")
        return (_primitive(shape),)
    points, faces = shape.mesh()
    points = np.asarray(points if vertices is None else vertices, dtype=float)
    if moves:
        return (convex_part(points, thickness),)
    solid = shape.is_solid if is_solid is None else is_solid
    rim = 0.0 if solid else 0.5 * float(thickness)
    flat = points.reshape(-1, 3)
    return (
        RigidPart(
            SURFACE if solid else SHELL, np.zeros(3), flat.min(axis=0) - rim, flat.max(axis=0) + rim, rim=rim,
            vertices=points, faces=np.asarray(faces, dtype=np.int32),
        ),
    )  # fmt: skip


@lru_cache(maxsize=512)
def _primitive(shape: Any) -> RigidPart:
    if isinstance(shape, Box):
        half = 0.5 * np.asarray(shape.size)
        return RigidPart(BOX_PART, half, -half, half, inset=INSET * float(half.min()))
    if isinstance(shape, Sphere):
        reach = np.full(3, shape.radius)
        return RigidPart(SPHERE_PART, np.array([shape.radius, 0.0, 0.0]), -reach, reach, rim=shape.radius)
    if isinstance(shape, Capsule):
        reach = np.array([shape.radius, shape.radius, shape.radius + 0.5 * shape.height])
        return RigidPart(
            CAPSULE_PART, np.array([shape.radius, 0.5 * shape.height, 0.0]), -reach, reach, rim=shape.radius
        )
    if isinstance(shape, Cylinder):
        reach = np.array([shape.radius, shape.radius, 0.5 * shape.height])
        half = np.array([shape.radius, 0.5 * shape.height, 0.0])
        return RigidPart(CYLINDER_PART, half, -reach, reach, inset=INSET * float(half[:2].min()))
    reach = np.full(3, ENDLESS)
    return RigidPart(FLAT, np.zeros(3), -reach, np.array([ENDLESS, ENDLESS, 0.0]))


def convex_part(points: np.ndarray, thickness: float = 0.0) -> RigidPart:
    """Return the convex hull of points as a part; flat ones become a plate of ``thickness``, at least 1 mm.

    Parts of up to `REMEMBERED` points are kept, and shared by who asks again.

    Args:
        points: (n, 3) float [m].
        thickness: Of what is flat [m].

    Raises:
        MeshError: all points lie on a line.
    """
    given = np.ascontiguousarray(points, dtype=float)
    if len(given) > REMEMBERED:
        return _convex_part(given, thickness)
    return _remembered_part(given.tobytes(), len(given), float(thickness))


@lru_cache(maxsize=256)
def _remembered_part(points: bytes, count: int, thickness: float) -> RigidPart:
    """`_convex_part`, which takes milliseconds: each time that a robot is imagined its links are asked for again."""
    return _convex_part(np.frombuffer(points).reshape(count, 3), thickness)


def _convex_part(points: np.ndarray, thickness: float) -> RigidPart:
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle, full_matrices=False)
    spread = sizes / np.sqrt(len(points))
    if len(points) < 3 or spread[1] < 1e-6 * max(spread[0], 1e-12):
        raise MeshError("a rigid mesh needs a surface: all its vertices lie on a line")
    depth = (points - middle) @ axes[2]
    if np.ptp(depth) < max(thickness, 1e-3):
        level = points - np.outer(depth, axes[2])
        half = 0.5 * max(thickness, 1e-3) * axes[2]
        points = np.concatenate([level - half, level + half])
    hull = ConvexHull(points)
    corners = points[hull.vertices]
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float(np.linalg.norm(high - low))
    normals, loops = _faces(corners, hull, size)
    planes = np.column_stack([normals, [-(corners[loop] @ n).max() for loop, n in zip(loops, normals, strict=True)]])
    centre, inner = _inner_sphere(planes)
    inset = INSET * inner
    shrunk = HalfspaceIntersection(planes + np.array([0.0, 0.0, 0.0, inset]), centre).intersections
    cores = shrunk[ConvexHull(shrunk).vertices]
    return RigidPart(
        HULL, np.array([inner, 0.0, 0.0]), low, high, inset=inset, corners=corners, cores=cores, loops=loops,
        normals=normals,
    )  # fmt: skip


def _faces(corners: np.ndarray, hull: Any, size: float) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """The plane faces of a hull, triangles of one plane as one: normals, and corners in a round."""
    normals: list[np.ndarray] = []
    loops: list[np.ndarray] = []
    faces_of: list[set[int]] = [set() for _ in corners]
    for plane in hull.equations:
        on = np.flatnonzero(np.abs(corners @ plane[:3] + plane[3]) < 1e-6 * size)
        if len(on) < 3 or set.intersection(*(faces_of[k] for k in on)):
            continue
        for k in on:
            faces_of[k].add(len(loops))
        n = plane[:3]
        arms = corners[on] - corners[on].mean(axis=0)
        u = arms[0] / np.linalg.norm(arms[0])
        angle = np.arctan2(arms @ np.cross(n, u), arms @ u)
        normals.append(n)
        loops.append(on[np.argsort(angle)])
    return np.array(normals), tuple(loops)


def _inner_sphere(planes: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius of the largest sphere inside of planes (n, 4) with outward normals."""
    from scipy.optimize import linprog

    sides = np.column_stack([planes[:, :3], np.ones(len(planes))])
    found = linprog([0.0, 0.0, 0.0, -1.0], A_ub=sides, b_ub=-planes[:, 3], bounds=[(None, None)] * 3 + [(0.0, None)])
    if not found.success or found.x[3] <= 0.0:
        raise MeshError("a rigid mesh needs a volume: its convex hull has none")
    return found.x[:3], float(found.x[3])
