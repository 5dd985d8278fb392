"""Rigid dynamics: a body's place among all rigid bodies of its world, which one solver moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno import quaternion as quat
from nuno.coordinates import Pose, apply, compose, invert
from nuno.dynamics import Dynamics, State, check_material
from nuno.mass_properties import mass_properties
from nuno.materials import Rigid
from nuno.scene.rigid_shape import RigidPart, rigid_shape
from nuno.solver.rigid_arrays import ENTRY, POINT, SAVED
from nuno.solver.rigid_solver import RigidSolver

if TYPE_CHECKING:
    from nuno.body import Body
    from nuno.dynamics import Push
    from nuno.simulation import Simulation


class RigidScene:
    """The rigid solver of a world, and the static bodies that it has been told of."""

    def __init__(self, world: Simulation, origin: np.ndarray) -> None:
        self.solver = RigidSolver(
            world.world_count, device=world.device, gravity=world.gravity, frame_rate=world.frame_rate,
            substeps=world.substeps, origin=np.round(np.asarray(origin) * 1024.0) / 1024.0,
        )  # fmt: skip
        self.settings = (world.world_count, world.device, world.gravity, world.frame_rate, world.substeps)
        self._static: dict[str, tuple[int, tuple[Any, ...], tuple[bytes, ...]]] = {}
        self._version = -1

    def bring(self, world: Simulation) -> None:
        """Tell the solver what changed among static bodies, and which pairs are exceptions."""
        if self._version == world._collider_version:
            return
        slots: dict[str, int] = {}
        seen = set()
        for body in world._bodies.values():
            if body._dynamics is not None:
                if isinstance(body._dynamics, RigidDynamics):
                    slots[body.key] = body._dynamics.slot
                    self.solver.set_groups(body._dynamics.slot, body.group, body.collides_with)
                continue
            seen.add(body.key)
            slots[body.key] = self._bring_static(body)
        for key in [key for key in self._static if key not in seen]:
            self.solver.remove(self._static.pop(key)[0])
        rules = world._rules
        exceptions: dict[frozenset[str], Any] = {**rules.friction, **dict.fromkeys(rules.ignored | rules.held)}
        pairs: dict[tuple[int, int], Any] = {}
        for pair, mu in exceptions.items():
            if len(pair) == 2 and all(key in slots for key in pair):
                a, b = pair
                pairs[slots[a], slots[b]] = mu
        self.solver.set_exceptions(pairs)
        self._version = world._collider_version

    def lead(self, world: Simulation, time: float, duration: float) -> list[int]:
        """Let static bodies that follow paths move at a steady pace for a frame or less; return their slots."""
        schedule = world._schedule
        if schedule is None:
            return []
        k = 2 * int(np.argmin(np.abs(schedule.times[::2] - time)))
        slots = []
        for key, (places, turns) in schedule.poses.items():
            if key in self._static and k + 2 < len(schedule.times):
                slot = self._static[key][0]
                start, end = (
                    (places[..., min(at, places.shape[-2] - 1), :], turns[..., min(at, turns.shape[-2] - 1), :])
                    for at in (k, k + 2)
                )
                self.solver.set_pose(slot, *start)
                turn = quat.multiply(end[1], quat.inverse(start[1]))
                turn = np.where(turn[..., :1] < 0.0, -turn, turn)
                sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
                angle = 2.0 * np.arctan2(sine, turn[..., :1])
                axis = np.divide(turn[..., 1:], sine, out=np.zeros_like(turn[..., 1:]), where=sine > 0.0)
                self.solver.set_velocity(slot, (end[0] - start[0]) / duration, axis * angle / duration)
                slots.append(slot)
        return slots

    def save(self) -> dict[tuple[str, str], Any]:
        """Return copies of the arrays of all bodies and contacts, to go back to."""
        solver = self.solver
        owners = {"state": SAVED, "manifolds": (*ENTRY, *POINT, "notes")}
        return {(o, name): wp.clone(getattr(getattr(solver, o), name)) for o, names in owners.items() for name in names}

    def load(self, saved: dict[tuple[str, str], Any]) -> None:
        """Go back to what `save` returned, in the room that there is now."""
        solver = self.solver
        for (owner, name), array in saved.items():
            own = getattr(getattr(solver, owner), name)
            if own.size == array.size:
                wp.copy(own, array)

    def slot_of(self, world: Simulation, body: Body) -> int | None:
        """Return the slot of a rigid or static body, None where the solver was not told of it yet."""
        if isinstance(body._dynamics, RigidDynamics):
            return body._dynamics.slot
        static = self._static.get(body.key)
        return None if static is None else static[0]

    def slots_of(self, world: Simulation) -> list[int]:
        """Return the slot of each of the world's bodies, -1 for those that have none."""
        slots = []
        for key, body in world._bodies.items():
            own, static = body._dynamics, self._static.get(key)
            slots.append(own.slot if isinstance(own, RigidDynamics) else -1 if static is None else static[0])
        return slots

    def _bring_static(self, body: Body) -> int:
        """The slot of a static body, as it is now."""
        pose = body._pose()
        where = (pose[0].tobytes(), pose[1].tobytes())
        what = (
            body.shape, id(body._deformed), np.asarray(body.friction).tobytes(), body.group, body.collides_with,
            body.thickness,
        )  # fmt: skip
        known = self._static.get(body.key)
        if known is not None and known[1] == what:
            if known[2] != where:
                self.solver.set_pose(known[0], *pose)
                self._static[body.key] = (known[0], what, where)
            return known[0]
        if known is not None:
            self.solver.remove(known[0])
        slot = self.solver.add(
            parts_of(body, moves=False), position=pose[0], quaternion=pose[1], friction=body.friction,
            group=body.group, collides_with=body.collides_with,
        )  # fmt: skip
        self._static[body.key] = (slot, what, where)
        return slot


