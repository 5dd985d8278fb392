"""Bodies that touch each other, stepped together: their own phases, and between them the contacts that they share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from nuno.coupled.bounded_particles import MOST, Particles
from nuno.coupled.contact_candidates import Elements, bound_triangles, keep_rows, list_rows
from nuno.coupled.contact_geometry import measure_rows
from nuno.coupled.contact_rows import Rows, row_room
from nuno.coupled.coupled_passes import Layout, add_impulses, collect, end_contacts, scatter, solve
from nuno.coupled.drive_constraints import UNDECIDED
from nuno.coupled.joint_closing import close_joints, limp_joints
from nuno.coupled.joint_opening import Trees
from nuno.coupled.joint_response import Joints
from nuno.coupled.kept_multipliers import kept_room, more_kept_room
from nuno.coupled.pass_progress import Passing
from nuno.coupled.rigid_supports import held_slots
from nuno.coupled.shape_bounds import Surroundings, bound_particles
from nuno.coupled.tie_constraints import Holds, Ties
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import Contacts
from nuno.rigid.rigid_body import RigidState
from nuno.solvers.coupling_results import CouplingResults
from nuno.solvers.particle_solver import ParticleSolver
from nuno.solvers.rigid_parts import RigidParts
from nuno.solvers.shape_impulses import plain
from nuno.state.cloth_state import PARTICLE_ARRAYS, PLACES

BLOCK_THREADS = 256
"""Threads of a CUDA block, which handles one world."""
PASSES = 28
"""Passes over the shared contacts in a substep, at most: a push of 5 N on a vertex of 50 mg, held between two fingers,
then leaves 0.1 mm of overlap at 20 substeps a frame."""
PASSES_AT_ONCE = 96
"""The same where all contacts of a world are solved at once: with 24, forces of fingers on a cloth between them are 3 %
off at most, with 96 0.02 %."""
FAST = 1e6
"""[m/s] What is faster than this has diverged."""
QUICKER = 1.5
"""Times its present speed that a body may have within the frame, besides what gravity adds."""


def solves_at_once(device: str) -> bool:
    """Return True if a world's contacts are solved all at once, as by many threads, not one after the other."""
    return device.startswith("cuda")


