"""FoldMotion: the ways of held points that fold a cloth, how they may be changed, and how square the fold becomes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import BodyStateError
from nuno.shapes.path import Path
from nuno.tasks.cloth_frame import ClothFrame
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.world import World

MOVED = 0.02
"""[m] A cloth of which a vertex is farther than this from where the motion begins is not as it was planned for."""
SETTLE = 1.0
"""[s] In which a cloth comes to rest that was let go."""


class LearntFold(Protocol):
    """A taught fold as its motion takes it; `TaughtFold` says what each member is."""

    @property
    def held(self) -> np.ndarray:
        """(hands, 2) float, the points (u, v) that were taken."""

    @property
    def goals(self) -> np.ndarray:
        """(hands, 2) float, where they were let go."""

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3) float, places (u, v, h) of the vertices in the end."""

    @property
    def faces(self) -> np.ndarray:
        """(m, 3) int."""

    @property
    def fractions(self) -> np.ndarray:
        """(n, 2) float, the points (u, v) that they are."""


@dataclass(frozen=True, eq=False)
class FoldMotion:
    """The motion by which points of a cloth are to be carried.

    Attributes:
        frame: The cloth as it lies before.
        start: (n, 3) float [m], its vertices.
        faces: (m, 3) int.
        held: (hands,) int, the vertices that are carried.
        times: (k,) float [s], from 0.
        ways: (hands, k, 3) float [m], where they go, on straight lines.
        releases: (hands,) float [s], when they are let go.
        taught: What the motion comes from.
    """

    frame: ClothFrame
    start: np.ndarray = field(repr=False)
    faces: np.ndarray = field(repr=False)
    held: np.ndarray
    times: np.ndarray = field(repr=False)
    ways: np.ndarray = field(repr=False)
    releases: np.ndarray
    taught: LearntFold = field(repr=False)

    @property
    def hand_count(self) -> int:
        """Return how many hands it takes."""
        return len(self.held)

    @cached_property
    def goals(self) -> np.ndarray:
        """(hands,) int, the corners' vertices on which those that are carried are to come to lie.

        Raises:
            InvalidInputError: the fold does not carry corners onto corners.
        """
        points = self.frame.to_world(np.insert(self.taught.goals, 2, 0.0, axis=1))
        return np.linalg.norm(self.start - points[:, None], axis=-1).argmin(axis=1)

    def corner_offsets(self, vertices: np.ndarray) -> np.ndarray:
        """Return where the carried corners lie, seen from above, from those that they are to cover.

        Args:
            vertices: (..., n, 3) [m], of the cloth.

        Returns:
            (..., hands, 2) float [m], along u and v.
        """
        away = vertices[..., self.held, :2] - vertices[..., self.goals, :2]
        return away @ self._units.T

    def corner_errors(self, vertices: np.ndarray) -> np.ndarray:
        """Return the lengths of ``corner_offsets``, (..., hands) float [m]."""
        return np.linalg.norm(self.corner_offsets(vertices), axis=-1)

    @property
    def _units(self) -> np.ndarray:
        """(2, 2) float, the horizontal directions of u and v."""
        return (self.frame.axes / self.frame.size[:, None])[:, :2]

    def ways_with(self, shifts: ArrayLike, heights: ArrayLike) -> np.ndarray:
        """Return changed ways, each for one world of a batch.

        Args:
            shifts: (worlds, hands, 2) [m], by how much farther along u and v the ways end; on the way there it grows as
                they go on.
            heights: (worlds,) by what their height is multiplied.

        Returns:
            (worlds, hands, k, 3) float [m].
        """
        along = finite_array("shifts", shifts, ("worlds", self.hand_count, 2))
        factors = finite_array("heights", heights, (len(along),))
        return bent(self.ways, height=factors[:, None, None], shift=along @ self._units)

    def changed(self, shifts: ArrayLike, height: float = 1.0) -> FoldMotion:
        """Return the motion with other ways; see ``ways_with``: shifts (hands, 2) [m], and one height."""
        return replace(self, ways=self.ways_with(np.asarray(shifts, dtype=float)[None], [height])[0])

    def check_place(self, cloth: Body) -> None:
        """Raise unless a cloth lies where the motion begins.

        Raises:
            BodyStateError: it is static, or lies elsewhere.
        """
        if cloth._world is None or not cloth.is_dynamic:
            raise BodyStateError(f"{cloth.name!r} must be attached in a world to be folded; it is static")
        vertices = np.asarray(cloth.vertices)
        if vertices.shape != self.start.shape:
            raise BodyStateError(f"the motion is for a cloth of {len(self.start)} vertices, not for {cloth.name!r}")
        away = float(np.linalg.norm(vertices - self.start, axis=1).max())
        if away > MOVED:
            raise BodyStateError(f"{cloth.name!r} has moved by {away:.3f} m since the motion was made; make it anew")

    def imagine(self, cloth: Body, *, settle: float = SETTLE) -> np.ndarray:
        """Return how the cloth would come to lie, (n, 3) [m], were points of it carried by nothing but themselves.

        Args:
            cloth: The cloth, dynamic, where it lies before.
            settle: How long it is given to come to rest [s].

        Raises:
            BodyStateError: the cloth is static, or lies elsewhere.
            SimulationDiverged: a state stopped being finite.
        """
        self.check_place(cloth)
        world = world_without_robots(cloth)
        return self.carry(world, world.find(cloth.name), self.ways[None], settle=settle)[0]

    def carry(self, world: World, cloth: Body, ways: np.ndarray, *, settle: float = SETTLE) -> np.ndarray:
        """Carry the cloth of a world, or of each world of a batch.

        Args:
            world: The world or batch.
            cloth: The cloth in it.
            ways: (worlds, hands, k, 3) [m].
            settle: How long it is given to come to rest [s].

        Returns:
            (worlds, n, 3) float [m], how it comes to lie.
        """
        begin, batch = world.time, world.world_count > 1
        times = self.times + begin
        grips = [
            world.grip(cloth, [int(vertex)], to=Path(times, ways[:, hand] if batch else ways[0, hand]))
            for hand, vertex in enumerate(self.held)
        ]
        for hand in np.argsort(self.releases):
            world.run(max(begin + float(self.releases[hand]) - world.time, 0.0), progress=False)
            grips[hand].release()
        world.run(settle, progress=False)
        vertices = np.asarray(cloth.vertices)
        return vertices if batch else vertices[None]