class RigidDynamics(Dynamics):
    """An attached rigid body.

    Args:
        body: The body, still static.
        material: Its material.
        friction: The body's coefficient, a number or (worlds,).
        world: Its world.
        state: What another's `state` gave, or None: at rest where the body is.

    Attributes:
        slot: The body's number in the world's rigid solver.
        mass: (worlds,) [kg].
        centre: (3,) [m], the centre of mass in the body's frame.

    Raises:
        InvalidInputError: no rigid material, or one that does not fit the batch.
        MeshError: the shape has no volume that the density could fill, or cannot move.
    """

    is_rigid = True

    def __init__(
        self, body: Body, material: Rigid, friction: Any, world: Simulation, state: State | None = None
    ) -> None:
        check_material(body.shape, material, world.world_count)
        super().__init__(material, friction, world)
        self.parts = parts_of(body, moves=True)
        values = material.resolved(world.world_count)
        self.mass, self.inertia, self.centre = _mass_of(body, material, values["density"][:, 0])
        place, turn = body._pose()
        self.scene = world._rigid_scene(place)
        self.solver = self.scene.solver
        self.slot = self.solver.add(
            self.parts, position=place + quat.rotate(turn, self.centre), quaternion=turn, mass=self.mass,
            inertia=self.inertia, centre=self.centre, friction=friction, restitution=values["restitution"][:, 0],
            group=body.group, collides_with=body.collides_with,
        )  # fmt: skip
        self.radius = float(self.solver.rules.radius.numpy()[self.slot])  # [m], around the centre of mass
        self._world = world
        self._pushing: tuple[Push, ...] = ()
        if state is not None:
            self.load_state(state)

    @property
    def substeps(self) -> int:  # type: ignore[override]
        """Substeps of a frame, the solver's own."""
        return int(self.solver.substeps)

    def pose(self, body: Body) -> Pose:
        """Return where the body's frame is, (3,) and (4,), in a batch (worlds, 3) and (worlds, 4)."""
        middle, turn = self.solver.pose(self.slot)
        place = middle - quat.rotate(turn, np.broadcast_to(self.centre, middle.shape))
        return (place[0], turn[0]) if self.world_count == 1 else (place, turn)

    def vertices(self, body: Body) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""
        vertices = body._rigid_vertices(self.pose(body))
        return np.broadcast_to(vertices, (self.world_count, *vertices.shape[-2:]))

    def velocities(self, body: Body) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s] of the vertices."""
        velocity, spin = self.solver.velocity(self.slot)
        middle, _ = self.solver.pose(self.slot)
        return velocity[:, None] + np.cross(spin[:, None], self.vertices(body) - middle[:, None])

    def place(self, body: Body, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere; its velocities turn along."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        velocity, spin = self.solver.velocity(self.slot)
        turn = np.broadcast_to(motion[1], (self.world_count, 4))
        self.solver.set_pose(
            self.slot, position + quat.rotate(quaternion, np.broadcast_to(self.centre, position.shape)), quaternion
        )
        self.solver.set_velocity(self.slot, quat.rotate(turn, velocity), quat.rotate(turn, spin))

    def prepare(self, time: float, frame: float) -> None:
        """Bring the pushes that act from ``time`` [s] on."""
        pushing = self.pushing(time)
        if pushing != self._pushing:
            total = np.sum([push.force for push in pushing], axis=0) if pushing else np.zeros((self.world_count, 6))
            self.solver.set_forces(self.slot, total[:, :3], total[:, 3:])
            self._pushing = pushing

    def state(self) -> State:
        """Return copies of all that the next step depends on; contacts name bodies by their place in the world."""
        saved = self.solver.save_state(self.slot)
        slots = self.scene.slots_of(self._world)
        saved["partner_slot"] = _replaced(saved["partner_slot"], {slot: k for k, slot in enumerate(slots)})
        return saved

    def load_state(self, state: State) -> None:
        """Set the state that `state` gave; contacts last where the bodies in them are in the scene already."""
        slots = self.scene.slots_of(self._world)
        partner = _replaced(state["partner_slot"], dict(enumerate(slots)))
        self.solver.load_state(self.slot, {**state, "partner_slot": partner})
        self._pushing = ()

    def finite(self) -> np.ndarray:
        """Return (worlds,) bool, whether pose and velocities are finite."""
        return self.solver.finite(self.slot)

    def release(self) -> None:
        """Give the slot back."""
        self.solver.remove(self.slot)


def parts_of(body: Body, *, moves: bool) -> tuple[RigidPart, ...]:
    """Return the parts of a body in its own frame, in the shape that it has now."""
    from nuno.compound import Compound
    from nuno.shape import Box, Capsule, Cylinder, Plane, Sphere

    plain = isinstance(body.shape, Box | Sphere | Capsule | Cylinder | Plane | Compound)
    vertices = None if plain and body._deformed is None else apply(invert(body._pose()), body._vertices())
    return rigid_shape(body.shape, moves=moves, thickness=body.thickness, vertices=vertices, is_solid=body.is_solid)


def _mass_of(body: Body, material: Rigid, density: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass (worlds,), inertia (worlds, 3, 3) about the centre of mass, and that (3,)."""
    vertices = apply(invert(body._pose()), body._vertices()) if body._deformed is not None else None
    if vertices is not None and vertices.ndim == 3:
        vertices = vertices[0]
    unit = mass_properties(body.shape, thickness=body.thickness, vertices=vertices)
    mass = density * unit.volume
    inertia = density[:, None, None] * unit.inertia
    if material.mass is not None:
        given = np.broadcast_to(np.asarray(material.mass, dtype=float), mass.shape)
        inertia, mass = inertia * (given / mass)[:, None, None], given
    if material.inertia is not None:
        inertia = np.broadcast_to(material.inertia, inertia.shape)
    return mass, inertia, unit.centre


def _replaced(numbers: np.ndarray, by: dict[int, int]) -> np.ndarray:
    """Numbers replaced by a table; -1 where it has none."""
    result = np.full(numbers.shape, -1, dtype=numbers.dtype)
    for number, other in by.items():
        if number >= 0:
            result[numbers == number] = other
    return result
