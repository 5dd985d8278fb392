"""Contact points of a body, with normals and forces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """The contacts of one body with others, and with itself where that was asked for.

    Attributes:
        points: (k, 3) float [m], where, in the world.
        normals: (k, 3) float, towards the body.
        forces: (k, 3) float [N], on the body, friction included.
        others: The name of the other body at each.
        worlds: (k,) int, the world of a batch that each is in.
        impulses: What contacts with each other body gave this one in the last frame, by the other's name, (3,) or
            (worlds, 3) float [N s]: over the frame's time it is the mean force. Not known, and left out, are those of
            a cloth or soft body with static ones where ``World.sum_impulses`` does not ask for them, and those before
            the first frame after a restore.
    """

    points: np.ndarray
    normals: np.ndarray
    forces: np.ndarray
    others: tuple[str, ...]
    worlds: np.ndarray
    impulses: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def joined(cls, found: list[tuple[Any, ...]], impulses: dict[str, np.ndarray]) -> ContactPoints:
        """Return those of rows (point, normal, force, name, world), with the frame's impulses."""
        if not found:
            none = np.zeros((0, 3))
            return cls(none, none, none, (), np.zeros(0, dtype=int), impulses)
        points, normals, forces = (np.array([row[c] for row in found]) for c in range(3))
        others, worlds = tuple(row[3] for row in found), np.array([row[4] for row in found])
        return cls(points, normals, forces, others, worlds, impulses)


def contact_points(world: Simulation, body: Body, itself: bool = False) -> ContactPoints:
    """Return a dynamic body's contacts; see ``World.contacts``."""
    engine = world.engine
    found = list(engine.contacts(body, itself))
    impulses = engine.impulses([body])[0]
    if world.world_count == 1:
        impulses = {name: impulse[0] for name, impulse in impulses.items()}
    return ContactPoints.joined(found, impulses)
