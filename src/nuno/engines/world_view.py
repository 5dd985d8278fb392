"""A world as an engine reads it: its bodies by key, and what moves them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from nuno.bodies.body_protocols import WorldSettings

if TYPE_CHECKING:
    import numpy as np

    from nuno.bodies.body import Body
    from nuno.bodies.contact_rules import ContactRules
    from nuno.tables.kinematic_motion import Schedule


class RunningEngine(Protocol):
    """An engine as what it is made of sees it; `nuno.engines.engine.Engine` says what each member is."""

    rules: ContactRules
    schedule: Schedule | None

    def velocity_at(self, body: Body | None, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity [m/s] of a body's point, and its spin [rad/s], (worlds, 3) each."""

    def changed(self) -> None:
        """Be told that bodies, grips or rules are others now."""


class EngineWorld(WorldSettings, Protocol):
    """A world as its engine sees it; the members are those of `nuno.world.simulation.Simulation`."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, in the order in which they were added."""

    @property
    def engine(self) -> RunningEngine:
        """The engine."""


def bodies_by_key(world: EngineWorld) -> dict[str, Body]:
    """Return the bodies of a world by their keys, in their order."""
    return {body.key: body for body in world.bodies}


def dynamics_of(body: Body) -> Any:
    """Return the dynamics of a body, None while it is static."""
    return body._dynamics


def attached(world: EngineWorld) -> list[Any]:
    """Return the dynamics of all dynamic bodies."""
    return [dynamics_of(body) for body in world.bodies if body.is_dynamic]


def rules_of(world: EngineWorld) -> ContactRules:
    """Return the rules of which pairs touch, and their friction."""
    return world.engine.rules


def schedule_of(world: EngineWorld) -> Schedule | None:
    """Return where kinematic bodies are in the present step, None where there are none."""
    return world.engine.schedule
