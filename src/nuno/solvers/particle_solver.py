"""Particles in one or many worlds: their state on the device, what acts on them, and how time passes.

What they are the corners of, and so the elastic constraints between them, is for the classes under `ParticleSolver`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.numbers.lanes import LANES, lane, lane_int
from nuno.solvers.array_memory import HOST_COPIES, array_bytes
from nuno.solvers.grip_rows import grip_rows
from nuno.state.cloth_state import (
    ALL_PARTS,
    COMPLIANT_GRIPS,
    FASTEST,
    LOADS,
    MOTION,
    NOTES,
    ORIGIN,
    PARTICLE_ARRAYS,
    SELF_CONTACT,
    SHAPES,
    SPEED,
    TRAVEL,
    VELOCITIES,
    Settings,
    Shapes,
)
from nuno.state.double_positions import DoublePositions

if TYPE_CHECKING:
    from nuno.joints.grip import GripSpec
    from nuno.solvers.shape_impulses import ShapeImpulses
    from nuno.tables.colliders import Colliders

KEPT = ("x", "y", "z", "vx", "vy", "vz", "notes")
"""Arrays that a run changes and that the next one depends on."""
Kept = tuple[np.ndarray, list[wp.array], list[wp.array]]
"""The worlds' origins, the arrays above, and coordinates that are doubles."""


