"""Rigid dynamics: a body's place among all rigid bodies of its world, which one solver moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.bodies.body_motion import BodyMotion, motion_of_rigid
from nuno.bodies.body_protocols import WorldSettings
from nuno.bodies.given_velocity import GivenVelocity
from nuno.dynamics.body_parts import mass_of, parts_of
from nuno.dynamics.dynamics import Dynamics, State, check_material, rigid_vertices
from nuno.dynamics.static_place import StaticPlace, same_deformation, what_of
from nuno.materials import Rigid
from nuno.rigid.rigid_arrays import PARTS, SAVED
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, compose, invert
from nuno.solvers.rigid_solver import NO_EXCEPTION, UNTOUCHED, RigidSolver

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.bodies.body_protocols import MovedBody
    from nuno.bodies.contact_rules import ContactRules
    from nuno.dynamics.push import Push
    from nuno.tables.kinematic_motion import Schedule


class RigidWorld(WorldSettings, Protocol):
    """A world as its rigid bodies see it; the members are those of `nuno.world.simulation.Simulation`."""

    @property
    def _bodies(self) -> Mapping[str, Body]:
        """All bodies, by key."""

    @property
    def _rules(self) -> ContactRules:
        """The rules of which pairs touch, and their friction."""

    @property
    def _schedule(self) -> Schedule | None:
        """The schedule of kinematic bodies in the present run."""

    @property
    def _collider_version(self) -> int:
        """A number that is another after each change of what bodies touch."""

    def _rigid_scene(self, origin: np.ndarray) -> RigidScene:
        """Return what moves the rigid bodies."""


class RigidScene:
    """The rigid solver of a world, and the static bodies that it has been told of.

    Attributes:
        solver: The solver.
        settings: What of the world it was made for.
        static: The static bodies, by key.
        kept: By key, the slot and rows that are kept for bodies that are still to come.

    Args:
        world: The world.
        origin: (3,) or (worlds, 3) [m], about where the bodies are.
        parts: Parts that there is room for at first.
    """

    def __init__(self, world: RigidWorld, origin: np.ndarray, parts: int = PARTS) -> None:
        self.solver = RigidSolver(
            world.world_count, device=world.device, gravity=world.gravity, frame_rate=world.frame_rate,
            substeps=world.substeps, origin=np.round(np.asarray(origin) * 1024.0) / 1024.0, parts=parts,
        )  # fmt: skip
        self.settings = self.settings_of(world)
        self.static: dict[str, StaticPlace] = {}
        self.kept: dict[str, tuple[int, tuple[int, ...]]] = {}
        self._moving: list[str] = []  # static bodies that had velocities in the last frame
        self._saved: dict[tuple[str, str], Any] = {}
        self._version, self._slots = -1, dict[str, int]()

    @staticmethod
    def settings_of(world: RigidWorld) -> tuple[Any, ...]:
        """Return what of a world a scene is made for."""
        return world.world_count, world.device, world.gravity, world.frame_rate, world.substeps

    def is_current(self, world: RigidWorld) -> bool:
        """Return True if the solver has been told of all that has changed."""
        return self._version == world._collider_version

    def bring(self, world: RigidWorld) -> None:
        """Tell the solver what changed among static bodies, and which pairs are exceptions."""
        if self.is_current(world):
            return
        self._slots = slots = dict[str, int]()
        seen = set()
        for body in world._bodies.values():
            if body.is_dynamic:
                if (own := _dynamics_of(body)) is not None:
                    slots[body.key] = own.slot
                    self.solver.set_groups(own.slot, body.group, body.collides_with)
                continue
            seen.add(body.key)
            slots[body.key] = self.bring_static(body)
        for key in [key for key in self.static if key not in seen]:
            self.solver.remove(self.static.pop(key).slot)
        self._set_exceptions(world, slots)
        self.solver.set_order(list(slots.values()))
        self._version = world._collider_version

    def held_changed(self, world: RigidWorld, worlds: np.ndarray) -> None:
        """Tell the solver which pairs touch now that other bodies are held in some worlds (worlds,) bool."""
        if self.is_current(world):  # else it will be told of all
            before = self.solver.save_listing()
            self._set_exceptions(world, self._slots)
            after, rows = self.solver.save_listing(), worlds[:, None, None]  # anew in those worlds alone
            self.solver.load_listing({name: np.where(rows, own, before[name]) for name, own in after.items()})

    def _set_exceptions(self, world: RigidWorld, slots: Mapping[str, int]) -> None:
        rules = world._rules
        exceptions: dict[frozenset[str], Any] = {**rules.friction, **dict.fromkeys(rules.ignored)}
        for pair, worlds in rules.held.items():  # where it is not held, as if it were no exception
            own = exceptions.get(pair, NO_EXCEPTION)
            exceptions[pair] = None if own is None else np.where(worlds, UNTOUCHED, own)
        pairs: dict[tuple[int, int], Any] = {}
        for pair, mu in exceptions.items():
            if len(pair) == 2 and all(key in slots for key in pair):
                a, b = pair
                pairs[slots[a], slots[b]] = mu
        self.solver.set_exceptions(pairs)

    def lead(self, world: RigidWorld, time: float, duration: float) -> list[int]:
        """Let static bodies that follow paths move at a steady pace for a frame or less; return their slots."""
        schedule, keys = world._schedule, []
        k = None if schedule is None else schedule.frame_at(time)
        if schedule is not None and k is not None:
            keys = [key for key in schedule.poses if key in self.static]
        for key in set(self._moving).difference(keys):
            if key in self.static and key in world._bodies:  # follows a path no longer, and stands where it arrived
                self.solver.set_velocity(self.static[key].slot, np.zeros(3), np.zeros(3))
                self.bring_static(world._bodies[key])
        self._moving, slots = keys, []
        if schedule is not None and k is not None:
            for key in keys:
                slot, (start, end) = self.static[key].slot, schedule.in_frame(key, k)
                self.static[key].where = None
                self.solver.set_pose(slot, *start)
                turn = quat.multiply(end[1], quat.inverse(start[1]))
                turn = np.where(turn[..., :1] < 0.0, -turn, turn)
                sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
                angle = 2.0 * np.arctan2(sine, turn[..., :1])
                axis = np.divide(turn[..., 1:], sine, out=np.zeros_like(turn[..., 1:]), where=sine > 0.0)
                # what stands is led by nothing: of its turn, rounding alone would be left
                still = [(a == b).all(axis=-1, keepdims=True) for a, b in zip(start, end, strict=True)]
                spin = np.where(still[0] & still[1], 0.0, axis * angle / duration)
                self.solver.set_velocity(slot, (end[0] - start[0]) / duration, spin)
                slots.append(slot)
        return slots

    def save(self) -> dict[tuple[str, str], Any]:
        """Return copies of the arrays of all bodies and contacts, to go back to until the next call reuses them."""
        self._saved = self.solver.copies(self._saved)
        return self._saved

    def load(self, saved: dict[tuple[str, str], Any]) -> None:
        """Go back to what `save` returned, in the room that there is now."""
        longer = self.solver.take_copies(saved)
        self._moving = list(self.static)  # whatever places and velocities they have now
        for place in self.static.values():
            place.where = None
        if longer:
            self.solver._list_anew()

    @property
    def origin(self) -> np.ndarray:
        """(worlds, 3) [m], what the solver's positions are relative to."""
        origin: np.ndarray = self.solver.origin
        return origin

    def slot_of(self, body: Body) -> int | None:
        """Return the slot of a rigid or static body, None where the solver was not told of it yet."""
        own = _dynamics_of(body)
        if own is not None:
            return own.slot
        static = self.static.get(body.key)
        return None if static is None else static.slot

    def motions(self, bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return places, turns, velocities and spins of rigid bodies' frames, (worlds, n, 3 or 4) each."""
        own = [made for body in bodies if (made := _dynamics_of(body)) is not None]
        middles, turns, velocities, spins = self.solver.motions([made.slot for made in own])
        centres = np.array([made.centre for made in own]).reshape(-1, 3)
        arms = -quat.rotate(turns, np.broadcast_to(centres, middles.shape))
        return middles + arms, turns, velocities + np.cross(spins, arms), spins

    def slots_of(self, world: RigidWorld) -> list[int]:
        """Return the slot of each of the world's bodies, -1 for those that have none."""
        slots = []
        for key, body in world._bodies.items():
            own, static = _dynamics_of(body), self.static.get(key)
            slots.append(own.slot if own is not None else -1 if static is None else static.slot)
        return slots

    def bring_static(self, body: Body) -> int:
        """Tell the solver of a static body as it is now; return its slot."""
        pose = body.pose()
        where = (pose[0].tobytes(), pose[1].tobytes())
        known = self.static.get(body.key)
        if known is not None and known.is_of(body, body._deformed):
            if known.where != where:
                self.solver.set_pose(known.slot, *pose)
                known.where = where
            return known.slot
        if known is not None:
            self.solver.remove(known.slot)
        slot, rows = self.kept.pop(body.key, (None, None))
        slot = self.solver.add(
            parts_of(body, moves=False), position=pose[0], quaternion=pose[1], friction=body.friction,
            group=body.group, collides_with=body.collides_with, slot=slot, rows=rows,
        )  # fmt: skip
        self.static[body.key] = StaticPlace(slot, what_of(body), body._deformed, where)
        return slot

    def keep_stale(self, key: str, slot: int, rows: tuple[int, ...]) -> None:
        """Take the place of a static body that has gone or changed, until the solver is told so."""
        self.solver.reserve(slot, rows)
        self.static[key] = StaticPlace(slot, None, None, None)


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
        BodyStateError: it is deformed otherwise in each world.
    """

    is_rigid = True

    def __init__(
        self, body: Body, material: Rigid, friction: Any, world: RigidWorld, state: State | None = None
    ) -> None:
        check_material(body.shape, material, world.world_count)
        super().__init__(material, friction, world)
        self.parts = parts_of(body, moves=True)
        self.deformed, self.thickness = body._deformed, body.thickness
        values = material.resolved(world.world_count)
        self.mass, self.inertia, self.centre = mass_of(body, material, values["density"][:, 0])
        place, turn = body.pose()
        self.scene = world._rigid_scene(place)
        self.solver = self.scene.solver
        slot, rows = self.scene.kept.pop(body.key, (None, None))
        self.slot = self.solver.add(
            self.parts, position=place + quat.rotate(turn, self.centre), quaternion=turn, mass=self.mass,
            inertia=self.inertia, centre=self.centre, friction=friction, restitution=values["restitution"][:, 0],
            air_drag=values["air_drag"][:, 0], group=body.group, collides_with=body.collides_with, slot=slot, rows=rows,
        )  # fmt: skip
        self.radius = float(self.solver.rules.radius.numpy()[self.slot])  # [m], around the centre of mass
        self._world = world
        self._pushing: tuple[Push, ...] | None = ()  # whose forces the solver has; None: those of a loaded state
        if state is not None:
            self.load_state(state)

    @property
    def substeps(self) -> int:  # type: ignore[override]
        """Substeps of a frame, the solver's own."""
        return int(self.solver.substeps)

    def pose(self, body: MovedBody) -> Pose:
        """Return where the body's frame is, (3,) and (4,), in a batch (worlds, 3) and (worlds, 4)."""
        middle, turn = self.solver.pose(self.slot)
        place = middle - quat.rotate(turn, np.broadcast_to(self.centre, middle.shape))
        return (place[0], turn[0]) if self.world_count == 1 else (place, turn)

    def vertices(self, body: MovedBody, some: np.ndarray | None = None) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m]."""
        return rigid_vertices(body, self.pose(body), self.world_count, some)

    def velocities(self, body: MovedBody) -> np.ndarray:
        """Return (worlds, n, 3) float64 [m/s] of the vertices."""
        velocity, spin = self.solver.velocity(self.slot)
        middle, _ = self.solver.pose(self.slot)
        return velocity[:, None] + np.cross(spin[:, None], self.vertices(body) - middle[:, None])

    def place(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray) -> None:
        """Put the body elsewhere; its velocities turn along."""
        motion = compose((position, quaternion), invert(self.pose(body)))
        velocity, spin = self.solver.velocity(self.slot)
        turn = np.broadcast_to(motion[1], (self.world_count, 4))
        self.solver.set_pose(
            self.slot, position + quat.rotate(quaternion, np.broadcast_to(self.centre, position.shape)), quaternion
        )
        self.solver.set_velocity(self.slot, quat.rotate(turn, velocity), quat.rotate(turn, spin))

    def motion(self, body: MovedBody) -> BodyMotion:
        """Return how the body moves."""
        place, turn = self.solver.pose(self.slot)
        return motion_of_rigid(self.mass, place, self.inertia, turn, *self.solver.velocity(self.slot))

    def set_velocity(self, body: MovedBody, given: GivenVelocity, worlds: np.ndarray | None = None) -> None:
        """Give the body a velocity and an angular velocity, in all worlds or some (k,)."""
        place, _ = self.solver.pose(self.slot)
        linear, angular = given.at(place[:, None], place)[:, 0], given.angular
        if worlds is not None:
            own = self.solver.velocity(self.slot)
            for now, new in zip(own, (linear, angular), strict=True):
                now[worlds] = new[worlds]
            linear, angular = own
        self.solver.set_velocity(self.slot, linear, angular)

    def place_worlds(self, body: MovedBody, position: np.ndarray, quaternion: np.ndarray, worlds: np.ndarray) -> None:
        """Put the body elsewhere in some worlds (k,); its velocities turn along there."""
        before = {name: self.solver._read(name, self.slot).copy() for name in SAVED[:4]}
        self.place(body, position, quaternion)
        for name, kept in before.items():
            kept[worlds] = self.solver._read(name, self.slot)[worlds]
            self.solver._write(name, self.slot, kept)

    def elastic_energy(self, body: MovedBody) -> np.ndarray:
        """Return (worlds,) [J]: none, for it does not deform."""
        return np.zeros(self.world_count)

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
        self._pushing = None

    def load_worlds(self, worlds: np.ndarray, state: State) -> None:
        """Set some worlds (k,) to the state (k, ...) that `state` gave of them; the others go on as they are."""
        whole = self.state()
        for name, values in state.items():
            own, given = whole[name], np.asarray(values)
            if given.shape[1:] != own.shape[1:]:  # rows of contacts have become longer since
                own, given = _padded_alike(own, given, name)
            own[worlds] = given
            whole[name] = own
        self.load_state(whole)

    def has_shape(self, deformed: tuple[np.ndarray, Pose] | None, thickness: float) -> bool:
        """Return True if it moves a body in this shape, deformed or not, of this thickness [m]."""
        return self.thickness == thickness and same_deformation(self.deformed, deformed)

    def finite(self) -> np.ndarray:
        """Return (worlds,) bool, whether pose and velocities are finite."""
        return self.solver.finite(self.slot)

    def release(self) -> None:
        """Give the slot back."""
        self.solver.remove(self.slot)


def _padded_alike(a: np.ndarray, b: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return contacts (worlds, parts, row, ...) of two states with rows of one length."""
    fill = -1 if name in ("partner_slot", "partner_part") else 0
    row = max(a.shape[2], b.shape[2])
    pads = [[(0, 0), (0, 0), (0, row - v.shape[2]), *[(0, 0)] * (v.ndim - 3)] for v in (a, b)]
    return np.pad(a, pads[0], constant_values=fill), np.pad(b, pads[1], constant_values=fill)


def _dynamics_of(body: Body) -> RigidDynamics | None:
    own = body._dynamics
    return own if isinstance(own, RigidDynamics) else None


def _replaced(numbers: np.ndarray, by: dict[int, int]) -> np.ndarray:
    """Numbers replaced by a table; -1 where it has none."""
    result = np.full(numbers.shape, -1, dtype=numbers.dtype)
    for number, other in by.items():
        if number >= 0:
            result[numbers == number] = other
    return result
