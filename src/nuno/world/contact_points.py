"""Contact points of a body, with normals and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.dynamics import ParticleDynamics
from nuno.materials import Cloth

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
    if not world.engine.is_builtin:
        return ContactPoints.joined(list(world.engine.contacts(body, itself)), {})
    dynamics: Any = body._dynamics
    found: list[tuple[Any, ...]] = []
    impulses: dict[str, np.ndarray] = {}
    if isinstance(dynamics, ParticleDynamics):
        given = dynamics.shape_impulses()
        there = [(world._bodies[key].name, own) for key, own in given.items() if key in world._bodies]
        impulses = {name: own.copy() for name, own in there if own.any()}
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
    for name, impulse in frame_impulses(world, (body,))[0].items():
        impulses[name] = impulses.get(name, 0.0) + impulse
    if world.world_count == 1:
        impulses = {name: impulse[0] for name, impulse in impulses.items()}
    return ContactPoints.joined(found, impulses)


def frame_impulses(world: Simulation, bodies: Sequence[Body]) -> list[dict[str, np.ndarray]]:
    """Return what contacts gave bodies in the last frame, by the other body's name, (worlds, 3) [N s] each.

    As ``ContactPoints.impulses``, but read once for all, and of cloth and soft bodies with moving ones only. Nothing is
    known of static bodies.
    """
    found: list[dict[str, np.ndarray]] = [{} for _ in bodies]
    rigid: dict[int, Any] = {}
    for k, body in enumerate(bodies):
        if (dynamics := body._dynamics) is not None and dynamics.is_rigid:
            rigid[k] = dynamics
    if rigid and world.engine.is_builtin:
        names, by_slot = _names(world), next(iter(rigid.values())).solver.impulses()
        for k, own in rigid.items():
            given = by_slot.get(own.slot, {})
            found[k] = {names[slot]: impulse for slot, impulse in given.items() if slot in names}
    for coupled in _coupled(world):
        for k, given in coupled.impulses(bodies).items():
            for name, impulse in given.items():
                found[k][name] = found[k].get(name, 0.0) + impulse
    return found


def _names(world: Simulation) -> dict[int, str]:
    """Return the names of bodies by their slots among the rigid ones."""
    rigid = world._rigid
    assert rigid is not None
    return {slot: other.name for other, slot in zip(world._bodies.values(), rigid.slots_of(world), strict=True)}


def _coupled(world: Simulation) -> list[Any]:
    return list(world._stepping.last)


def _on_itself(world: Simulation, body: Body, dynamics: ParticleDynamics) -> list[tuple[Any, ...]]:
    """Return what a cloth's layers would do to its particles in the next substep."""
    from nuno.solvers.self_forces import self_contact_forces

    dynamics.set_self_contact(world._rules.touches_itself(body))
    dynamics.prepare(world.time, 1.0 / world.frame_rate)
    points = dynamics.vertices(body)
    normals, forces = self_contact_forces(dynamics.solver, world.time)
    touching = np.argwhere(np.linalg.norm(normals, axis=-1) > 0.0)
    return [(points[k, i], normals[k, i], forces[k, i], body.name, int(k)) for k, i in touching]


def _on_shapes(world: Simulation, body: Body, dynamics: ParticleDynamics) -> list[tuple[Any, ...]]:
    """Return what static shapes would do to the body's particles in the next substep.

    What other bodies press on a shape is known of the last substep instead, from what the two did together.
    """
    from nuno.solvers.shape_forces import shape_forces

    world._bring_colliders()
    static = [other for other in world._bodies.values() if other._dynamics is None]
    touching, _ = world._rules.colliders_of(body, static)
    found: list[tuple[Any, ...]] = []
    dynamics.prepare(world.time, 1.0 / world.frame_rate)
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
