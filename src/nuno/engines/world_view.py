"""A world as an engine reads it: its bodies, what moves them, its rules, and where what follows paths is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.contact_rules import ContactRules
    from nuno.tables.kinematic_motion import Schedule
    from nuno.world.simulation import Simulation


def bodies_by_key(world: Simulation) -> dict[str, Body]:
    """Return the bodies of a world by their keys, in their order; not to be written to."""
    return world._bodies


def dynamics_of(body: Body) -> Any:
    """Return the dynamics of a body, None while it is static."""
    return body._dynamics


def attached(world: Simulation) -> list[Any]:
    """Return the dynamics of all dynamic bodies."""
    return list(world._attached())


def rules_of(world: Simulation) -> ContactRules:
    """Return the rules of which pairs touch, and their friction."""
    return world._rules


def schedule_of(world: Simulation) -> Schedule | None:
    """Return where kinematic bodies are in the present step, None where there are none."""
    return world._schedule


def present_vertices(body: Body) -> np.ndarray:
    """Return (n, 3) or (worlds, n, 3) [m], not to be written to."""
    return body._vertices()


def deformation_of(body: Body) -> Any:
    """Return what a static body was deformed to: the same object for as long as it stays so."""
    return body._deformed