def bent(ways: np.ndarray, *, height: Any = 1.0, shift: Any = (0.0, 0.0)) -> np.ndarray:
    """Return ways of another height that end elsewhere.

    Args:
        ways: (..., k, 3).
        height: A factor (...) for how far they rise above the straight line from their beginning to their end.
        shift: (..., 2), what is added at the end; before, in the share of the way that is behind.
    """
    steps = np.linalg.norm(np.diff(ways[..., :2], axis=-2), axis=-1)
    length = np.concatenate([np.zeros_like(steps[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)
    share = length / np.maximum(length[..., -1:], 1e-12)
    rise = ways[..., 2] - ways[..., :1, 2]
    line = rise[..., -1:] * share
    flat = ways[..., :2] + share[..., None] * np.asarray(shift)[..., None, :]
    above = ways[..., :1, 2] + line + np.asarray(height) * (rise - line)
    return np.concatenate([flat, np.broadcast_to(above, flat.shape[:-1])[..., None]], axis=-1)


def world_without_robots(cloth: Body) -> World:
    """Return a copy of the world that a cloth is in, to be imagined further, in which points are carried by nothing."""
    world: Any = cloth._world
    copy: World = world.imagine(1)
    copy.drivers.clear()
    for body in world.bodies:
        if body._links is not None:
            copy.remove(body.name)
    return copy
