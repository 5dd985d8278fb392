"""Pairs of bodies that overlap, by coal (the extra ``robot``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from nuno.scenes.scene_description import SceneBody
from nuno.scenes.shape_parts import parts_of
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose
from nuno.shapes.shape import Plane

COARSE = 0.005
"""Of a mesh's size, by how much its hull may be smaller."""


def overlapping_pairs(bodies: Sequence[SceneBody]) -> Iterator[tuple[str, str]]:
    """Yield the names of bodies whose shapes overlap; meshes count as their hulls, and planes not at all."""
    solids = {body.name: _solids(body) for body in bodies if body.group and not body.deforms}
    boxes = {name: _bounds(own) for name, own in solids.items() if own}
    for a, b in combinations(boxes, 2):
        if (boxes[a][0] <= boxes[b][1]).all() and (boxes[b][0] <= boxes[a][1]).all():
            if any(_collide(one, other) for one in solids[a] for other in solids[b]):
                yield a, b


def _solids(body: SceneBody) -> list[tuple[Any, Any]]:
    """Return coal's geometry of each part, and where it is in the world."""
    from nuno.robot.coal_shapes import convex, primitive
    from nuno.robot.link_geometry import few_corners
    from nuno.robot.pinocchio import coal

    found = []
    for shape, place, turn in parts_of(body.shape):
        if isinstance(shape, Plane):
            continue
        position, rotation = compose((body.position, body.quaternion), (place, turn))
        own = primitive(shape)
        if own is None:
            points = np.asarray(shape.mesh()[0], dtype=float)
            try:
                own = convex(few_corners(points, COARSE * float(np.ptp(points, axis=0).max())))
            except RuntimeError:  # all in a plane
                continue
        own.computeLocalAABB()
        found.append((own, coal.Transform3s(quat.to_matrix(rotation), position)))
    return found


def _bounds(solids: list[tuple[Any, Any]]) -> tuple[np.ndarray, np.ndarray]:
    centres = [pose.getRotation() @ own.aabb_center + pose.getTranslation() for own, pose in solids]
    radii = [own.aabb_radius for own, _ in solids]
    low = np.min([centre - radius for centre, radius in zip(centres, radii, strict=True)], axis=0)
    high = np.max([centre + radius for centre, radius in zip(centres, radii, strict=True)], axis=0)
    return low, high


def _collide(one: tuple[Any, Any], other: tuple[Any, Any]) -> bool:
    from nuno.robot.pinocchio import coal

    return bool(coal.collide(one[0], one[1], other[0], other[1], coal.CollisionRequest(), coal.CollisionResult()))
