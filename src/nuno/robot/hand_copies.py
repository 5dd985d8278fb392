"""HandCopies: a hand of a robot's copies in a batch of imagined worlds, in each world by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.joints.grip import Grip
from nuno.materials import Rigid
from nuno.robot.hands import Hand, carried_by
from nuno.shapes.coordinates import Coordinates, compose
from nuno.shapes.surface import SurfacePoints
from nuno.world.grips_of_worlds import grip_in_worlds

if TYPE_CHECKING:
    from nuno.world.world import World

VERTEX = 1e-6
"""By how much a weight may differ from 1 where a surface point is held as the vertex that it is."""


class HandCopy(Hand):
    """A hand in one world of a batch: what it takes and lets go waits there until ``HandCopies.settle``.

    Args:
        hand: The hand itself.
        copies: The hand in all worlds.
        index: Which world.
    """

    def __init__(self, hand: Hand, copies: HandCopies, index: int) -> None:
        self.__dict__.update(hand.__dict__)  # which are of its robot, and the same in all worlds
        self.body, self._grips, self.pressed = copies.body, [], frozenset()
        self._copies, self._k = copies, index

    def open(self) -> None:
        """Let go of everything in this world."""
        self._copies.released += [(grip, self._k) for grip in self.grips]
        self._grips = []

    @property
    def _world(self) -> World:
        return self._copies.world

    def _joint_angles(self) -> np.ndarray:
        return self._copies.angles_in(self._k)

    def _others(self) -> list[Body]:
        return self._copies.others()

    def _frame(self) -> Coordinates:
        place, turn = self.body.pose()
        own = place[self._k] if place.ndim == 2 else place, turn[self._k] if turn.ndim == 2 else turn
        return Coordinates(*compose(own, self._offset))

    def _vertices(self, body: Body) -> np.ndarray:
        found = self._copies.vertices(body)
        return found[self._k] if found.ndim == 3 else found

    def _material(self, body: Body) -> Any:
        worlds = self._world.world_count
        material: Any = body.material
        return material if worlds == 1 else material.of_world(self._k, worlds)

    def _take(self, body: Body, where: Any) -> None:
        self._copies.taken.setdefault(body, {})[self._k] = where


class HandCopies:
    """A hand in every world of a batch: ``world.imagine(n).robot.hands[name]``.

    It closes, grips or presses, and lets go in each world by itself, with the bits of the hand alone.

    Args:
        hand: The hand itself.
        world: The batch.
        links: The copies of all links of the robot, in their order.
        angles_in: (world) -> where the robot's joints are there, (n,) [rad; m for slides].

    Attributes:
        name: The hand's.
        world: The batch.
        body: The copy of the link that carries it.
        angles_in: As above.
        copies: The hand in each world.
        released: Grips that are to go, and in which world.
        taken: Bodies that are to be held, and of each world where.
    """

    def __init__(
        self, hand: Hand, world: World, links: Sequence[Body], angles_in: Callable[[int], np.ndarray]
    ) -> None:  # fmt: skip
        own = {link: copy for link, copy in zip(hand.links.bodies, links, strict=True)}
        self.name, self.world, self.body, self.angles_in = hand.name, world, own[hand.body], angles_in
        self._links, self._shapes = set(links), [own[link] for link in carried_by(hand.links, hand.body)]
        self.released: list[tuple[Grip, int]] = []
        self.taken: dict[Body, dict[int, Any]] = {}
        self._seen: dict[Body, np.ndarray] = {}
        self.copies = tuple(HandCopy(hand, self, k) for k in range(world.world_count))

    def __repr__(self) -> str:
        return f"<{self.name} in {self.world.world_count} worlds, holds something in {int(self.holds.sum())}>"

    @property
    def holds(self) -> np.ndarray:
        """(worlds,) bool, where it holds anything."""
        with self.world.lock:
            return np.array([bool(copy.held) for copy in self.copies])

    @property
    def held(self) -> dict[str, np.ndarray]:
        """By the names of bodies that it holds in some world, (worlds,) bool, in which."""
        with self.world.lock:
            rows = [{body.name for body in copy.held} for copy in self.copies]
            names = [body.name for body in self.world.bodies if any(body.name in row for row in rows)]
            return {name: np.array([name in row for row in rows]) for name in names}

    def others(self) -> list[Body]:
        """Return the bodies that it may take, or close on."""
        return [body for body in self.world.bodies if body.is_dynamic and body not in self._links]

    def vertices(self, body: Body) -> np.ndarray:
        """Return where a body's vertices are now, read once until ``settle``, (n, 3) or (worlds, n, 3) [m]."""
        found = self._seen.get(body)
        if found is None:
            found = self._seen[body] = body.vertices
        return found

    def settle(self) -> np.ndarray:
        """Let go and take hold as was noted; return where rigid bodies are held otherwise now, (worlds,) bool."""
        count = self.world.world_count
        released: dict[Grip, np.ndarray] = {}
        for grip, k in self.released:
            released.setdefault(grip, np.zeros(count, dtype=bool))[k] = True
        rigid = np.zeros(count, dtype=bool)
        for grip, worlds in released.items():
            grip.release_in(worlds)
            rigid |= worlds & isinstance(grip.body.material, Rigid)
        for body in [body for body in self.world.bodies if body in self.taken]:
            is_rigid = isinstance(body.material, Rigid)
            for where, worlds in _together(self.taken[body], count):
                ignored = self._shapes if is_rigid else None
                grip = grip_in_worlds(self.world, body, where, self.body, ignored, worlds)
                rigid |= worlds & is_rigid
                for k in np.flatnonzero(worlds).tolist():
                    self.copies[k].take_grips([*self.copies[k].grips, grip])
        self.released, self.taken, self._seen = [], {}, {}
        return rigid


def _together(taken: dict[int, Any], count: int) -> list[tuple[Any, np.ndarray]]:
    """Return points of one body, by world, as few grips take them: each ``where``, and its worlds (count,) bool.

    Vertices are held in another way than points of faces, and so are points that happen to be vertices.
    """
    groups: dict[Any, dict[int, Any]] = {}
    for k, where in taken.items():
        kind: Any = "vertices"
        if where is None:
            kind = "whole"
        elif isinstance(where, SurfacePoints):
            kind = tuple(bool(abs(weight - 1.0) < VERTEX) for weight in where.barycentric[:, 0])
        groups.setdefault(kind, {})[k] = where
    found: list[tuple[Any, np.ndarray]] = []
    for kind, own in groups.items():
        worlds = np.zeros(count, dtype=bool)
        worlds[list(own)] = True
        if kind == "whole":
            found.append((None, worlds))
        elif kind == "vertices":
            vertices = np.full((count, max(map(len, own.values()))), -1)
            for k, where in own.items():
                vertices[k, : len(where)] = where
            found.append((vertices, worlds))
        else:
            faces, weights = np.full((count, len(kind)), -1), np.zeros((count, len(kind), 3))
            weights[:] = np.where(np.array(kind)[:, None], (1.0, 0.0, 0.0), (0.5, 0.5, 0.0))
            for k, where in own.items():
                faces[k], weights[k] = where.faces, where.barycentric
            found.append((SurfacePoints(faces, weights), worlds))
    return found