class Coupling(CouplingResults):
    """The contacts and ties of some bodies.

    Args:
        solvers: Those of cloths and soft bodies, in the order of the elements' bodies.
        rigid: The rigid solver, or None.
        slots: The rigid bodies that take part.
        elements: Surfaces and what touches what.
        ties: Points that stay together.
        holds: Rigid bodies that are held in a frame.
        joints: Rigid bodies that are joined.
        trees: The trees that joints make.

    Attributes:
        kinematic: Slots of rigid bodies that others lead.
        tie_places: (worlds, ties, 2, 3) float64 [m], where ties to places are led in the next frame, from and to; None
            where there are none.
    """

    def __init__(
        self, solvers: Sequence[ParticleSolver], rigid: Any, slots: Sequence[int], elements: Elements, ties: Ties,
        holds: Holds, joints: Joints, trees: Trees,
    ) -> None:  # fmt: skip
        self._solvers, self._rigid, self._slots = list(solvers), rigid, list(slots)
        self._elements, self._ties, self.holds, self.joints, self._trees = elements, ties, holds, joints, trees
        self._scale, self._rate, self._row_count = 0.0, 0.0, 0
        first = rigid if rigid is not None else solvers[0]
        self.device, self.world_count = str(first.device), int(first.world_count)
        self._limp = limp_joints(joints, self.world_count, self.device)
        self._threads = BLOCK_THREADS if self.device.startswith("cuda") else 1
        self._at_once = solves_at_once(self.device)
        self._launches = RecordedLaunches(self.device, BLOCK_THREADS)
        self._parts = RigidParts(self._launches)
        self._state = RigidState() if rigid is None else rigid.state
        self._bodies, self._island = int(elements.bodies), np.zeros((0, 0), dtype=int)
        self._passing = Passing()
        for name, kind in (("wrong", float), ("done", int), ("linked", int)):
            setattr(self._passing, name, wp.zeros(self.world_count * self._bodies, dtype=kind, device=self.device))
        numbers = np.full(max(1, int(self._state.capacity)), -1, dtype=np.int32)
        numbers[self._slots] = np.arange(len(self._solvers), self._bodies)
        self._passing.body_of = wp.array(numbers, dtype=int, device=self.device)
        self._impulses = wp.zeros(3 * self.world_count * self._bodies**2, dtype=wp.int64, device=self.device)
        firsts = np.cumsum([0, *(solver.particle_count for solver in self._solvers)])
        self._firsts, total = [int(first) for first in firsts[:-1]], int(firsts[-1])
        self._layouts: list[Layout] = []
        self._particles = self._room(total)
        held = held_slots(self.world_count, numbers.size, holds, joints)
        self._particles.held = wp.array(held, dtype=int, device=self.device)
        self._start = wp.zeros(max(1, self.world_count * total), dtype=wp.vec3, device=self.device)
        self._cells = np.array([s.cell_size for s in solvers] + [np.inf] * (self._bodies - len(self._solvers)))
        self._radii = elements.radius.numpy().reshape(self.world_count, self._bodies).T.astype(float)
        self._touches_itself = elements.touch.numpy()[:: self._bodies + 1][: self._bodies] != 0
        tied = set(ties.body.numpy()[: ties.count].tolist())
        self._is_tied = np.array([k in tied for k in range(self._bodies)])
        self._rows = row_room(self.world_count, 4 * total + 512, self.device)
        room = 0 if self._at_once or rigid is None else self._rows.room
        self._multipliers = kept_room(self.world_count, total if room else 0, room, self.device)
        self._kept = wp.zeros(self.world_count, dtype=int, device=self.device)
        self._bvh: Any = None
        self.kinematic: list[int] = []
        self.tie_places: np.ndarray | None = None

    def _room(self, total: int) -> Particles:
        worlds, capacity = self.world_count, max(1, int(self._state.capacity))
        made = Particles()
        made.count = total

        def zeros(count: int, dtype: Any) -> wp.array:
            return wp.zeros(max(1, count), dtype=dtype, device=self.device)

        made.p, made.u, made.w = (zeros(worlds * total, kind) for kind in (wp.vec3, wp.vec3, float))
        made.pressed, made.bounded, made.first_row = (zeros(worlds * total, int) for _ in range(3))
        made.bounded_count = zeros(worlds, int)
        made.shape = wp.full(max(1, MOST * worlds * total), -1, dtype=int, device=self.device)
        for name in ("normal", "motion", "drag"):
            setattr(made, f"shape_{name}", zeros(MOST * worlds * total, wp.vec3))
        for name in ("room", "friction", "push"):
            setattr(made, f"shape_{name}", zeros(MOST * worlds * total, float))
        if self._at_once:
            made.sharers, made.joining, made.moved = (
                zeros(worlds * total * k, kind) for k, kind in ((1, int), (1, int), (3, wp.int64))
            )
            made.body_sharers, made.body_joining, made.body_moved = (
                zeros(worlds * capacity * k, kind) for k, kind in ((1, int), (1, int), (6, wp.int64))
            )
        return made

    def _layout(self, k: int) -> Layout:
        solver, made = self._solvers[k], Layout()
        made.particles, made.lanes, made.first = solver.particle_count, solver.lanes, self._firsts[k]
        for name in PARTICLE_ARRAYS:
            if not name.startswith("v"):
                setattr(made, name, plain(getattr(solver.state, name), float))
        made.doubles = int(solver.doubles.count)
        if made.doubles:
            for name in PLACES:
                setattr(made, name.upper(), plain(solver.doubles.array(name), wp.float64))
        made.origin = wp.array(solver.origin.astype(np.float32), dtype=wp.vec3, device=self.device)
        offset = (solver.origin - self._origins[:, k]).astype(np.float32)
        made.offset = wp.array(offset, dtype=wp.vec3, device=self.device)
        return made

    @staticmethod
    def _surroundings(solver: ParticleSolver) -> Surroundings:
        made, state = Surroundings(), solver.state
        made.shapes, made.worlds, made.stride = solver.shapes, solver.world_count, solver._size.shape_list
        made.near, made.scalars = state.shape_list, plain(state.scalars, float)
        return made

    def _set_islands(self, island: np.ndarray) -> None:
        """Take the first body of each one's island, (bodies, worlds) int, in this group's numbers."""
        worlds, column = self.world_count, np.arange(self.world_count)
        if not np.array_equal(island, self._island):
            self._island = island.copy()
            self._elements.island = wp.array(island.T.astype(np.int32).ravel(), dtype=int, device=self.device)
            self._passing.bodies, self._passing.island = self._bodies, self._elements.island
            self._passing.many = int((island != island[0]).any())
            joined = np.zeros(island.shape, dtype=bool)
            for body in self.joints.body.numpy() if self.joints.count else ():
                joined |= island == island[body]
            self._passing.jointed = wp.array(joined.T.astype(np.int32).ravel(), dtype=int, device=self.device)
        # what all places of an island are relative to: the rigid scene's where a rigid body is in it, which has no
        # other
        own = np.stack([solver.origin for solver in self._solvers] or [np.zeros((worlds, 3))])  # (solvers, worlds, 3)
        self._origins = np.zeros((worlds, self._bodies, 3))
        rigid = np.zeros(island.shape, dtype=bool)
        rigid[island[len(self._solvers) :], column] = True
        for k in range(self._bodies):
            origin = own[np.minimum(island[k], len(own) - 1), column]
            if self._rigid is not None:
                origin = np.where(rigid[island[k], column][:, None], self._rigid.origin, origin)
            self._origins[:, k] = origin

    # -- running

    def run_frame(self, time: float, duration: float, counts: tuple[int, int], island: np.ndarray) -> None:
        """Advance all bodies by ``duration`` [s] in so many substeps, of so many a whole frame; see `_set_islands`."""
        substeps, frame = counts
        dt = duration / substeps
        for solver in self._solvers:
            solver.open(time, dt, frame)
        self._set_islands(island)
        # a grip or a new state may have replaced what a layout names
        self._layouts = [self._layout(k) for k in range(len(self._solvers))]
        self._around = [self._surroundings(solver) for solver in self._solvers]
        if self._rigid is not None:
            self._rigid.open(time, dt, [*self._slots, *self.kinematic])
        self._particles.bounded_count.zero_()
        self._impulses.zero_()
        self._multipliers.at.zero_()
        for total in (self._ties.total, self._ties.unmet, self.holds.total, self.holds.total_twist, self.holds.unmet):
            total.zero_()
        self._ties.step = self.holds.step = 1.0 / substeps
        self._place_ties()
        if self.joints.count:
            for name in ("total", "total_twist", "total_axial", "unmet"):
                getattr(self.joints, name).zero_()
            self.joints.state.fill_(UNDECIDED)
        self._rate, self._scale = 1.0 / (dt * dt), 1.0 / (dt * dt) / substeps
        if not (self._solvers or self._at_once):
            joined = partial(self._joined, dt) if self._ties.count or self.holds.count or self.joints.count else None
            closed = partial(self._closed, dt) if self.joints.count else None
            self._parts.run_frame(self._rigid, dt, substeps, joined, partial(self._touching, dt), closed)
            return
        # what diverges is told of after the run
        speeds = np.nan_to_num(self._speeds(), nan=FAST, posinf=FAST)
        reaches = 2.0 * (QUICKER * np.minimum(speeds, FAST) + 10.0 * duration + 0.1) * dt
        self._put(self._elements.reach, reaches)
        apart = self._find_apart(substeps * reaches)
        if apart.all() and len(self._solvers) == self._bodies == 1:
            self._solvers[0]._launch(time, dt, substeps, substeps)
            return
        self._plan_listings(substeps, reaches, apart)
        for k in range(substeps):
            for solver in self._solvers:
                solver.begin_substep(k)
            if self._rigid is not None:
                self._rigid.predict()
            self._touch(k, dt, (k + 1) / substeps)
            if self.joints.count or not (self._at_once or self._rigid is None):
                self._launches.launch_worlds(end_contacts, self.world_count, self._threads, self._touching(dt))
            elif self._rigid is not None:
                self._rigid.contacts()
            for solver in self._solvers:
                solver.end_substep(k)
            if self._rigid is not None:
                self._rigid.finish()
            if self.joints.count:
                self._launches.launch_worlds(close_joints, self.world_count, self._threads, self._closed(dt))

    def _place_ties(self) -> None:
        """Bring the places to which ties are led, relative to what all places of an island are relative to."""
        if self.tie_places is not None:
            owners = self._ties.body.numpy()
            relative = self.tie_places - self._origins[:, owners][:, :, None]
            table = np.ascontiguousarray(relative.reshape(-1, 3), dtype=np.float32)
            self._ties.place.assign(wp.array(table, dtype=wp.vec3, device=self.device))

    def _find_apart(self, reaches: np.ndarray) -> np.ndarray:
        """Return (bodies, worlds) bool, which bodies only touch themselves, with no two parts within ``reaches`` [m].

        No row of theirs can push in this frame. One that is by itself goes through it in one launch, with the same
        bits.
        """
        column = np.arange(self.world_count)
        members = np.zeros_like(self._island)
        np.add.at(members, (self._island, column), 1)
        apart = (members[self._island, column] == 1) & (self._touches_itself & ~self._is_tied)[:, None]
        if not apart.any():
            return apart
        self._collect()
        self._list(np.where(apart, self._contact_distances() + reaches, -1.0), from_start=True)
        counts, most = self._rows.count.numpy(), self._row_count
        if most:
            pairs = self._rows.bodies.reshape((self.world_count, self._rows.room))[:, :most].numpy()
            for world in np.flatnonzero(counts):
                apart[pairs[world, : counts[world], 0], world] = False
        return apart

    def _contact_distances(self) -> np.ndarray:
        """(bodies, worlds) [m], how far apart the surfaces of each one's island are kept at most."""
        return 2.0 * self._of_island(np.maximum, self._radii)

    def _plan_listings(self, substeps: int, reaches: np.ndarray, apart: np.ndarray) -> None:
        """Decide how far the rows of each island look, and after how many substeps they are listed anew.

        Both are the island's own: it must go as it would alone, and rows depend on when and how far was looked.
        """
        cells = self._of_island(np.minimum, np.broadcast_to(self._cells[:, None], reaches.shape))
        margins = np.maximum(np.minimum(0.5 * cells, (1 + substeps / 3) * reaches), 1.5 * reaches)
        self._far = self._contact_distances() + margins
        self._every = np.maximum(1, ((margins - reaches) / reaches).astype(int))
        self._apart = apart

    def _collect(self) -> None:
        for body, layout in enumerate(self._layouts):
            self._go(collect, (self.world_count, layout.particles), layout, self._particles, self._start, body=body)

    def _go(self, kernel: Any, dim: Any, *inputs: Any, body: int = 0) -> None:
        self._launches.launch(kernel, dim, inputs, body)

    def _touch(self, k: int, dt: float, fraction: float) -> None:
        worlds, particles, elements = self.world_count, self._particles, self._elements
        self._collect()
        due = (k % self._every == 0) & ~self._apart
        if k == 0 or due.any():
            self._list(np.where(due, self._far, -1.0), from_start=bool((due | self._apart).all()))
        rows = self._rows
        # ties are solved where nothing touches, too: none of the rows and bounds of before is left
        rows.active_count.zero_()
        particles.bounded_count.zero_()
        if self._row_count:
            self._go(measure_rows, (worlds, self._row_count), particles, self._state, elements, rows, dt)
            for body, (layout, around) in enumerate(zip(self._layouts, self._around, strict=True)):
                if around.shapes.count:
                    self._go(
                        bound_particles, (worlds, layout.particles), layout, particles, elements, around, body, k + 1,
                        dt, body=body,
                    )  # fmt: skip
        if self._row_count or self._ties.count or self.holds.count or self.joints.count:
            self._launches.launch_worlds(solve, worlds, self._threads, self._joined(dt, fraction))
            if self._row_count:
                self._go(add_impulses, (worlds, self._row_count), rows, self._bodies, self._impulses)
            for solver, layout in zip(self._solvers, self._layouts, strict=True):
                if solver.sums is not None:
                    solver.sums.add_bounds(layout, particles)
            for body, layout in enumerate(self._layouts):
                self._go(scatter, (worlds, layout.particles), layout, particles, self._start, body=body)
        else:
            self._passing.linked.zero_()

    def _joined(self, dt: float, fraction: float) -> list[Any]:
        """Return what `solve` takes where so much of the frame is over."""
        return [
            self._particles, self._state, *self._manifolds(), self._rows, self._ties, self.holds, self.joints,
            self._trees, self._passing, self._multipliers, dt, fraction, PASSES_AT_ONCE if self._at_once else PASSES,
            int(self._at_once), self._threads,
        ]  # fmt: skip

    def _touching(self, dt: float) -> list[Any]:
        """Return what `end_contacts` takes."""
        return [self._state, *self._manifolds(), self.joints, self._passing, dt, self._threads]

    def _closed(self, dt: float) -> list[Any]:
        """Return what `close_joints` takes."""
        return [self._state, self.joints, self._limp, self._trees, self._passing, dt, self._threads]

    def _manifolds(self) -> tuple[Parts, Contacts]:
        """The rigid bodies' contacts with each other, which may be in new arrays since the last substep."""
        return (Parts(), Contacts()) if self._rigid is None else (self._rigid.table.parts, self._rigid.manifolds)

    def _list(self, far: np.ndarray, from_start: bool) -> None:
        """Find the candidates of bodies anew up to ``far`` (bodies, worlds) [m], in more room where they do not fit.

        Rows of bodies where it is negative stay, or with ``from_start`` go.
        """
        worlds, elements = self.world_count, self._elements
        self._put(elements.far, far)
        bvh = wp.uint64(0)
        if elements.triangles:
            self._go(bound_triangles, (worlds, elements.triangles), self._particles, elements)
            if self._bvh is None:
                owner = np.repeat(np.arange(worlds, dtype=np.int32), elements.triangles)
                groups: Any = wp.array(owner, dtype=int, device=self.device)
                self._bvh = wp.Bvh(elements.low, elements.high, groups=groups)
            else:
                self._bvh.refit()
            bvh = self._bvh.id
        if from_start:
            self._rows.count.zero_()
        else:
            self._go(keep_rows, worlds, elements, self._rows)
            wp.copy(self._kept, self._rows.count)
        while True:
            self._go(
                list_rows, worlds * self._threads, self._particles, self._state, elements, self._rows, bvh,
                self._threads,
            )  # fmt: skip
            self._row_count = int(self._rows.count.numpy().max())
            if self._row_count <= self._rows.room:
                return
            longer = row_room(self.world_count, self._row_count + self._row_count // 2, self.device)
            before, self._rows = self._rows, longer
            if self._multipliers.room:
                self._multipliers = more_kept_room(self._multipliers, self.world_count, self._rows.room)
            if not from_start:
                self._keep_rows(before)

    def _keep_rows(self, before: Rows) -> None:
        """Take over the rows that stay from an array that was too short."""
        for name in ("kind", "corners", "slot", "part", "bodies", "point"):
            pressed = getattr(before, name).numpy().reshape(self.world_count, before.room, -1)
            table = getattr(self._rows, name)
            longer = np.zeros((self.world_count, self._rows.room, pressed.shape[-1]), dtype=pressed.dtype)
            longer[:, : before.room] = pressed
            table.assign(longer.reshape(table.numpy().shape))
        wp.copy(self._rows.count, self._kept)

    def _put(self, table: wp.array, values: np.ndarray) -> None:
        """Write numbers (bodies, worlds) to a table by world and body."""
        table.assign(values.T.astype(np.float32).ravel())
