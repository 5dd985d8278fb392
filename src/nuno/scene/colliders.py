"""Static shapes as tables for the contact kernels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.contact.shapes import BOX, CAPSULE, COLUMNS, CYLINDER, PLANE, SHELL_MESH, SOLID_MESH, SPHERE
from nuno.errors import BodyStateError
from nuno.shape import Box, Capsule, Cylinder, Plane, Sphere
from nuno.solver.state import Shapes

if TYPE_CHECKING:
    from nuno.body import Body

UNBOUNDED = 1.0e9
"""[m] Bounding radius of a plane."""


def rotation_matrices(quaternions: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotation matrices of unit quaternions (..., 4) as (w, x, y, z)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=float), -1, 0)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=-1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1),
        ],
        axis=-2,
    )


class Colliders:
    """The static bodies as the kernels see them.

    Attributes:
        shapes: The Warp struct.
        count: Number of shapes.
    """

    def __init__(self, shapes: Shapes, count: int, meshes: list[Any]) -> None:
        self.shapes, self.count, self._meshes = shapes, count, meshes

    @classmethod
    def from_bodies(
        cls,
        bodies: Sequence[Body],
        world_count: int = 1,
        device: str = "cpu",
        *,
        pair_friction: Mapping[str, float] | None = None,
    ) -> Colliders:
        """Build the tables.

        Args:
            bodies: Static bodies; poses may be per world.
            world_count: Worlds in the batch.
            device: Where the tables live.
            pair_friction: By body name, a friction coefficient against the touching body that overrides the
                geometric mean.
        """
        pair_friction = pair_friction or {}
        flat: list[tuple[Any, int, np.ndarray]] = []
        per_world = any(_differs(body, pair_friction.get(body.name)) for body in bodies)
        worlds = world_count if per_world else 1
        meshes: list[Any] = []
        ids = np.zeros((worlds, max(1, len(bodies))), dtype=np.uint64)
        for k, body in enumerate(bodies):
            kind, sizes, radius = _describe(body)
            row = np.zeros((worlds, COLUMNS), dtype=np.float32)
            row[:, 12:15] = sizes
            row[:, 15] = body.friction
            row[:, 16] = pair_friction.get(body.name, -1.0)
            row[:, 18] = radius
            if kind in (SOLID_MESH, SHELL_MESH):
                # meshes stand in world coordinates: their pose is the identity
                row[:, 3:12] = np.eye(3).ravel()
                row[:, 17] = 0.5 * float(getattr(body, "thickness", 0.0) or 0.0) if kind == SHELL_MESH else 0.0
                surface, faces = body.surface()
                vertices = np.asarray(surface, dtype=np.float32)
                vertices = vertices if vertices.ndim == 3 else vertices[None]
                made: list[Any] = []
                for v in range(worlds):
                    points = vertices[v if len(vertices) > 1 else 0]
                    if v == 0 or len(vertices) > 1:
                        made.append(
                            wp.Mesh(
                                points=wp.array(points, dtype=wp.vec3, device=device),
                                indices=wp.array(np.asarray(faces, np.int32).ravel(), dtype=int, device=device),
                            )
                        )
                    ids[v, k] = made[-1].id
                    low, high = points.min(axis=0), points.max(axis=0)
                    row[v, :3] = 0.0
                    row[v, 18] = float(np.abs(np.concatenate([low, high])).max())
                meshes += made
            else:
                row[:, :3] = body.position
                row[:, 3:12] = rotation_matrices(np.asarray(body.quaternion)).reshape(-1, 9)
            flat.append((None, kind, row))
        shapes = Shapes()
        shapes.count = len(bodies)
        kinds = np.array([kind for _, kind, _ in flat] or [PLANE], dtype=np.int32)
        table = np.stack([row for _, _, row in flat], axis=1) if flat else np.zeros((1, 1, COLUMNS), np.float32)
        shapes.stride = table.shape[1] * COLUMNS if table.shape[0] > 1 else 0
        shapes.mesh_stride = ids.shape[1] if worlds > 1 else 0
        shapes.kind = wp.array(kinds, dtype=int, device=device)
        shapes.table = wp.array(np.ascontiguousarray(table).ravel(), dtype=float, device=device)
        shapes.mesh = wp.array(ids.ravel(), dtype=wp.uint64, device=device)
        return cls(shapes, len(bodies), meshes)


def _differs(body: Body, pair: Any) -> bool:
    """Whether anything about a body is given per world."""
    posed = np.ndim(body.position) == 2 or np.ndim(body.quaternion) == 2
    rubs = np.ndim(body.friction) == 1 or np.ndim(pair if pair is not None else 0.0) == 1
    curved = not isinstance(body.shape, Box | Sphere | Cylinder | Capsule | Plane)
    return posed or rubs or (curved and np.ndim(body.surface()[0]) == 3)


def _describe(body: Body) -> tuple[int, tuple[float, float, float], float]:
    """Kind, sizes and bounding radius of a body's shape."""
    shape = body.shape
    if isinstance(shape, Box):
        half = np.asarray(shape.size, dtype=float) / 2
        return BOX, (float(half[0]), float(half[1]), float(half[2])), float(np.linalg.norm(half))
    if isinstance(shape, Sphere):
        return SPHERE, (shape.radius, 0.0, 0.0), shape.radius
    if isinstance(shape, Cylinder):
        return CYLINDER, (shape.radius, shape.height / 2, 0.0), float(np.hypot(shape.radius, shape.height / 2))
    if isinstance(shape, Capsule):
        return CAPSULE, (shape.radius, shape.height / 2, 0.0), shape.radius + shape.height / 2
    if isinstance(shape, Plane):
        return PLANE, (0.0, 0.0, 0.0), UNBOUNDED
    if body.faces is None or len(body.faces) == 0:
        raise BodyStateError(f"{body.name!r} has neither a known shape nor faces to collide with")
    solid = bool(getattr(body, "is_solid", False))
    return (SOLID_MESH if solid else SHELL_MESH), (0.0, 0.0, 0.0), UNBOUNDED