class ParticleSolver:
    """The particles of one body, and the frame around its elastic constraints.

    A class under it makes the arrays in its constructor, between `_prepare` and `_start`, and launches kernels in
    `_advance`.

    Attributes:
        device: "cpu" or "cuda:0" ...
        world_count: Worlds in the batch.
        particle_count: Particles of each world.
        frame_rate: Frames a second.
        gravity: (3,) [m/s2].
        substeps: Substeps a frame.
        self_contact: Whether the body collides with itself.
        plan: How kernels are launched.
        lanes: Worlds in a vector, 16 in a batch on the CPU and else 1.
        mass: (worlds, n) [kg].
        missed: (worlds,) bool, where contacts of the body with itself were ever passed over for want of memory.
        sums: What shapes give the body over a frame, where that is asked for: see `sum_impulses`.
    """

    substeps: int
    self_contact: bool
    plan: str
    mass: np.ndarray
    _state: Any
    _size: Any
    _topology: Any
    _surface: Any
    _scalars: np.ndarray
    _inverse_mass: np.ndarray
    _damped: bool
    _cell_size: float
    _doubles: DoublePositions

    def _prepare(
        self, positions: np.ndarray, device: str, gravity: Sequence[float], frame_rate: float, lanes: bool = True
    ) -> None:
        """Take what shapes all arrays; ``lanes=False`` keeps worlds one after the other on the CPU too."""
        self.device, self.frame_rate = str(device), float(frame_rate)
        self.world_count, self.particle_count = positions.shape[:2]
        self.gravity = np.asarray(gravity, dtype=float)
        self._cuda = self.device.startswith("cuda")
        self.lanes = LANES if not self._cuda and self.world_count > 1 and lanes else 1
        self.group_count = -(-self.world_count // self.lanes)
        self._number: Any = lane if self.lanes > 1 else float
        self._integer: Any = lane_int if self.lanes > 1 else int
        self.missed = np.zeros(self.world_count, dtype=bool)
        self.sums: ShapeImpulses | None = None
        self._counts: wp.array | None = None  # read on CUDA along with `finite`, so that nobody waits twice
        self._counted: np.ndarray | None = None

    def _start(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Set the first state; nothing acts yet."""
        self._last_dt: Any = 1.0  # of the last run [s], one or (worlds,)
        self.set_state(positions, velocities)
        self.set_colliders(None)
        self.set_grips(())
        self.set_forces(None)

    def _advance(self, run: Settings, substeps: int) -> None:
        """Launch ``substeps`` substeps under the settings."""
        raise NotImplementedError

    def _forget_launches(self) -> None:
        """Be told that arrays were replaced, which captured launches still name."""

    # -- arrays: worlds are the leading axis outside, lanes the innermost inside

    def _put(self, values: np.ndarray, integer: bool = False) -> wp.array:
        """A device array of (worlds, k) numbers, k elements per world or per group of lanes."""
        values = np.asarray(values, dtype=np.int32 if integer else np.float32)
        dtype = self._integer if integer else self._number
        return wp.array(self._arranged(values), dtype=dtype, device=self.device)

    def _arranged(self, values: np.ndarray) -> np.ndarray:
        """(worlds, k) numbers in a device array's order."""
        values = np.ascontiguousarray(values.reshape(self.world_count, -1))
        if self.lanes == 1:
            return values.ravel()
        pad = self.group_count * self.lanes - self.world_count
        # lanes beyond the last world repeat it: they cost nothing more and stay finite
        values = np.concatenate([values, np.repeat(values[-1:], pad, axis=0)])
        values = values.reshape(self.group_count, self.lanes, -1).transpose(0, 2, 1)
        return np.ascontiguousarray(values).reshape(-1, self.lanes)

    def _get(self, array: wp.array, count: int) -> np.ndarray:
        """The (worlds, count) numbers of a device array."""
        values = array.numpy()
        if self.lanes > 1:
            values = values.reshape(self.group_count, count, self.lanes).transpose(0, 2, 1)
        return values.reshape(-1, count)[: self.world_count]

    def _empty(self, count: int, dtype: Any) -> wp.array:
        """Zeros, ``count`` a world or group of lanes."""
        return wp.zeros(self.group_count * count, dtype=dtype, device=self.device)

    @property
    def _whole(self) -> int:
        """Numbers in a world's array, up to a whole vector where particles are taken by sixteen."""
        n = self.particle_count
        return -(-n // LANES) * LANES if self.plan == "vector" else n

    def _allocate_particles(self) -> None:
        """Room for the arrays that all particles have."""
        state, n = self._state, self.particle_count
        for name in PARTICLE_ARRAYS:
            setattr(state, name, self._empty(self._whole, self._number)[: self.group_count * n])
        state.notes = self._empty(NOTES, self._number)
        state.box = self._empty(6, self._number)
        self._size.feature_list = len(self._surface.side) + len(self._surface.face)
        state.feature_mark, state.feature_list = self._empty(n, int), self._empty(self._size.feature_list, int)
        state.feature_due = self._empty(self._size.feature_list + 2, float)
        state.worlds = self.world_count

    # -- state

    def positions(self) -> np.ndarray:
        """(worlds, n, 3) float64, a copy [m]."""
        return self.local_positions() + self.origin[:, None]

    def local_positions(self) -> np.ndarray:
        """(worlds, n, 3) relative to each world's ``origin`` [m]: the solver's own digits, float32 or float64."""
        return np.stack([self._get(a, self.particle_count) for a in self._doubles.arrays], axis=-1)

    @property
    def origin(self) -> np.ndarray:
        """(worlds, 3) float64, what ``local_positions`` are relative to [m]."""
        return self._scalars[:, ORIGIN : ORIGIN + 3].astype(np.float64)

    def velocities(self) -> np.ndarray:
        """(worlds, n, 3) float32, a copy [m/s]."""
        return np.stack(self.velocities_apart(), axis=-1)

    def velocities_apart(self, kept: Kept | None = None) -> tuple[np.ndarray, ...]:
        """The velocities' x, y and z, (worlds, n) float32 each [m/s], as they are or as `keep` kept them."""
        arrays = [getattr(self._state, name) for name in KEPT] if kept is None else kept[1]
        return tuple(self._get(arrays[KEPT.index(name)], self.particle_count) for name in ("vx", "vy", "vz"))

    def set_state(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s], (worlds, n, 3) each."""
        self.load_state(state_from(positions, velocities))

    def save_state(self) -> dict[str, np.ndarray]:
        """Return all that the next step depends on, each array (worlds, ...): what `load_state` takes, bit for bit."""
        notes = self._get(self._state.notes, NOTES)[:, :FASTEST].copy()
        # the list of candidate pairs is not part of the state: it is made anew, which changes no result
        notes[:, TRAVEL] = 1.0e9
        return dict(
            local=self.local_positions(), origin=self._scalars[:, ORIGIN : ORIGIN + 3].copy(),
            velocities=self.velocities(), notes=notes,
        )  # fmt: skip

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """Set the state that `save_state` gave; leading axes of 1 are spread over the worlds."""
        s, worlds, n = self._state, self.world_count, self.particle_count
        local = np.broadcast_to(state["local"], (worlds, n, 3))
        velocities = np.broadcast_to(state["velocities"], (worlds, n, 3))
        for k, (a, b, c) in enumerate((("x", "px", "vx"), ("y", "py", "vy"), ("z", "pz", "vz"))):
            wp.copy(getattr(s, a), self._put(local[..., k]))
            wp.copy(getattr(s, b), self._put(local[..., k]))
            wp.copy(getattr(s, c), self._put(velocities[..., k]))
        self._doubles.count = False
        if local.dtype == np.float64:
            self._doubles.put(local)
        notes = np.broadcast_to(state["notes"], (worlds, FASTEST))
        wp.copy(s.notes, self._put(np.pad(notes, ((0, 0), (0, NOTES - FASTEST)))))
        self._scalars[:, ORIGIN : ORIGIN + 3] = state["origin"]
        s.scalars = self._put(self._scalars)
        if hasattr(self, "_grips"):
            self.set_grips(self._grips)

    def keep(self) -> Kept:
        """Return what `put_back` takes: the present state, copied on the device, which nobody waits for."""
        own = [wp.clone(getattr(self._state, name)) for name in KEPT]
        doubles = [wp.clone(array) for array in self._doubles.arrays] if self._doubles.count else []
        return self._scalars[:, ORIGIN : ORIGIN + 3].copy(), own, doubles

    def put_back(self, kept: Kept) -> None:
        """Set the state that `keep` kept, as `load_state` does what `save_state` gave then."""
        for name, array in zip(KEPT, kept[1], strict=True):
            wp.copy(getattr(self._state, name), array)
        self._doubles.count = bool(kept[2])
        for target, array in zip(self._doubles.arrays, kept[2], strict=False):
            wp.copy(target, array)
        self.load_state({**self.save_state(), "origin": kept[0]})

    def finite(self) -> np.ndarray:
        """(worlds,) bool: whether every position and velocity is a finite number."""
        from nuno.state.pack import finite_worlds

        s, n = self._state, self.particle_count
        if self._cuda:
            finite, self._counted = finite_worlds(s, self.world_count, n, self.device, self._counts)
            return finite
        arrays = (s.x, s.y, s.z, s.vx, s.vy, s.vz)
        if all(np.isfinite(a.numpy()).all() for a in arrays):  # lanes beyond the last world repeat it
            return np.ones(self.world_count, dtype=bool)
        return np.all([np.isfinite(self._get(a, n)).all(axis=1) for a in arrays], axis=0)

    def make_room(self) -> bool:
        """Make room for what did not fit in the run before, which must then be gone through again."""
        return False

    def positions_on_device(self, out: wp.array | None = None) -> wp.array:
        """(worlds, n) array of vec3 [m] on the solver's device, for the renderer; a copy, into ``out`` if given."""
        from nuno.state.pack import pack_positions

        worlds, n, places = self.world_count, self.particle_count, self._doubles.arrays
        return pack_positions(self._state, worlds, n, self.lanes, self.device, out, places)

    def velocities_on_device(self, out: wp.array | None = None) -> wp.array:
        """(worlds, n) array of vec3 [m/s] on the solver's device; a copy, into ``out`` if given."""
        from nuno.state.pack import pack_velocities

        return pack_velocities(self._state, self.world_count, self.particle_count, self.lanes, self.device, out)

    @property
    def arrays(self) -> dict[str, wp.array]:
        """The solver's own arrays x, y, z [m] and vx, vy, vz [m/s].

        On CUDA and for one world on the CPU each is (worlds * n,) float32; in a batch on the CPU it is
        (groups * n,) vectors of 16 worlds.
        """
        return {name: getattr(self._state, name) for name in ("x", "y", "z", "vx", "vy", "vz")}

    @property
    def memory_bytes(self) -> int:
        """Bytes of device memory that this body holds, elements shared by all worlds included."""
        return array_bytes(self._state, self._topology, self._surface)

    def world_bytes(self) -> tuple[int, int]:
        """Return what each world takes on the device, and what making a copy of it takes on the host [bytes]."""
        return array_bytes(self._state) // self.world_count, HOST_COPIES * 8 * 6 * self.particle_count

    # -- what acts on the particles

    def set_colliders(self, colliders: Colliders | None) -> None:
        """The static shapes that the body meets; None for none."""
        if colliders is None:
            shapes = Shapes()
            shapes.count = shapes.stride = shapes.mesh_stride = shapes.pose_stride = 0
            for name in ("kind", "slot", "timing"):
                setattr(shapes, name, wp.zeros(2, dtype=int, device=self.device))
            for name in ("table", "pose", "shape_speed"):
                setattr(shapes, name, wp.zeros(1, dtype=float, device=self.device))
            shapes.mesh = wp.zeros(1, dtype=wp.uint64, device=self.device)
            shapes.faces = wp.zeros(1, dtype=wp.vec2i, device=self.device)
            shapes.planes = wp.zeros(1, dtype=wp.vec4, device=self.device)
        else:
            shapes = colliders.shapes
        self._colliders, self._shapes = colliders, shapes
        self._size.near = max(1, int(shapes.count)) + 1
        self._size.feature_shapes = len(self._surface.feature_colour) + self._size.near
        self._state.near, self._state.feature_shapes = (
            self._empty(self._size.near, int),
            self._empty(self._size.feature_shapes, int),
        )
        self._forget_launches()

    def sum_impulses(self, on: bool) -> None:
        """Sum up what shapes give the body, from the next frame on, or no more. The motion keeps its bits."""
        if on != (self.sums is not None):
            from nuno.solvers.shape_impulses import ShapeImpulses

            self.sums = ShapeImpulses(self) if on else None

    def set_forces(self, forces: np.ndarray | None) -> None:
        """Forces [N] on the vertices, (worlds, n, 3), held until set anew; None for none."""
        s = self._state
        self._pushed = forces is not None
        if forces is None:
            self._size.forces = 1
            for name in ("fx", "fy", "fz"):
                setattr(s, name, wp.zeros(self.group_count, dtype=self._number, device=self.device))
        else:
            self._size.forces = self.particle_count
            for k, name in enumerate(("fx", "fy", "fz")):
                values = self._put(np.asarray(forces)[..., k])
                held = wp.zeros(self.group_count * self._whole, dtype=self._number, device=self.device)
                wp.copy(held, values, count=len(values))
                setattr(s, name, held[: len(values)])
        self._forget_launches()

    def set_grips(self, grips: Sequence[GripSpec]) -> None:
        """Set what is held, and where it goes; vertices that are no longer held get their mass back."""
        self._grips = tuple(grips)
        rows = grip_rows(grips, self.origin, self._inverse_mass)
        _, count, keys, _ = rows.place.shape
        self._grip_times = rows.times
        s, size = self._state, self._size
        size.keys, size.grips = count * keys, count
        for k, name in enumerate(("grip_x", "grip_y", "grip_z")):
            setattr(s, name, self._put(rows.place[..., k]))
        s.grip_weight, s.grip_corner = self._put(rows.weight), self._put(rows.corner, integer=True)
        s.grip_inverse_mass, s.grip_load = (
            self._put(rows.held_inverse_mass),
            self._put(np.zeros((self.world_count, LOADS * count))),
        )
        wp.copy(s.w, self._put(rows.mass))
        self._grip_count, self._grip_keys = rows.count, keys
        self._grip_pulls = int((rows.fixed == 0).any())

        def put(values: np.ndarray, dtype: Any) -> wp.array:
            return wp.array(values, dtype=dtype, device=self.device)

        self._grip_time = put(rows.times.ravel(), wp.float64)
        self._grip_ease, self._grip_fixed = put(rows.ease, int), put(rows.fixed, int)
        self._grip_compliance = rows.compliance
        self._scaled_grip_compliance: dict[float, wp.array] = {}
        self._forget_launches()

    def grip_forces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return what each point of each grip bore in the last frame, and the mass that it moves with.

        Returns:
            For each grip: forces (worlds, k, 3) [N] that constraints pulled its points with, in the mean over the
            frame's substeps, and masses (worlds, k) [kg] of stiffly held vertices, whose own weight and inertia come
            on top.
        """
        worlds, rows = self.world_count, np.arange(self.world_count)[:, None]
        loads = self._get(self._state.grip_load, LOADS * max(1, self._grip_count)).astype(float)
        loads = loads.reshape(worlds, -1, LOADS)
        forces = loads[..., :3] / np.maximum(loads[..., 3:], 1.0) / np.reshape(self._last_dt, (-1, 1, 1)) ** 2
        result, first = [], 0
        fixed = self._grip_fixed.numpy()
        for grip in self._grips:
            corners = grip.vertices if grip.vertices is not None else grip.corners[..., 0]  # type: ignore[index]
            k = corners.shape[1]
            held = (corners >= 0) & (fixed[first : first + k] != 0)
            mass = np.where(held, self.mass[rows, np.maximum(corners, 0)], 0.0)
            result.append((np.where((corners >= 0)[..., None], forces[:, first : first + k], 0.0), mass))
            first += k
        return result

    def _inverse_mass_now(self, array: wp.array) -> np.ndarray:
        """(worlds, n), zero for what is held."""
        fixed = self._get(array, self.particle_count).copy()
        fixed[fixed < 0.5 * self._inverse_mass] = 0.0
        return fixed

    # -- running

    def run(self, time: float, duration: float, substeps: int | None = None) -> None:
        """Advance by whole frames and a shorter last one.

        Args:
            time: World time at the start [s], for the grips' paths.
            duration: How long [s].
            substeps: Substeps of a whole frame, where they are not the solver's own.
        """
        frame, count = 1.0 / self.frame_rate, substeps or self.substeps
        whole = math.floor(duration / frame + 1e-6)
        rest = duration - whole * frame
        if whole:
            self._launch(time, frame / count, whole * count, count)
        if rest > 1e-9:
            last = substeps_of(rest, frame, count)
            self._launch(time + whole * frame, rest / last, last, count)

    def _launch(self, time: float, dt: float, substeps: int, frame: int) -> None:
        if self.sums is None:
            run = self.settings(time, dt, frame)
            self._reset_clock()
            self._advance(run, substeps)
            return
        self.open(time, dt, frame)
        for k in range(substeps):
            self.begin_substep(k)
            self.end_substep(k)

    def open(self, time: float, dt: float, frame: int) -> None:
        """Begin to advance by parts of a substep of ``dt`` [s], ``frame`` of them a frame; see `step_parts`."""
        self._opened = self.settings(time, dt, frame)
        self._doubles.bring(self._opened)
        self._reset_clock()

    def step_parts(self, index: int, parts: int) -> None:
        """Do some parts (see `nuno.state.cloth_state`) of substep ``index`` since `open`."""
        self._opened.first, self._opened.parts = index, parts
        self._advance(self._opened, 1)

    def begin_substep(self, index: int) -> None:
        """Do substep ``index`` since `open` up to where shapes are met."""
        self.step_parts(index, MOTION | COMPLIANT_GRIPS | SELF_CONTACT)
        if self.sums is not None and index % self._opened.frame == 0:
            self.sums.begin()

    def end_substep(self, index: int) -> None:
        """Do the rest of it."""
        if self.sums is None:
            self.step_parts(index, SHAPES | VELOCITIES)
        else:
            self.sums.finish(index)

    def settings(self, time: float, dt: float, frame: int) -> Settings:
        """The run's settings, paths counted from ``time``, with ``frame`` substeps of ``dt`` [s] a frame."""
        if self._colliders is not None:
            self._colliders.begin(time, dt)
        run = Settings()
        run.dt = self._last_dt = dt
        run.gravity = wp.vec3(*(float(g) for g in self.gravity))
        run.pushed, run.damped, run.touching = int(self._pushed), int(self._damped), int(self.self_contact)
        # candidates within a third of a cell: few enough to look at, and good for several substeps
        run.cell = self._cell_size
        run.margin = 0.35 * self._cell_size
        run.reach = 0.25 * self._cell_size
        run.frame, run.first, run.parts = frame, 0, ALL_PARTS
        run.grips, run.keys, run.pulled = self._grip_count, self._grip_keys, self._grip_pulls
        run.grip_start = wp.array([time], dtype=wp.float64, device=self.device)
        run.grip_time, run.step = self._grip_time, wp.float64(dt)
        run.grip_ease, run.grip_fixed = self._grip_ease, self._grip_fixed
        if dt not in self._scaled_grip_compliance:  # all whole frames have the same
            scaled = self._grip_compliance / dt**2
            self._scaled_grip_compliance = {dt: wp.array(scaled, dtype=float, device=self.device)}
        run.grip_compliance = self._scaled_grip_compliance[dt]
        return run

    def _reset_clock(self) -> None:
        from nuno.state.pack import reset_clock

        reset_clock(self._state, self.group_count, self.device)


def substeps_of(duration: float, frame: float, substeps: int) -> int:
    """Substeps of a span shorter than a frame [s] that has ``substeps``."""
    return max(1, math.ceil(substeps * duration / frame - 1e-6))


def state_from(positions: np.ndarray, velocities: np.ndarray) -> dict[str, np.ndarray]:
    """Return positions [m] and velocities [m/s], (worlds, n, 3) each, as what `ParticleSolver.load_state` takes."""
    positions = np.asarray(positions, dtype=np.float64)
    velocities = np.asarray(velocities)
    if positions.strides[0] == 0 and velocities.strides[0] == 0:  # of worlds that are all alike one will do
        positions, velocities = positions[:1], velocities[:1]
    # each world's own origin, in steps of 1/1024 m so that adding it loses nothing
    origin = np.round(np.nan_to_num(positions.mean(axis=1)) * 1024.0) / 1024.0
    notes = np.zeros((len(positions), FASTEST), dtype=np.float32)
    notes[:, TRAVEL] = 1.0e9
    speed = np.linalg.norm(np.asarray(velocities, dtype=float), axis=-1).max(axis=-1)
    notes[:, SPEED] = np.nan_to_num(speed, nan=0.0) ** 2
    local, origin = (positions - origin[:, None]).astype(np.float32), origin.astype(np.float32)
    return dict(local=local, origin=origin, velocities=velocities.astype(np.float32), notes=notes)
