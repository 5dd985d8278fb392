"""All rigid bodies of a world, or of a batch of worlds: their arrays on the device, and how they advance."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.numbers.block_group import COUNT, RESIDENCY, counts_of
from nuno.numbers.warps import WARP
from nuno.plans.group_plan import cores_of
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.rigid.convex_parts import RigidPart
from nuno.rigid.persistent_manifolds import COUNTS, LEFT, OVERFLOW
from nuno.rigid.rigid_arrays import PARTS, SAVED
from nuno.rigid.rigid_substep import RigidSettings, run_rigid, run_rigid_group
from nuno.rigid.saved_contacts import load_contacts, load_listing, save_contacts, save_listing
from nuno.solvers.particle_solver import substeps_of
from nuno.solvers.rigid_contacts import RigidContacts

log = logging.getLogger(__name__)

SUBSTEPS = 10
"""Substeps a frame: at 60 frames a second what rests moves under 1 um, and a sphere's roll is exact to 0.1 %."""
PASSES = 4
"""Passes over the velocities: with 2, a stack of ten boxes that stand askew sways by millimetres and goes on swaying;
with 4 it comes to rest."""
BLOCK_THREADS = 256
"""Threads of a CUDA block, which runs one world."""
GROUP_PARTS = 160
"""Parts from which on a block group takes less time than one (an H200; 105 take more, 205 less)."""

UNTOUCHED, NO_EXCEPTION = -1.0, -2.0
"""In place of a pair's friction: that they do not touch, or that the pair is no exception in this world."""

DYNAMIC, MOVED = 1, 2
PHASES = {"all": 0, "predict": 1, "contacts": 2, "finish": 3}


