"""The start of a run: what a world goes back to when the run fails, or must be gone through once more."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.dynamics.dynamics import Dynamics
    from nuno.world.simulation import Simulation


class RunStart:
    """A world's dynamic state, copied where it is; nobody waits for a device.

    Args:
        world: The world.
        moving: Its dynamic bodies.
    """

    def __init__(self, world: Simulation, moving: dict[Body, Dynamics]) -> None:
        self._world, self._moving = world, moving
        self._kept = world.engine.keep()
        self._resting = world._resting
        # what a grip leads from is where it led last
        grips: list[Any] = [grip for d in moving.values() for grip in d.grips]
        self._followed = [(grip, grip.spec, grip.followed) for grip in grips]

    def go_back(self) -> None:
        """Set the state that it was."""
        world: Any = self._world
        world.engine.put_back(self._kept)
        world._resting = self._resting
        for grip, spec, followed in self._followed:
            grip.spec, grip.followed = spec, followed
        for own in self._moving.values():
            own.grips_changed = True
