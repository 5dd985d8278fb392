"""Grips of a batch that come or go in some of its worlds; in the others nothing changes by it, to the bit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import dynamics_of
from nuno.joints.held_points import holding
from nuno.joints.make_grip import make_grip

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.world.simulation import Simulation


def grip_in_worlds(
    world: Simulation, body: Body, where: Any, to: Body, ignored: Sequence[Body] | None, worlds: np.ndarray
) -> Grip:  # fmt: skip
    """Let a body hold another one in some worlds, as ``World.grip`` does in all.

    Args:
        world: The batch; the caller holds its lock.
        body: What is held.
        where: Its points by world, -1 for none, as ``World.grip`` takes them; None for a rigid body.
        to: What holds it.
        ignored: What a rigid body passes through while it is held.
        worlds: (worlds,) bool, where it is held.
    """
    grip = make_grip(body, where, to, 0.0, to, None, world, ignored=ignored)
    if where is None:
        grip.spec = replace(grip.spec, held=worlds.copy())
    world._hold(grip, worlds)
    return grip


def drop_empty_grips(world: Simulation, links: Sequence[Body]) -> None:
    """Drop grips by some bodies that hold nothing in any world: those of other worlds that these were copied with."""
    nowhere = np.zeros(world.world_count, dtype=bool)
    for grip in grips_by_key(world).values():
        if grip.target in links and not holding(grip.spec, world.world_count).any():
            grip.release_in(nowhere)


def grips_by_key(world: Simulation) -> dict[str, Grip]:
    """Return all grips of a world that hold, by key."""
    every = [own for body in world.bodies if (own := dynamics_of(body)) is not None]
    return {grip.key: grip for dynamics in every for grip in dynamics.grips}
