"""Islands: the bodies that go through a frame together, world by world, and their number of substeps.

Bodies whose boxes, as they may grow within the frame, meet, directly or through others, and bodies that a grip or weld
joins, are an island: they go through the frame in as many substeps as the one among them that needs most. Each world
has its own islands, for it must go as it would alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.joints.held_points import holding

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

GROWTH = 1.5
"""Times its present speed that a body may have within a frame, besides what gravity adds."""
SLACK = 0.02
"""[m] What constraints may throw a particle within a frame."""


@dataclass(frozen=True, eq=False)
class Islands:
    """The islands of some bodies.

    Attributes:
        first: (bodies, worlds) int, the first body of each one's island.
        substeps: (bodies, worlds) int, of a whole frame.
    """

    first: np.ndarray
    substeps: np.ndarray

    def at(self, substeps: int) -> np.ndarray:
        """Return ``first`` in worlds where a body takes so many substeps; where it does not, it is by itself."""
        return np.where(self.substeps == substeps, self.first, np.arange(len(self.first))[:, None])


def find_islands(
    world: Simulation, moving: list[Body], duration: float, substeps: np.ndarray | None = None,
    known: dict[tuple[str, str], bool] | None = None,
) -> Islands:  # fmt: skip
    """Return the islands of dynamic bodies for the next ``duration`` [s], at most a frame.

    Args:
        world: Whose bodies.
        moving: The bodies.
        duration: [s].
        substeps: (bodies, worlds) int, how many of a frame each needs; None takes the bodies' own.
        known: Whether pairs of bodies touch each other at all, by their keys; what is found is added.
    """
    known = {} if known is None else known
    joined = np.zeros((len(moving), len(moving), world.world_count), dtype=bool)
    near = joined
    if len(moving) > 1:
        low, high = _boxes(world, moving, duration)
        below = low[0][:, None] <= high[0]
        for axis in (1, 2):
            below &= low[axis][:, None] <= high[axis]
        near = below & below.swapaxes(0, 1)
    keys = [body.key for body in moving]
    for a, b in np.argwhere(np.triu(near.any(axis=-1), 1)).tolist():
        touch = known.get((keys[a], keys[b]))
        if touch is None:
            touch = known[keys[a], keys[b]] = world._rules.touch(moving[a], moving[b])
        if touch:
            joined[a, b] = near[a, b]
    place = {body: k for k, body in enumerate(moving)}
    for body in moving:
        for grip in body._dynamics.grips:  # type: ignore[union-attr]
            if grip.is_tie and grip.target in place:
                a, b = sorted((place[body], place[grip.target]))
                joined[a, b] |= holding(grip.spec, world.world_count)
    first = _connected(joined)
    if substeps is None:
        substeps = np.array([body._dynamics.substeps for body in moving])[:, None]  # type: ignore[union-attr]
    most, column = np.zeros_like(first), np.arange(world.world_count)
    np.maximum.at(most, (first, column), np.broadcast_to(substeps, first.shape))
    return Islands(first, most[first, column])


def _connected(joined: np.ndarray) -> np.ndarray:
    """Return (n, worlds), the first of all that each of n is joined to, through others too; joined (n, n, worlds)."""
    n, worlds = joined.shape[1:]
    if worlds > 1 and (joined == joined[..., :1]).all():
        return np.repeat(_connected(joined[..., :1]), worlds, axis=1)
    a, b, column = np.nonzero(joined)
    first = np.repeat(np.arange(n)[:, None], worlds, axis=1)
    while True:
        least = np.minimum(first[a, column], first[b, column])
        found = first.copy()
        for end in (a, b):
            np.minimum.at(found, (end, column), least)
            np.minimum.at(found, (first[end, column], column), least)
        found = np.take_along_axis(found, found, axis=0)
        if np.array_equal(found, first):
            return first
        first = found


def _boxes(world: Simulation, moving: list[Body], duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the boxes that bodies may reach within ``duration`` [s]: lower and upper corners (3, bodies, worlds)."""
    every: list[Any] = [body._dynamics for body in moving]
    fall = 0.5 * float(np.linalg.norm(world.gravity)) * duration**2
    low, high = np.empty((2, 3, len(moving), world.world_count))
    rigid = [k for k, own in enumerate(every) if own.is_rigid]
    if rigid:
        middles, _, velocities, spins = every[rigid[0]].solver.motions([every[k].slot for k in rigid])
        radii = np.array([every[k].radius for k in rigid])
        speeds = np.linalg.norm(velocities, axis=-1) + np.linalg.norm(spins, axis=-1) * radii
        grow = (radii + GROWTH * speeds * duration + fall + SLACK)[..., None]
        low[:, rigid], high[:, rigid] = (middles - grow).T, (middles + grow).T
    for k, dynamics in enumerate(every):
        if not dynamics.is_rigid:
            lowest, highest = dynamics.solver.bounds()
            speed, _ = dynamics.solver.speeds()
            thickness = np.asarray(getattr(dynamics.material, "thickness", 0.0), dtype=float)
            grow = (GROWTH * speed * duration + fall + SLACK + thickness)[:, None]
            low[:, k], high[:, k] = (lowest - grow).T, (highest + grow).T
    return low, high
