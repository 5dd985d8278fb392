"""Parts of rigid bodies as Newton's shapes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from nuno.rigid import convex
from nuno.rigid.convex_parts import RigidPart


def add_part(scene: Any, part: RigidPart, body: int, config: Any, world: int) -> int:
    """Add a part to a body (-1: the room) and return its shape's index."""
    import newton
    import warp as wp

    place = np.zeros(3) if part.position is None else part.position
    turn = np.array([1.0, 0.0, 0.0, 0.0]) if part.quaternion is None else part.quaternion
    at = wp.transform(wp.vec3(*np.asarray(place).tolist()), wp.quat(*np.asarray(turn)[[1, 2, 3, 0]].tolist()))
    x, y, z = part.half.tolist()
    if part.kind == convex.BOX_PART:
        return int(scene.add_shape_box(body, xform=at, hx=x, hy=y, hz=z, cfg=config))
    if part.kind == convex.SPHERE_PART:
        return int(scene.add_shape_sphere(body, xform=at, radius=x, cfg=config))
    if part.kind == convex.CAPSULE_PART:
        return int(scene.add_shape_capsule(body, xform=at, radius=x, half_height=y, cfg=config))
    if part.kind == convex.CYLINDER_PART:
        return int(scene.add_shape_cylinder(body, xform=at, radius=x, half_height=y, cfg=config))
    if part.kind == convex.FLAT:
        return int(scene.add_shape_plane(None, xform=at, width=0.0, length=0.0, body=body, cfg=config))
    if part.kind == convex.HULL:
        assert part.corners is not None
        fans = [[(loop[0], *pair) for pair in pairwise(loop[1:])] for loop in part.loops]
        faces = np.concatenate(fans)
        hull = newton.Mesh(part.corners.astype(np.float32), faces.astype(np.int32).ravel(), compute_inertia=False)
        return int(scene.add_shape_convex_hull(body, xform=at, mesh=hull, cfg=config))
    assert part.vertices is not None and part.faces is not None
    vertices = part.vertices if part.vertices.ndim == 2 else part.vertices[min(world, len(part.vertices) - 1)]
    surface = newton.Mesh(vertices.astype(np.float32), part.faces.astype(np.int32).ravel(), compute_inertia=False)
    return int(scene.add_shape_mesh(body, xform=at, mesh=surface, cfg=config))
