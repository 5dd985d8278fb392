"""One dynamic cloth in one or many worlds: its arrays on the device, and the plan that runs it."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.contact.nearness import GROUP
from nuno.scene.cloth import ClothTopology
from nuno.solver.compliances import compliances, vertex_masses
from nuno.solver.frame import run_lanes, run_worlds
from nuno.solver.lanes import LANES, lane, lane_int
from nuno.solver.large import CELLS, HINGES, LINES, TRIANGLES, YARNS, LargePlan
from nuno.solver.shared import SHARED_PARTICLES, run_blocks, run_blocks_shared
from nuno.solver.state import (
    NOTES,
    ORIGIN,
    SCALARS,
    SPEED,
    TRAVEL,
    Settings,
    Shapes,
    Sizes,
    StateFloat,
    StateLanes,
    Topology,
)
from nuno.solver.substeps import default_substeps
from nuno.solver.upload import upload
from nuno.solver.wide import run_wide, widen_topology

if TYPE_CHECKING:
    from nuno.grip import GripSpec
    from nuno.materials import Cloth
    from nuno.scene.colliders import Colliders

BLOCK_THREADS = 256
"""Threads of a CUDA block, which runs one world."""
BLOCK_PARTICLES = 4096
"""Above this a world does not fit a block well and runs a launch per phase in a captured graph."""

_threads: ThreadPoolExecutor | None = None


def _pool() -> ThreadPoolExecutor:
    """A thread per core; Warp's CPU launches release the GIL."""
    global _threads
    if _threads is None:
        _threads = ThreadPoolExecutor(len(os.sched_getaffinity(0)), thread_name_prefix="nuno-lanes")
    return _threads


