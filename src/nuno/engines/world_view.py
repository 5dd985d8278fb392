"""A world as an engine reads it: its bodies by key, and what moves them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.contact_rules import ContactRules
    from nuno.tables.kinematic_motion import Schedule
    from nuno.world.simulation import Simulation


def bodies_by_key(world: Simulation) -> dict[str, Body]:
    """Return the bodies of a world by their keys, in their order."""
    return {body.key: body for body in world.bodies}


def dynamics_of(body: Body) -> Any:
    """Return the dynamics of a body, None while it is static."""
    return body._dynamics


def attached(world: Simulation) -> list[Any]:
    """Return the dynamics of all dynamic bodies."""
    return [dynamics_of(body) for body in world.bodies if body.is_dynamic]


def rules_of(world: Simulation) -> ContactRules:
    """Return the rules of which pairs touch, and their friction."""
    return world.engine.rules


def schedule_of(world: Simulation) -> Schedule | None:
    """Return where kinematic bodies are in the present step, None where there are none."""
    return world.engine.schedule
