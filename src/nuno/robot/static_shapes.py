"""StaticShapes: what stands in a world, or follows paths there, as obstacles to a robot's links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.coal_shapes import SolidPart, solid_parts
from nuno.shapes import quaternion as quat
from nuno.shapes.shape import Plane

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.shapes.path import Path
    from nuno.world.world import World


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A static body as coal has it.

    Attributes:
        body: The body.
        parts: Its parts, in its frame.
        middle: (3,) float [m], of the box around it, in its frame.
        half: (3,) float [m], half that box.
        touched: (links,) bool, whether it touches the links at all.
    """

    body: Body
    parts: tuple[SolidPart, ...]
    middle: np.ndarray
    half: np.ndarray
    collides: np.ndarray

    @property
    def is_plane(self) -> bool:
        """Return True if it is endless."""
        return isinstance(self.body.shape, Plane)

    @property
    def path(self) -> Path | None:
        """The path that it follows, None where it stands."""
        return path_of(self.body)

    def poses(self, times: np.ndarray, world: int) -> tuple[np.ndarray, np.ndarray]:
        """Return its places (k, 3) [m] and axes (k, 3, 3) in one world at times (k,) [s]; k is 1 where it stands."""
        path = self.path
        if path is None:
            place, turn = self.body.pose()
        else:
            place, turn = path.at(times), path.quaternion_at(times)
        own_place = place[world] if place.ndim == (2 if path is None else 3) else place
        own_turn = turn[world] if turn.ndim == (2 if path is None else 3) else turn
        return own_place.reshape(-1, 3), quat.to_matrix(own_turn.reshape(-1, 4))


def path_of(body: Body) -> Path | None:
    """Return the path that a static body follows, None where it stands."""
    path: Path | None = body._path
    return path


class StaticShapes:
    """The static bodies that a robot may run into.

    Frozen cloth is none, as it gives way, nor are links of other robots, which go on in every frame.

    Args:
        world: The world.
        links: By shape of the robot, the body in the world that it belongs to.
    """

    def __init__(self, world: World, links: Sequence[Body]) -> None:
        self._world, self._links, self._own = world, tuple(links), set(links)
        self._version: int | None = None
        self._made: dict[Body, tuple[Any, tuple[SolidPart, ...], np.ndarray, np.ndarray]] = {}
        self.obstacles: tuple[Obstacle, ...] = ()
        self._moving: tuple[Obstacle, ...] = ()
        self._number = 0
        self._seen: list[tuple[Any, ...]] = [()]

    def key(self) -> tuple[Any, ...]:
        """Return what is another thing as soon as anything static is elsewhere, or bound elsewhere."""
        version = self._world._collider_version
        if version != self._version:
            self._version = version
            self._renew()
        return (self._number, *[own.path for own in self._moving]) if self._moving else (self._number,)

    def _renew(self) -> None:
        found, made = [], {}
        seen: list[tuple[Any, ...]] = []
        for body in self._world.bodies:
            is_other = body in self._own or getattr(body, "_links", None) is not None
            if is_other or body.is_dynamic or body.shape.is_cloth or not body.group:
                continue
            collides = np.array([self._world._rules.touch(link, body) for link in self._links], dtype=bool)
            if not collides.any():
                continue
            before = self._made.get(body)
            if before is None or before[0] is not body.shape:
                corners = np.zeros((1, 3)) if isinstance(body.shape, Plane) else np.asarray(body.shape.mesh()[0])
                low, high = corners.min(axis=0), corners.max(axis=0)
                before = (body.shape, solid_parts(body.shape), 0.5 * (low + high), 0.5 * (high - low))
            made[body] = before
            # a body that is moved has other arrays from then on, never other numbers in the same
            obstacle = Obstacle(body, *before[1:], collides)
            found.append(obstacle)
            # a body that is moved has other arrays from then on, never other numbers in the same
            seen.append((body, *before[1:], *(() if obstacle.path else body.pose()), collides.tobytes()))
        self._made, self.obstacles = made, tuple(found)
        self._moving = tuple(own for own in found if own.path is not None)
        same = len(seen) == len(self._seen) and all(
            len(a) == len(b) and all(x is y or (isinstance(x, bytes) and x == y) for x, y in zip(a, b, strict=True))
            for a, b in zip(seen, self._seen, strict=True)
        )
        self._number, self._seen = self._number + (not same), seen