class ClothSolver:
    """A cloth's state and how it advances.

    Args:
        topology: The cloth's elements.
        material: A `nuno.materials.Cloth`.
        positions: (worlds, n, 3) float [m].
        velocities: (worlds, n, 3) float [m/s].
        device: "cpu" or "cuda:0" ...
        gravity: (3,) [m/s2].
        frame_rate: Frames a second.
        substeps: Substeps a frame; None takes `default_substeps`.
        friction: Friction coefficient of the body; None takes the material's. A number or one per world.
        self_contact: Whether the cloth collides with itself.
        plan: "auto", "fused" (a thread per world or sixteen worlds, or a block per world), "vector" (one world on
            the CPU by sixteen elements at a time) or "large" (a launch per phase).

    Limitations: one pass a substep, so that what is stiffer than m / dt^2 comes out softer than stated, except along
    a sheet's yarns, which are solved exactly; damping acts on bending alone.
    """

    def __init__(
        self,
        topology: ClothTopology,
        material: Cloth,
        positions: np.ndarray,
        velocities: np.ndarray,
        *,
        device: str = "cpu",
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        frame_rate: float = 60.0,
        substeps: int | None = None,
        friction: float | np.ndarray | None = None,
        self_contact: bool = True,
        plan: str = "auto",
    ) -> None:
        positions = np.asarray(positions, dtype=np.float32)
        self.topology, self.device, self.frame_rate = topology, str(device), float(frame_rate)
        self.world_count, self.particle_count = positions.shape[:2]
        self.gravity = np.asarray(gravity, dtype=float)
        down = float(np.linalg.norm(self.gravity))
        values = material.resolved(self.world_count, topology.element_count)
        rigidity = max(float(values[f"bending_rigidity_{side}"].max()) for side in ("warp", "weft"))
        rule = (down, 1.0 / frame_rate, float(values["area_density"].min()), rigidity)
        self.substeps = int(substeps) if substeps else default_substeps(topology, *rule)
        self.self_contact = self_contact
        self._cuda = self.device.startswith("cuda")
        # the large plan keeps one world after the other, also where it is tried out on the CPU
        self.lanes = LANES if not self._cuda and self.world_count > 1 and plan != "large" else 1
        self.shared_memory = True
        self.group_count = -(-self.world_count // self.lanes)
        self._number: Any = lane if self.lanes > 1 else float
        self._integer: Any = lane_int if self.lanes > 1 else int
        if plan == "auto":
            one = "vector" if not self._cuda and self.world_count == 1 else "fused"
            plan = "large" if self._cuda and self.particle_count > BLOCK_PARTICLES else one
        self.plan = plan
        self._build(values, friction)
        self.set_state(positions, velocities)
        self.set_colliders(None)
        self.set_grips(())
        self.set_forces(None)
        self._large: LargePlan | None = None
        self._wide: Any = None

    # -- arrays: worlds are the leading axis outside, lanes the innermost inside

    def _put(self, values: np.ndarray, integer: bool = False) -> wp.array:
        """A device array of (worlds, k) numbers, k elements per world or per group of lanes."""
        kind = np.int32 if integer else np.float32
        values = np.ascontiguousarray(np.asarray(values, dtype=kind).reshape(self.world_count, -1))
        dtype = self._integer if integer else self._number
        if self.lanes > 1:
            pad = self.group_count * self.lanes - self.world_count
            # lanes beyond the last world repeat it: they cost nothing more and stay finite
            values = np.concatenate([values, np.repeat(values[-1:], pad, axis=0)])
            values = values.reshape(self.group_count, self.lanes, -1).transpose(0, 2, 1)
            return wp.array(np.ascontiguousarray(values).reshape(-1, self.lanes), dtype=dtype, device=self.device)
        return wp.array(values.ravel(), dtype=dtype, device=self.device)

    def _get(self, array: wp.array, count: int) -> np.ndarray:
        """The (worlds, count) numbers of a device array."""
        values = array.numpy()
        if self.lanes > 1:
            values = values.reshape(self.group_count, count, self.lanes).transpose(0, 2, 1)
        return values.reshape(-1, count)[: self.world_count]

    def _build(self, values: dict[str, np.ndarray], friction: float | np.ndarray | None) -> None:
        topology, worlds, n = self.topology, self.world_count, self.particle_count
        state = StateLanes() if self.lanes > 1 else StateFloat()
        size = Sizes()
        topo = Topology()
        shared = upload(topology, self.device)
        for name, value in shared.items():
            setattr(topo, name, value)
        topo.particles, topo.blocks = n, topology.blocks.count
        self._size, self._state, self._topology = size, state, topo

        soft = compliances(topology, values)
        for kind in ("stretch", "shear", "bend"):
            table = getattr(soft, kind)
            setattr(state, f"{kind}_soft", self._put(table))
            setattr(size, f"{kind}_soft", table.shape[1])
        for kind in ("edge", "cell", "line", "hinge"):
            setattr(topo, f"{kind}_soft", wp.array(getattr(soft, kind), dtype=int, device=self.device))
        topo.triangle_soft = wp.array(soft.triangle, dtype=wp.vec3i, device=self.device)
        self.mass = vertex_masses(topology, values["area_density"])
        self._inverse_mass = (1.0 / self.mass).astype(np.float32)
        own = (
            values["friction"]
            if friction is None
            else np.broadcast_to(np.asarray(friction, float).reshape(-1, 1), (worlds, 1))
        )
        # thicker than half a cell, layers of one fold would push their own neighbours apart
        thickness = np.minimum(values["thickness"], 0.5 * topology.cell_size)
        self._scalars = np.zeros((worlds, SCALARS), dtype=np.float32)
        self._scalars[:, :ORIGIN] = np.concatenate([values["air_drag"], own, values["damping"], thickness], axis=1)
        self._damped = bool(np.any(values["damping"] > 0))
        self._allocate()

    @property
    def _whole(self) -> int:
        """Numbers in a world's array, up to a whole vector where particles are taken by sixteen."""
        n = self.particle_count
        return -(-n // LANES) * LANES if self.plan == "vector" else n

    def _allocate(self) -> None:
        """Room for what the kernels keep for themselves."""
        state, size, n, groups = self._state, self._size, self.particle_count, self.group_count
        blocks = self.topology.blocks
        # boxes of blocks, and of groups of blocks, six numbers each
        size.blocks = 6 * (blocks.count + -(-blocks.count // GROUP))
        size.listed = 3 * n + 6 if self.self_contact else 1
        size.middle = 4 * (len(blocks.face) + len(blocks.edge)) if self.self_contact else 1
        # candidates seen in crumpled cloths: under 3 a vertex (vertex-triangle) and 8 a vertex (edge-edge)
        size.vertex_triangle, size.edge_edge = 6 * n + 64, 16 * n + 128
        if not self.self_contact:
            size.vertex_triangle = size.edge_edge = 1
        size.moved = 4 * n if self._cuda or self.plan == "large" else 1

        def empty(count: int, dtype: Any) -> wp.array:
            return wp.zeros(groups * count, dtype=dtype, device=self.device)

        for name in ("x", "y", "z", "px", "py", "pz", "vx", "vy", "vz", "w"):
            setattr(state, name, empty(self._whole, self._number)[: groups * n])
        size.edges = max(1, len(self.topology.edges))
        for name in ("yarn_gain", "yarn_pull", "yarn_inverse"):
            setattr(state, name, empty(size.edges, self._number))
        state.notes = empty(NOTES, self._number)
        state.bounds = empty(size.blocks, self._number)
        state.listed = empty(size.listed, self._number)
        state.middle = empty(size.middle, self._number)
        state.box = empty(6, self._number)
        state.vertex_triangle = empty(4 * size.vertex_triangle, self._integer)
        state.edge_edge = empty(4 * size.edge_edge, self._integer)
        state.pair_count = empty(2, self._integer)
        if self.plan == "large":  # solves all listed pairs, which a whole device looks at in no time
            state.touch_triangle, state.touch_edge = state.vertex_triangle, state.edge_edge
            state.touch_count = state.pair_count
        else:
            state.touch_triangle = empty(4 * size.vertex_triangle, self._integer)
            state.touch_edge = empty(4 * size.edge_edge, self._integer)
            state.touch_count = empty(2, self._integer)
        state.moved = empty(size.moved, int)
        state.worlds = self.world_count

    # -- state

    def positions(self) -> np.ndarray:
        """(worlds, n, 3) float64, a copy [m]."""
        return self.local_positions() + self.origin[:, None]

    def local_positions(self) -> np.ndarray:
        """(worlds, n, 3) float32, relative to each world's ``origin`` [m]: the solver's own digits."""
        s, n = self._state, self.particle_count
        return np.stack([self._get(a, n) for a in (s.x, s.y, s.z)], axis=-1)

    @property
    def origin(self) -> np.ndarray:
        """(worlds, 3) float64, what ``local_positions`` are relative to [m]."""
        return self._scalars[:, ORIGIN : ORIGIN + 3].astype(np.float64)

    def velocities(self) -> np.ndarray:
        """(worlds, n, 3) float32, a copy [m/s]."""
        s, n = self._state, self.particle_count
        return np.stack([self._get(a, n) for a in (s.vx, s.vy, s.vz)], axis=-1)

    def set_state(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s], (worlds, n, 3) each."""
        positions = np.asarray(positions, dtype=np.float64)
        # each world's own origin, in steps of 1/1024 m so that adding it loses nothing
        origin = np.round(np.nan_to_num(positions.mean(axis=1)) * 1024.0) / 1024.0
        notes = np.zeros((self.world_count, NOTES), dtype=np.float32)
        notes[:, TRAVEL] = 1.0e9
        speed = np.linalg.norm(np.asarray(velocities, dtype=float), axis=-1).max(axis=-1)
        notes[:, SPEED] = np.nan_to_num(speed, nan=0.0) ** 2
        self.load_state(
            dict(
                local=(positions - origin[:, None]).astype(np.float32), origin=origin.astype(np.float32),
                velocities=np.asarray(velocities, dtype=np.float32), notes=notes,
            )
        )  # fmt: skip

    def save_state(self) -> dict[str, np.ndarray]:
        """All that the next step depends on, each array (worlds, ...): what `load_state` takes, bit for bit."""
        notes = self._get(self._state.notes, NOTES).copy()
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
        wp.copy(s.notes, self._put(np.broadcast_to(state["notes"], (worlds, NOTES))))
        self._scalars[:, ORIGIN : ORIGIN + 3] = state["origin"]
        s.scalars = self._put(self._scalars)
        if hasattr(self, "_grips"):
            self.set_grips(self._grips)

    def finite(self) -> np.ndarray:
        """(worlds,) bool: whether every position and velocity is a finite number."""
        s, n = self._state, self.particle_count
        arrays = (s.x, s.y, s.z, s.vx, s.vy, s.vz)
        return np.all([np.isfinite(self._get(a, n)).all(axis=1) for a in arrays], axis=0)

    def positions_on_device(self) -> wp.array:
        """(worlds, n) array of vec3 [m] on the solver's device, for the renderer; a copy."""
        from nuno.solver.pack import pack_positions

        return pack_positions(self._state, self.world_count, self.particle_count, self.lanes, self.device)

    @property
    def arrays(self) -> dict[str, wp.array]:
        """The solver's own arrays x, y, z [m] and vx, vy, vz [m/s].

        On CUDA and for one world on the CPU each is (worlds * n,) float32; in a batch on the CPU it is
        (groups * n,) vectors of 16 worlds.
        """
        return {name: getattr(self._state, name) for name in ("x", "y", "z", "vx", "vy", "vz")}

    @property
    def pair_counts(self) -> np.ndarray:
        """(worlds, 2) int: listed vertex-triangle and edge-edge candidates, those that did not fit included."""
        return self._get(self._state.pair_count, 2)

    @property
    def memory_bytes(self) -> int:
        """Bytes of device memory that this cloth holds, elements shared by all worlds included."""
        total = 0
        holders: tuple[Any, ...] = (self._state, self._topology)
        for holder in holders:
            for name in holder._cls.vars:
                value = getattr(holder, name)
                total += value.capacity if isinstance(value, wp.array) else 0
        return total

    # -- what acts on the cloth

    def set_colliders(self, colliders: Colliders | None) -> None:
        """The static shapes that the cloth meets; None for none."""
        if colliders is None:
            shapes = Shapes()
            shapes.count = shapes.stride = shapes.mesh_stride = 0
            shapes.kind = wp.zeros(1, dtype=int, device=self.device)
            shapes.table = wp.zeros(1, dtype=float, device=self.device)
            shapes.mesh = wp.zeros(1, dtype=wp.uint64, device=self.device)
        else:
            shapes = colliders.shapes
        self._colliders, self._shapes = colliders, shapes
        self._size.near = max(1, int(shapes.count)) + 1
        self._state.near = wp.zeros(self.group_count * self._size.near, dtype=int, device=self.device)
        self._large = None

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
        self._large = None

    def set_grips(self, grips: Sequence[GripSpec]) -> None:
        """What is held, and where it goes; vertices that are no longer held get their mass back."""
        self._grips = tuple(grips)
        worlds = self.world_count
        entries: list[dict[str, Any]] = []
        for grip in grips:
            if grip.vertices is not None:
                corners = np.repeat(np.asarray(grip.vertices)[..., None], 3, axis=-1)
                barycentric = np.broadcast_to([1.0, 0.0, 0.0], corners.shape)
            else:
                corners, barycentric = np.asarray(grip.corners), np.asarray(grip.barycentric)
            for k in range(corners.shape[1]):
                single = barycentric[:, k]
                vertex = bool((np.abs(single[:, 0] - 1.0) < 1e-6).all())
                entries.append(
                    dict(
                        corners=corners[:, k], weights=single, times=np.asarray(grip.times, float),
                        positions=np.asarray(grip.positions)[:, k] - self.origin[:, None],
                        ease=grip.interpolation == "minimum_jerk",
                        compliance=float(grip.compliance), fixed=vertex and grip.compliance == 0.0,
                    )
                )  # fmt: skip
        keys = max([len(e["times"]) for e in entries], default=1)
        count = max(1, len(entries))
        corner = np.full((worlds, count, 3), -1, dtype=np.int32)
        weight = np.zeros((worlds, count, 3), dtype=np.float32)
        place = np.zeros((worlds, count, keys, 3), dtype=np.float32)
        self._grip_times = np.zeros((count, keys))
        mass = self._inverse_mass.copy()
        for g, e in enumerate(entries):
            corner[:, g], weight[:, g] = e["corners"], e["weights"]
            m = len(e["times"])
            self._grip_times[g] = np.concatenate([e["times"], np.full(keys - m, e["times"][-1])])
            place[:, g, :m] = e["positions"]
            place[:, g, m:] = e["positions"][:, -1:]
            if e["fixed"]:
                held = np.nonzero(e["corners"][:, 0] >= 0)[0]
                mass[held, e["corners"][held, 0]] = 0.0
        s, size = self._state, self._size
        size.keys, size.grips = count * keys, count
        for k, name in enumerate(("grip_x", "grip_y", "grip_z")):
            setattr(s, name, self._put(place[..., k]))
        s.grip_weight, s.grip_corner = self._put(weight), self._put(corner, integer=True)
        wp.copy(s.w, self._put(mass))
        self._grip_count, self._grip_keys = len(entries), keys

        def put(values: np.ndarray, dtype: Any) -> wp.array:
            return wp.array(values, dtype=dtype, device=self.device)

        self._grip_ease = put(np.array([int(e["ease"]) for e in entries] or [0], np.int32), int)
        self._grip_fixed = put(np.array([int(e["fixed"]) for e in entries] or [1], np.int32), int)
        self._grip_soft = np.array([e["compliance"] for e in entries] or [0.0])
        self._large = None

    # -- running

    def run(self, time: float, duration: float) -> None:
        """Advance by whole frames and a shorter last one.

        Args:
            time: World time at the start [s], for the grips' paths.
            duration: How long [s].
        """
        frame = 1.0 / self.frame_rate
        whole = math.floor(duration / frame + 1e-6)
        rest = duration - whole * frame
        if whole:
            self._launch(time, frame / self.substeps, whole * self.substeps)
        if rest > 1e-9:
            count = max(1, math.ceil(self.substeps * rest / frame - 1e-6))
            self._launch(time + whole * frame, rest / count, count)

    def settings(self, time: float, dt: float) -> Settings:
        """The run's settings, paths counted from ``time``."""
        run = Settings()
        run.dt = dt
        run.gravity = wp.vec3(*(float(g) for g in self.gravity))
        run.pushed, run.damped, run.touching = int(self._pushed), int(self._damped), int(self.self_contact)
        # candidates within a third of a cell: few enough to look at, and good for several substeps
        run.margin = 0.35 * self.topology.cell_size
        run.reach = 0.25 * self.topology.cell_size
        run.frame = self.substeps
        run.grips, run.keys = self._grip_count, self._grip_keys
        run.grip_time = wp.array((self._grip_times - time).ravel(), dtype=float, device=self.device)
        run.grip_ease, run.grip_fixed = self._grip_ease, self._grip_fixed
        run.grip_soft = wp.array(self._grip_soft / dt**2, dtype=float, device=self.device)
        return run

    def _launch(self, time: float, dt: float, substeps: int) -> None:
        run = self.settings(time, dt)
        self._reset_clock()
        if self.plan == "large":
            if self._large is None:
                self._large = self._large_plan()
            self._large.run(run, substeps)
            return
        common = [self._state, self._topology, self._size, run, self._shapes]
        if self._cuda:
            fits = self.shared_memory and self.particle_count <= SHARED_PARTICLES
            wp.launch(
                run_blocks_shared if fits else run_blocks, dim=self.group_count * BLOCK_THREADS,
                inputs=[*common, substeps, BLOCK_THREADS], device=self.device, block_dim=BLOCK_THREADS,
            )  # fmt: skip
            return

        if self.plan == "vector":
            if self._wide is None:
                self._wide = widen_topology(self.topology, self._topology)
            inputs = [self._state, self._topology, self._wide, self._size, run, self._shapes, substeps]
            wp.launch(run_wide, dim=1, inputs=inputs, device=self.device)
            return

        def group(first: int) -> None:
            kernel = run_lanes if self.lanes > 1 else run_worlds
            wp.launch(kernel, dim=1, inputs=[*common, first, substeps, 1], device=self.device)

        if self.group_count == 1:
            group(0)
        else:
            # here, for every thread would compile it for itself
            wp.load_module(run_lanes.module, device=self.device)
            list(_pool().map(group, range(self.group_count)))

    def _large_plan(self) -> LargePlan:
        topology = self.topology
        kinds = {HINGES: topology.hinges, LINES: topology.lines, CELLS: topology.cells}
        colours = {kind: elements.offsets for kind, elements in kinds.items()}
        colours |= {TRIANGLES: topology.triangles.offsets, YARNS: self._topology.yarn_kind.numpy()}
        parts = (self._state, self._topology, self._size, self._shapes)
        return LargePlan(*parts, self.device, self.world_count, colours)

    def _reset_clock(self) -> None:
        from nuno.solver.pack import reset_clock

        reset_clock(self._state, self.group_count, self.lanes, self.device)
