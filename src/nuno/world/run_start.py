"""The start of a run: what a world goes back to when the run fails, or must be gone through once more."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nuno.bodies.dynamics import Dynamics, ParticleDynamics

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation


class RunStart:
    """A world's dynamic state, copied where it is; nobody waits for a device.

    Args:
        world: The world.
        moving: Its dynamic bodies.
    """

    def __init__(self, world: Simulation, moving: dict[Body, Dynamics]) -> None:
        self._world, self._moving = world, moving
        self._particles = [(d, d.keep()) for d in moving.values() if isinstance(d, ParticleDynamics)]
        self._rigid = None if world._rigid is None else world._rigid.save()
        self._other = None if world.engine.is_builtin else world.engine.keep()
        # a rigid body's forces are among what is saved
        rigid: list[Any] = [d for d in moving.values() if d.is_rigid and self._other is None]
        self._pushed = [(d, d._pushing) for d in rigid]
        self._resting = world._resting
        # what a grip leads from is where it led last
        grips: list[Any] = [grip for d in moving.values() for grip in d.grips]
        self._followed = [(grip, grip.spec, grip.followed) for grip in grips]

    def go_back(self) -> None:
        """Set the state that it was."""
        world: Any = self._world
        for dynamics, state in self._particles:
            dynamics.put_back(state)
        if self._rigid is not None and world._rigid is not None:
            world._rigid.load(self._rigid)
        if self._other is not None:
            world.engine.put_back(self._other)
        for dynamics, pushing in self._pushed:
            dynamics._pushing = pushing
        world._resting = self._resting
        for grip, spec, followed in self._followed:
            grip.spec, grip.followed = spec, followed
        for own in self._moving.values():
            own.grips_changed = True
