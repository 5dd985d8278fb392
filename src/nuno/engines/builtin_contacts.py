"""Contacts of Nuno's own engine: where a body touches others, and what contacts gave bodies in the last frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.dynamics.dynamics import ParticleDynamics
from nuno.engines.world_view import bodies_by_key, dynamics_of, rules_of
from nuno.materials import Cloth

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.builtin_world import BuiltinWorld


def contact_rows(world: BuiltinWorld, body: Body, itself: bool) -> list[tuple[Any, ...]]:
    """Return a dynamic body's contacts as `Engine.contacts` tells them."""
    dynamics: Any = dynamics_of(body)
    found: list[tuple[Any, ...]] = []
    if isinstance(dynamics, ParticleDynamics):
        found += _on_shapes(world, body, dynamics)
        if itself and isinstance(dynamics.material, Cloth):
            found += _on_itself(world, body, dynamics)
    else:
        names = _names(world)
        for k in range(world.world_count):
            for slot, points, normals, forces in dynamics.solver.contacts_of(dynamics.slot, k):
                found += [(*row, names.get(slot, ""), k) for row in zip(points, normals, forces, strict=True)]
    for coupled in _coupled(world):
        found += coupled.contacts(body, itself)
    return found


def contact_impulses(world: BuiltinWorld, bodies: Sequence[Body]) -> list[dict[str, np.ndarray]]:
    """Return what contacts gave bodies in the last frame as `Engine.impulses` tells it, read once for all."""
    found: list[dict[str, np.ndarray]] = [{} for _ in bodies]
    rigid: dict[int, Any] = {}
    known = bodies_by_key(world)
    for k, body in enumerate(bodies):
        dynamics = dynamics_of(body)
        if isinstance(dynamics, ParticleDynamics):
            given = dynamics.shape_impulses()
            there = [(known[key].name, own) for key, own in given.items() if key in known]
            found[k] = {name: own.copy() for name, own in there if own.any()}
        elif dynamics is not None and dynamics.is_rigid:
            rigid[k] = dynamics
    if rigid:
        names, by_slot = _names(world), next(iter(rigid.values())).solver.impulses()
        for k, own in rigid.items():
            given = by_slot.get(own.slot, {})
            found[k] = {names[slot]: impulse for slot, impulse in given.items() if slot in names}
    for coupled in _coupled(world):
        for k, given in coupled.impulses(bodies).items():
            for name, impulse in given.items():
                found[k][name] = found[k].get(name, 0.0) + impulse
    return found


def _names(world: BuiltinWorld) -> dict[int, str]:
    """Return the names of bodies by their slots among the rigid ones."""
    rigid = world._rigid
    assert rigid is not None
    return {slot: other.name for other, slot in zip(world.bodies, rigid.slots_of(world), strict=True)}


def _coupled(world: BuiltinWorld) -> list[Any]:
    return list(world._stepping.last)


def _prepare(world: BuiltinWorld, dynamics: ParticleDynamics) -> None:
    """Bring what acts on a body where it has changed, and leave the ways on which grips are led as they are."""
    if not dynamics.grips_changed and dynamics.pushing(world.time) == dynamics.acting:
        return
    ways = [(grip, grip.spec) for grip in dynamics.grips]
    dynamics.prepare(world.time, 1.0 / world.frame_rate)
    for grip, spec in ways:
        grip.spec = spec


def _on_itself(world: BuiltinWorld, body: Body, dynamics: ParticleDynamics) -> list[tuple[Any, ...]]:
    """Return what a cloth's contacts with itself would do to its particles in the next substep."""
    from nuno.solvers.self_forces import self_contact_forces

    dynamics.set_self_contact(rules_of(world).touches_itself(body))
    _prepare(world, dynamics)
    points = dynamics.vertices(body)
    normals, forces = self_contact_forces(dynamics.solver, world.time)
    touching = np.argwhere(np.linalg.norm(normals, axis=-1) > 0.0)
    return [(points[k, i], normals[k, i], forces[k, i], body.name, int(k)) for k, i in touching]


def _on_shapes(world: BuiltinWorld, body: Body, dynamics: ParticleDynamics) -> list[tuple[Any, ...]]:
    """Return what static shapes would do to the body's particles in the next substep.

    What other bodies press on a shape is known of the last substep instead, from what the two did together.
    """
    from nuno.solvers.shape_forces import shape_forces

    world._bring_colliders()
    static = [other for other in world.bodies if dynamics_of(other) is None]
    touching, _ = rules_of(world).colliders_of(body, static)
    found: list[tuple[Any, ...]] = []
    _prepare(world, dynamics)
    points = dynamics.vertices(body)
    pressed = np.zeros(points.shape[:2], dtype=bool)
    for coupled in _coupled(world):
        if body in coupled.particles:
            known, contacts = coupled.shape_contacts(body)
            pressed |= known
            found += [(points[k, i], n, force, touching[shape].name, k) for k, i, shape, n, force in contacts]
    for shape, normals, forces in shape_forces(dynamics.solver, world.time):
        for k, i in zip(*np.nonzero((np.linalg.norm(normals, axis=-1) > 0.0) & ~pressed), strict=True):
            found.append((points[k, i], normals[k, i], forces[k, i], touching[shape].name, k))
    return found