class RigidSolver(RigidContacts):
    """Rigid bodies that fall, touch, stick, slide, roll and bounce.

    A body has a slot. Static and kinematic bodies have one too, with no mass: they are what others meet. Arrays grow by
    doubling; a body that comes or goes costs its own rows.

    Args:
        world_count: Worlds in the batch.
        device: "cpu" or "cuda:0" ...
        gravity: (3,) [m/s2].
        frame_rate: Frames a second.
        substeps: Substeps a frame; None takes `SUBSTEPS`.
        origin: (3,) or (worlds, 3) [m], float64: what positions on the device are relative to, for a float's digits are
            scarce: at 1 m from it a coordinate's step is 0.1 um, at 10 m 1 um.
        parts: Parts that there is room for at first: each takes 12 kB in every world.

    Limitations: contact has no compliance; a mesh that moves counts as its convex hull; a hull's face with more than 12
    corners touches with 12 of them; friction is that of points, so that nothing brakes a spin on one point or a roll.
    """

    def __init__(
        self, world_count: int = 1, *, device: str = "cpu", gravity: Sequence[float] = (0.0, 0.0, -9.81),
        frame_rate: float = 60.0, substeps: int | None = None, origin: ArrayLike = (0.0, 0.0, 0.0), parts: int = PARTS,
    ) -> None:  # fmt: skip
        super().__init__(int(world_count), str(device), parts)
        self.frame_rate = float(frame_rate)
        self.gravity = np.asarray(gravity, dtype=float)
        self.substeps = int(substeps) if substeps else SUBSTEPS
        self.passes = PASSES
        self.origin = np.array(np.broadcast_to(np.asarray(origin, dtype=float), (self.world_count, 3)))
        self._cuda = self.device.startswith("cuda")
        self._launches = RecordedLaunches(self.device, BLOCK_THREADS)
        self._crowded = False  # whether the device once had no room for block groups
        self.settings = RigidSettings()
        self._mass: dict[int, np.ndarray] = {}
        self._ranked: list[int] = []  # rows of the table of parts in the order that `set_order` gave
        self._loaded: dict[int, Mapping[str, np.ndarray]] = {}
        self.set_exceptions({})
        self._dt, self._opened = 0.0, False

    # Bodies

    def add(
        self,
        parts: Sequence[RigidPart],
        *,
        position: ArrayLike,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        mass: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
        centre: ArrayLike = (0.0, 0.0, 0.0),
        friction: ArrayLike = 0.5,
        restitution: ArrayLike = 0.0,
        air_drag: ArrayLike = 0.0,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
        group: int = 1,
        collides_with: int = -1,
        slot: int | None = None,
        rows: Sequence[int] | None = None,
    ) -> int:
        """Add a body and return its slot.

        Args:
            parts: What `nuno.rigid.convex_parts.rigid_shape` returns.
            position: (3,) or (worlds, 3) [m], of the centre of mass; of a body without mass, of its shape.
            quaternion: (4,) or (worlds, 4), (w, x, y, z), of the shape's frame.
            mass: One or (worlds,) [kg]; None is a body that contacts do not move.
            inertia: (3, 3) or (worlds, 3, 3) [kg m2], about the centre of mass, in the shape's axes.
            centre: (3,) [m], the centre of mass in the shape's frame.
            friction: Coulomb's coefficient, one or (worlds,).
            restitution: One or (worlds,); of a pair the larger counts.
            air_drag: Rate at which the air takes velocity and spin [1/s], one or (worlds,).
            velocity: (3,) or (worlds, 3) [m/s], of the centre of mass.
            angular_velocity: (3,) or (worlds, 3) [rad/s], world frame.
            group: Bits that others' ``collides_with`` is held against.
            collides_with: Bits of the groups that it touches.
            slot: A free slot to take; None takes the first.
            rows: Free rows of the table of parts to take, one for each part; None takes the first.
        """
        if slot is None:
            slot = next((k for k in range(self.state.capacity) if k not in self.part_rows), self.state.capacity)
        middle = np.asarray(centre, dtype=float)
        self._take(slot, self.table.add(slot, parts, middle, rows))
        self._roles[slot] = DYNAMIC
        self._put_slot("group", slot, _bits(group))
        self._put_slot("collides_with", slot, _bits(collides_with))
        self._put_slot("radius", slot, max(_reach(part, middle) for part in parts))
        self.set_mass(slot, mass, inertia)
        for name in ("force", "torque"):
            self._write(name, slot, np.zeros(3))
        self.set_pose(slot, position, quaternion)
        self.set_velocity(slot, velocity, angular_velocity)
        self.set_surface(slot, friction, restitution)
        self._write("drag", slot, air_drag)
        return slot

    def set_order(self, slots: Sequence[int]) -> None:
        """Let bodies that are as high, or as large, come in this order.

        Without it they come in the order of their rows, which depends on what came and went before.
        """
        rows = [row for slot in slots for row in self.part_rows[slot]]
        if rows != self._ranked:
            self.table.set_ranks(rows)
            self._ranked = rows
            self._list_anew()

    def reserve(self, slot: int, rows: Sequence[int]) -> None:
        """Take a free slot and free rows of the table of parts for no body at all, until the slot is removed."""
        self._take(slot, self.table.take_rows(rows))

    def _take(self, slot: int, rows: list[int]) -> None:
        while slot >= self.state.capacity:
            self._grow_bodies(2 * self.state.capacity)
        self.part_rows[slot] = rows
        self._ranked = []
        if self.table.parts.capacity > self.manifolds.parts:
            self._grow_rows(self.table.parts.capacity, self.manifolds.row)
        self._forget_rows(rows)

    def remove(self, slot: int) -> None:
        """Take a body away; its slot may be given to another."""
        self._forget_impulses(slot)
        rows = self.part_rows.pop(slot)
        self.table.remove(rows)
        self._forget_rows(rows)
        self._mass.pop(slot, None)
        self._loaded.pop(slot, None)
        self._roles[slot] = 0
        self._write("inverse_mass", slot, 0.0)
        self._put_slot("radius", slot, -1.0)
        self._list_anew()

    def set_mass(self, slot: int, mass: ArrayLike | None, inertia: ArrayLike | None = None) -> None:
        """Set mass and inertia, see `add`; None makes it a body that contacts do not move."""
        if mass is None:
            self._write("inverse_mass", slot, 0.0)
            self._write("inertia", slot, np.eye(3))
            self._write("inverse_inertia", slot, np.zeros((3, 3)))
            self._mass[slot] = np.full(self.world_count, np.inf)
        else:
            masses = np.broadcast_to(np.asarray(mass, dtype=float), (self.world_count,))
            tensor = np.broadcast_to(np.asarray(inertia, dtype=float), (self.world_count, 3, 3))
            self._write("inverse_mass", slot, 1.0 / masses)
            self._write("inertia", slot, tensor)
            self._write("inverse_inertia", slot, np.linalg.inv(tensor))
            self._mass[slot] = masses.copy()
        self._list_anew()

    def set_surface(self, slot: int, friction: ArrayLike, restitution: ArrayLike) -> None:
        """Set friction and restitution, one or (worlds,) each."""
        for name, value in (("friction", friction), ("bounce", restitution)):
            self._write_to(getattr(self.rules, name), slot, value)
        self._list_anew()

    def set_groups(self, slot: int, group: int, collides_with: int) -> None:
        """Set the masks of `add`."""
        self._put_slot("group", slot, _bits(group))
        self._put_slot("collides_with", slot, _bits(collides_with))
        self._list_anew()

    def set_exceptions(self, pairs: Mapping[tuple[int, int], Any]) -> None:
        """Set what holds for pairs of slots: friction, one or (worlds,), in some `NO_EXCEPTION`; None: no contact."""
        keyed = sorted(((min(a, b) << 32) | max(a, b), mu) for (a, b), mu in pairs.items())
        self.rules.exceptions = len(keyed)
        self.rules.pair = wp.array(np.array([key for key, _ in keyed] or [0], np.int64), device=self.device)
        values = [np.broadcast_to(UNTOUCHED if mu is None else mu, (self.world_count,)) for _, mu in keyed]
        table = np.stack(values, axis=1) if keyed else np.zeros((self.world_count, 1))
        self.rules.pair_friction = wp.array(table.astype(np.float32).ravel(), dtype=float, device=self.device)
        self._list_anew()

    # State

    def set_pose(self, slot: int, position: ArrayLike, quaternion: ArrayLike) -> None:
        """Put a body where it shall be; what it touched is found anew."""
        turn = np.asarray(quaternion, dtype=float)
        turn = turn / np.linalg.norm(turn, axis=-1, keepdims=True)
        self._write("position", slot, np.asarray(position, dtype=float) - self.origin)
        self._write("rotation", slot, np.roll(turn, -1, axis=-1))

    def set_velocity(self, slot: int, velocity: ArrayLike, angular_velocity: ArrayLike) -> None:
        """Set velocities, see `velocity`. A body without mass moves at them in every run that it is a member of."""
        self._write("velocity", slot, velocity)
        self._write("spin", slot, angular_velocity)
        if slot in self._mass and np.isinf(self._mass[slot]).all():
            moving = np.any(np.asarray(velocity)) or np.any(np.asarray(angular_velocity))
            self._roles[slot] = MOVED if moving else 0

    def set_forces(self, slot: int, force: ArrayLike, torque: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Set the force [N] at the centre of mass and the torque [N m] that act from now on, (3,) or (worlds, 3)."""
        self._write("force", slot, force)
        self._write("torque", slot, torque)

    def set_vertices(self, slot: int, vertices: ArrayLike) -> None:
        """Move the vertices of a static mesh, (n, 3) or (worlds, n, 3) [m] as at `add`."""
        self.table.set_vertices(self.part_rows[slot][0], np.asarray(vertices, dtype=float))
        self._forget_rows(self.part_rows[slot])

    def finite(self, slot: int) -> np.ndarray:
        """(worlds,) bool: whether a body has a finite state."""
        return np.all([np.isfinite(self._read(name, slot)).all(axis=-1) for name in SAVED[:4]], axis=0)

    # Time

    def run(
        self, time: float, duration: float, members: Sequence[int] | None = None, substeps: int | None = None
    ) -> None:
        """Advance by ``duration`` [s]: whole frames and a shorter last one.

        Args:
            time: The time [s] at which it starts; nothing depends on it.
            duration: How long [s].
            members: The slots to advance; all others stand where they are, and are untouched.
            substeps: A frame; None takes the solver's.
        """
        each = int(substeps or self.substeps)
        frame = 1.0 / self.frame_rate
        frames = math.floor(duration / frame + 1e-6)
        rest = duration - frames * frame
        self._choose(members)
        if frames:
            self._launch("all", frame / each, frames * each, each)
        if rest > 1e-6 * frame:
            count = substeps_of(rest, frame, each)  # as many as where bodies go together
            self._launch("all", rest / count, count, count)

    def open(self, time: float, dt: float, members: Sequence[int] | None = None) -> None:
        """Begin substeps of ``dt`` [s] whose phases are called one by one: predict, contacts, finish."""
        self._load_contacts()
        self._choose(members)
        self._dt, self._opened = float(dt), True

    def predict(self) -> None:
        """Look for contacts, and move the members as their forces and those of the last substep say."""
        self._launch("predict", self._dt, 1, int(self._opened))
        self._opened = False

    def contacts(self) -> None:
        """One pass over the positions of what touches."""
        self._launch("contacts", self._dt, 1)

    def finish(self) -> None:
        """Velocities, with friction and bounces."""
        self._launch("finish", self._dt, 1)

    def _choose(self, members: Sequence[int] | None) -> None:
        roles = self._roles if members is None else np.zeros_like(self._roles)
        if members is not None:
            roles[list(members)] = self._roles[list(members)]
        self.state.active.assign(roles)

    def _launch(self, phase: str, dt: float, substeps: int, frame: int = 0) -> None:
        self._load_contacts()
        self.write_settings(self.settings, dt, frame)
        threads = BLOCK_THREADS if self._cuda else 1
        counts = self.counts()
        counts[:, LEFT] = substeps
        while True:
            counts[:, OVERFLOW] = 0
            if self._cuda:  # else they are a view
                self.manifolds.counts.assign(counts.ravel())
            inputs = [self.state, self.table.parts, self.manifolds, self.rules, self.settings, PHASES[phase]]
            if not self._launch_block_groups(inputs):
                self._launches.launch_worlds(run_rigid, self.world_count, threads, [*inputs, threads])
            if not self.counts()[:, OVERFLOW].any():
                return
            self.make_room()
            counts = self.counts()

    def write_settings(self, run: RigidSettings, dt: float, frame: int) -> None:
        """Write the settings of a run of substeps of ``dt`` [s]; ``frame`` are left of it as its last frame begins."""
        run.frame = frame
        run.dt, run.gravity, run.passes = dt, wp.vec3(*self.gravity), self.passes
        run.down = float(np.linalg.norm(self.gravity))

    def counts(self) -> np.ndarray:
        """(worlds, COUNTS) int; on the CPU they are the solver's own."""
        counts: np.ndarray = self.manifolds.counts.numpy().reshape(-1, COUNTS)
        return counts

    def _blocks_of_group(self) -> int:
        """Blocks of a block group that takes a world, one to 32 parts; 1 where a block by itself is quicker."""
        parts, cores = int(self.table.parts.count), cores_of(self.device)
        blocks = min(-(-parts // WARP), cores // self.world_count)
        return blocks if self._cuda and parts > GROUP_PARTS and blocks > 1 and not self._crowded else 1

    def _launch_block_groups(self, inputs: list[Any]) -> bool:
        """Launch a block group for each world; return whether one did the work, else nothing has changed."""
        blocks = self._blocks_of_group()
        if blocks == 1:
            return False
        barrier_counts = wp.zeros(counts_of(self.world_count), dtype=int, device=self.device)
        inputs = [*inputs, barrier_counts, self.world_count, blocks, BLOCK_THREADS]
        dim = self.world_count * blocks * BLOCK_THREADS
        wp.launch(run_rigid_group, dim=dim, inputs=inputs, device=self.device, block_dim=BLOCK_THREADS)
        if int(barrier_counts.numpy()[COUNT * RESIDENCY]) == 1:
            return True
        self._crowded = True
        log.warning("a CUDA device is too busy for groups of %d blocks: a world a block goes on", blocks)
        return False

    # Saving

    def save_state(self, slot: int) -> dict[str, np.ndarray]:
        """Return all that a body's next step depends on, (worlds, ...) each: motion, forces, and its contacts."""
        self._load_contacts()
        return {name: self._read(name, slot).copy() for name in SAVED} | save_contacts(self, slot)

    def load_state(self, slot: int, state: Mapping[str, np.ndarray]) -> None:
        """Take back what `save_state` gave, also of one world for all.

        Contacts are taken back before the next step, with those bodies that have the slots that they had; bodies may
        so be added and loaded one after the other.
        """
        for name in SAVED:
            self._write(name, slot, state[name])
        self._loaded[slot] = state
        self.manifolds.impulse.zero_()  # of another past
        self._list_anew()

    def save_listing(self) -> dict[str, np.ndarray]:
        """Return when pairs are to be listed anew, (worlds, ...) each: `nuno.rigid.saved_contacts.save_listing`."""
        self._load_contacts()
        return save_listing(self)

    def load_listing(self, listing: Mapping[str, np.ndarray]) -> None:
        """Take back what `save_listing` gave, once all bodies are there and loaded."""
        self._load_contacts()
        load_listing(self, listing)

    def _load_contacts(self) -> None:
        """Write the contacts of loaded states, now that the bodies that they are with may have come too."""
        loaded, self._loaded = self._loaded, {}
        for slot, state in loaded.items():
            load_contacts(self, slot, state)


def _bits(mask: int) -> int:
    """A mask as the kernels hold it, 32 bits."""
    return int(np.array(mask & 0xFFFFFFFF, dtype=np.uint32).astype(np.int32))


def _reach(part: RigidPart, centre: np.ndarray) -> float:
    """Radius [m] around the centre of mass that holds a part."""
    place = (np.zeros(3) if part.position is None else part.position) - centre
    return float(np.linalg.norm(place) + np.linalg.norm(np.maximum(np.abs(part.low), np.abs(part.high))))
