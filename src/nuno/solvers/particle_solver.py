"""Particles in one or many worlds: what acts on them, and how time passes.

What they are the corners of, and so the elastic constraints between them, is for the classes under `ParticleSolver`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.solvers.grip_rows import grip_rows
from nuno.solvers.particle_state import ParticleState
from nuno.state.cloth_state import (
    ALL_PARTS,
    COMPLIANT_GRIPS,
    LOADS,
    MOTION,
    SELF_CONTACT,
    SHAPES,
    VELOCITIES,
    Settings,
    Shapes,
)

if TYPE_CHECKING:
    from nuno.joints.grip import GripSpec
    from nuno.solvers.shape_tables import ShapeTables


class ParticleSolver(ParticleState):
    """The particles of one body, and the frame around its elastic constraints.

    A class under it makes the arrays in its constructor, between `_prepare` and `_start`, and launches kernels in
    `_advance`.

    Attributes:
        substeps: Substeps a frame.
        self_contact: Whether the body collides with itself.
        sums: What shapes give the body over a frame, where that is asked for.
    """

    substeps: int
    self_contact: bool
    _damped: bool
    cell_size: float

    def _choose_plan(self, plan: str) -> str:
        """Return the plan that is asked for, or of "auto" the quickest for this device, body and number of worlds."""
        if plan != "auto":
            return plan
        if self._cuda:
            return "grid" if self._block_group_pays() else "fused"
        return "vector" if self.world_count == 1 else "fused"

    def _block_group_pays(self) -> bool:
        """Return True if worlds by block groups are quicker than by a block each, or if they fit no block."""
        raise NotImplementedError

    def _start(self, positions: np.ndarray, velocities: np.ndarray | None) -> None:
        """Set the first state, or with velocities None wait for ``load_state``; nothing acts yet."""
        self.last_dt: Any = 1.0  # of the last run [s], one or (worlds,)
        if velocities is not None:
            self.set_state(positions, velocities)
        self.set_colliders(None)
        self.set_grips(())
        self.set_forces(None)

    def _advance(self, run: Settings, substeps: int) -> None:
        """Launch ``substeps`` substeps under the settings."""
        raise NotImplementedError

    def _forget_launches(self) -> None:
        """Be told that arrays were replaced, which captured launches still name."""

    def load_state(self, state: dict[str, np.ndarray]) -> None:
        """Set the state that `save_state` gave; leading axes of 1 are spread over the worlds."""
        super().load_state(state)
        if getattr(self, "_grips", ()):  # whose places are relative to the origin
            self.set_grips(self._grips)

    # -- what acts on the particles

    def set_colliders(self, colliders: ShapeTables | None) -> None:
        """The static shapes that the body meets; None for none."""
        self._colliders = colliders
        self.shapes = shapes = _no_shapes(self.device) if colliders is None else colliders.shapes
        self._size.shape_list = 1 + 2 * max(1, int(shapes.count))
        self._size.feature_shapes = len(self._surface.feature_colour) + 2 * max(1, int(shapes.count)) + 1
        self.state.shape_list, self.state.feature_shapes = (
            self._empty(self._size.shape_list, int),
            self._empty(self._size.feature_shapes, int),
        )
        self._forget_launches()

    def set_forces(self, forces: np.ndarray | None) -> None:
        """Forces [N] on the vertices, (worlds, n, 3), held until set anew; None for none."""
        s = self.state
        self._pushed = forces is not None
        if forces is None:
            self._size.forces = 1
            s.fx = s.fy = s.fz = wp.zeros(self.group_count, dtype=self._number, device=self.device)
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
        s, size = self.state, self._size
        size.keys, size.grips = count * keys, count
        for k, name in enumerate(("grip_x", "grip_y", "grip_z")):
            setattr(s, name, self._put(rows.place[..., k]))
        s.grip_weight, s.grip_corner = self._put(rows.weight), self._put(rows.corner, integer=True)
        s.grip_inverse_mass, s.grip_load = (
            self._put(rows.held_inverse_mass),
            self._put(np.zeros((self.world_count, LOADS * count))),
        )
        self.fill(s.w, rows.mass)
        self.grip_count, self._grip_keys = rows.count, keys
        self._compliant_grips = int((rows.fixed == 0).any())

        def put(values: np.ndarray, dtype: Any) -> wp.array:
            return wp.array(values, dtype=dtype, device=self.device)

        self._grip_time = put(rows.times.ravel(), wp.float64)
        self._grip_ease, self._grip_fixed = put(rows.ease, int), put(rows.fixed, int)
        self._grip_compliance = rows.compliance
        self._scaled_grip_compliance: dict[float, wp.array] = {}
        self._forget_launches()

    def forget_grips(self) -> None:
        """Be told that other grips will be set before anything runs, so that a state is loaded without these."""
        self._grips = ()

    def grip_forces(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return what each point of each grip bore in the last frame, and the mass that it moves with.

        Returns:
            For each grip: forces (worlds, k, 3) [N] that constraints pulled its points with, in the mean over the
            frame's substeps, and masses (worlds, k) [kg] of stiffly held vertices, whose own weight and inertia come
            on top.
        """
        worlds, rows = self.world_count, np.arange(self.world_count)[:, None]
        loads = self.download(self.state.grip_load, LOADS * max(1, self.grip_count)).astype(float)
        loads = loads.reshape(worlds, -1, LOADS)
        forces = loads[..., :3] / np.maximum(loads[..., 3:], 1.0) / np.reshape(self.last_dt, (-1, 1, 1)) ** 2
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

    def inverse_mass_now(self, array: wp.array) -> np.ndarray:
        """(worlds, n), zero for what is held."""
        fixed = self.download(array, self.particle_count).copy()
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
        self.opened = self.settings(time, dt, frame)
        self.doubles.bring(self.opened)
        self._reset_clock()

    def step_parts(self, index: int, parts: int) -> None:
        """Do some parts (see `nuno.state.cloth_state`) of substep ``index`` since `open`."""
        self.opened.first, self.opened.parts = index, parts
        self._advance(self.opened, 1)

    def begin_substep(self, index: int) -> None:
        """Do substep ``index`` since `open` up to where shapes are met."""
        self.step_parts(index, MOTION | COMPLIANT_GRIPS | SELF_CONTACT)
        if self.sums is not None and index % self.opened.frame == 0:
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
        run.dt = self.last_dt = dt
        run.gravity = wp.vec3(*(float(g) for g in self.gravity))
        run.pushed, run.damped, run.touching = int(self._pushed), int(self._damped), int(self.self_contact)
        # candidates within a third of a cell: few enough to look at, and good for several substeps
        run.cell = self.cell_size
        run.margin = 0.35 * self.cell_size
        run.reach = 0.25 * self.cell_size
        run.frame, run.first, run.parts = frame, 0, ALL_PARTS
        run.grips, run.keys, run.pulled = self.grip_count, self._grip_keys, self._compliant_grips
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

        reset_clock(self.state, self.group_count, self.device)


@cache
def _no_shapes(device: str) -> Shapes:
    """Return tables of no shapes, which nobody writes to: all solvers of a device begin with the same."""
    shapes = Shapes()
    shapes.count = shapes.stride = shapes.mesh_stride = shapes.pose_stride = 0
    for name in ("kind", "slot", "timing", "cell_ends", "cell_planes"):
        setattr(shapes, name, wp.zeros(2, dtype=int, device=device))
    for name in ("table", "pose", "shape_speed"):
        setattr(shapes, name, wp.zeros(1, dtype=float, device=device))
    shapes.mesh = wp.zeros(1, dtype=wp.uint64, device=device)
    shapes.faces = shapes.corner_ends = wp.zeros(1, dtype=wp.vec2i, device=device)
    shapes.planes = shapes.corners = shapes.hull_low = wp.zeros(1, dtype=wp.vec4, device=device)
    shapes.hull_grid = wp.zeros(1, dtype=wp.vec4i, device=device)
    return shapes


def substeps_of(duration: float, frame: float, substeps: int) -> int:
    """Substeps of a span shorter than a frame [s] that has ``substeps``."""
    return max(1, math.ceil(substeps * duration / frame - 1e-6))
