"""Links of two robots that stand inside each other, which is told once, when the second robot comes."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.coal_shapes import solid_parts
from nuno.robot.pinocchio import coal
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links

logger = logging.getLogger(__name__)


def overlapping_links(links: Links, other: Links) -> list[tuple[Body, Body]]:
    """Return the pairs of bodies of two robots in one world that stand inside each other and may touch."""
    boxes = {body: _box(body) for body in (*links.bodies, *other.bodies)}
    solids: dict[Body, list[tuple[Any, Any]]] = {}
    found = []
    for a in links.bodies:
        for b in other.bodies:
            if not (a.group & b.collides_with and b.group & a.collides_with) or _are_apart(boxes[a], boxes[b]):
                continue
            for body in (a, b):
                if body not in solids:
                    solids[body] = _solids(body)
            if any(_overlap(one, its) for one in solids[a] for its in solids[b]):
                found.append((a, b))
    return found


def warn_of_overlaps(links: Links, others: Iterable[Links]) -> None:
    """Warn where links stand inside those of other robots, once for each robot."""
    for other in others:
        if pairs := overlapping_links(links, other):
            count = f"{len(pairs)} pair{'s' if len(pairs) > 1 else ''}"
            first = " in ".join(repr(body.name) for body in pairs[0])
            logger.warning(
                "links of %r stand inside those of %r, which is in the world already, %s, the first is %s: robots "
                "without dynamics go through each other, and one with dynamics is thrown out. Let one stand elsewhere "
                "before it is simulated (robot.translate((1, 0, 0))), or now by set_up((1, 0, 0))",
                links.robot.name, other.robot.name, count, first,
            )  # fmt: skip


def _box(body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the box around a body along the world's axes, (3,) and (3,) [m]."""
    vertices = body.vertices
    return vertices.min(axis=0), vertices.max(axis=0)


def _are_apart(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> bool:
    return bool((one[0] > other[1]).any() or (other[0] > one[1]).any())


def _solids(body: Body) -> list[tuple[Any, Any]]:
    """Return coal's geometry of each part of a body, and where it is in the world."""
    place, turn = body.pose()
    axes = quat.to_matrix(turn)
    return [
        (part.geometry, coal.Transform3s(axes @ part.rotation, place + axes @ part.position))
        for part in solid_parts(body.shape)
    ]


def _overlap(one: tuple[Any, Any], other: tuple[Any, Any]) -> bool:
    return bool(coal.collide(one[0], one[1], other[0], other[1], coal.CollisionRequest(), coal.CollisionResult()))
