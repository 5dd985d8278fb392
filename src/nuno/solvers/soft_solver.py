"""One dynamic soft body in one or many worlds: its arrays on the device, and the plan that runs it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.bodies.resolution import Resolution
from nuno.constraints.tetrahedron import COLUMNS
from nuno.contact.particle.feature_lists import ROUND
from nuno.contact.particle.feature_queue import QUEUE, ROOM
from nuno.numbers.lanes import LANES, lane, lane_int
from nuno.plans.cpu_groups import launch_groups
from nuno.plans.group_figures import SHARED_FIGURES
from nuno.plans.group_kernels import SOFT_THREADS, run_soft_double_grid, run_soft_grid
from nuno.plans.group_plan import GridPlan, block_groups_of, cores_of
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.plans.shared_memory import DOUBLE_PARTICLES, ROOMY_PARTICLES, SHARED_PARTICLES
from nuno.plans.soft_block_plan import FAR, FEATURES, FEW_THREADS, MANY_THREADS
from nuno.plans.soft_worlds import (
    run_soft_double_lanes,
    run_soft_double_simd,
    run_soft_double_worlds,
    run_soft_lanes,
    run_soft_simd,
    run_soft_worlds,
)
from nuno.solvers.coloured_sides import put_sides
from nuno.solvers.particle_solver import ParticleSolver
from nuno.solvers.soft_substeps import modulus_share, soft_substeps, wanted_substeps, wave_speed
from nuno.state.cloth_state import NOTES, SCALARS, Settings
from nuno.state.double_positions import DoublePositions
from nuno.state.soft_state import (
    SHIFTS,
    FarSides,
    Sides,
    SimdClusters,
    SoftDouble,
    SoftDoubleLanes,
    SoftFloat,
    SoftLanes,
    SoftSizes,
    Tetrahedra,
)
from nuno.topology.element_clusters import ELEMENTS
from nuno.topology.soft_topology import SoftTopology, edge_matrices, moduli, shape_gradients

if TYPE_CHECKING:
    from nuno.materials import Soft
    from nuno.solvers.shape_tables import ShapeTables

COLLAPSED = 1e-3
"""Width of a body, in cells, below which it is a line or a point, from where no force of its own leads back."""
MAX_REPLY, MAX_BETWEEN = 0.7, 4
"""Viscosity works on every so many substeps (at most 4) that an element's reply to its own viscosity stays below 0.7 on
average; smooth motions are then damped at 0.85 to 0.95 of the stated rate, and at 0.95 to 0.99 at half the reply."""
STRETCHED = 2.0
"""Factor by which an edge is taken to be longer than at rest at most, where it is asked what may touch it."""
ALONE = 2200.0
"""Particles for which a block takes as long as a group's blocks wait for each other (an H200; 1,331 to 35,937)."""
SLOWER = 1.2
"""A block group is taken where it should be quicker by so much: many are slowed by memory, which that does not know of.
"""
DIGITS = 22
"""Binary digits in which rest shapes that count as one agree: float32 has 24."""
LOOSENING = 0.1
"""Displacement, in cells, by which a body that is a line or a point is shaken."""


class SoftSolver(ParticleSolver):
    """A soft body's state and how it advances: neo-Hookean tetrahedra (see `nuno.constraints.tetrahedron`).

    Args:
        topology: The body's elements.
        material: A `nuno.materials.Soft`, whose elements are the tetrahedra.
        positions: (worlds, n, 3) float [m].
        velocities: (worlds, n, 3) float [m/s]; None leaves all at zero until ``load_state``.
        device: "cpu" or "cuda:0" ...
        gravity: (3,) [m/s2].
        frame_rate: Frames a second.
        substeps: Substeps a frame; None takes `soft_substeps`.
        friction: Friction coefficient of the body; None takes the material's. A number or one per world.
        self_contact: Without effect here: its coupling (`nuno.solvers.coupling`) solves contact with itself.
        plan: "auto", "fused" (a thread per world or sixteen worlds, or a block per world), "vector" (one world on
            the CPU by sixteen elements at a time) or "grid" (all blocks of a CUDA device together), all with the same
            bits on a device.

    A vertex touches shapes where it is, without a thickness, and so do the surface's edges and triangles sharp ones.
    Inner vertices are tested too: in a cube of ten cells a side that is 2 % of a substep.

    Limitations: one pass a substep, so that what is stiffer than the substeps carry comes out softer than stated;
    without a coupling a soft body does not touch itself; linear tetrahedra are too stiff in bending, and near a
    Poisson ratio of 0.5, where an inverted body may stay inverted.
    """

    def __init__(
        self,
        topology: SoftTopology,
        material: Soft,
        positions: np.ndarray,
        velocities: np.ndarray | None,
        *,
        device: str = "cpu",
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        frame_rate: float = 60.0,
        substeps: int | None = None,
        friction: float | np.ndarray | None = None,
        self_contact: bool = False,
        plan: str = "auto",
    ) -> None:
        self._prepare(positions, device, gravity, frame_rate, lanes=plan != "grid")
        self.topology, self.cell_size = topology, topology.cell_size
        self._launches = RecordedLaunches(self.device, 1)
        values = material.resolved(self.world_count, topology.element_count)
        self._speed = wave_speed(values)
        self.substeps = int(substeps) if substeps else soft_substeps(topology, 1.0 / frame_rate, self._speed)
        share = modulus_share(topology, values, 1.0 / (frame_rate * self.substeps))
        wanted = wanted_substeps(topology, 1.0 / frame_rate, self._speed)
        capped = not substeps and wanted > self.substeps
        self.resolution = Resolution(self.substeps, bool(substeps), wanted, capped, 1, share, share, share)
        self.self_contact = self_contact
        self.shared_memory = True
        self.plan = self._choose_plan(plan)
        self._grid: GridPlan | None = None
        self._simd: SimdClusters | None = None
        self._build(values, friction)
        self._start(positions, velocities)

    def settings(self, time: float, dt: float, frame: int) -> Settings:
        """The run's settings; ``damped`` is every how many substeps viscosity works, 0 for never."""
        run = super().settings(time, dt, frame)
        run.cell = self._side
        if self._damped:
            often = max(1, min(MAX_BETWEEN, int(MAX_REPLY / (self._reply * dt))))
            run.damped = max(k for k in range(1, often + 1) if frame % k == 0)
        return run

    def set_state(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Set positions [m] and velocities [m/s], (worlds, n, 3) each.

        A world whose vertices are all on a line or at a point is shaken a little, always alike.
        """
        super().set_state(loosened(np.asarray(positions, dtype=np.float64), self.cell_size), velocities)

    def set_colliders(self, colliders: ShapeTables | None) -> None:
        """The static shapes that the body meets; None for none."""
        super().set_colliders(colliders)
        # a little more than what kernels take for sharp, of which none may be left undone
        self._has_features = colliders is not None and colliders.min_radius < 1.001 * ROUND * self._side

    def _build(self, values: dict[str, np.ndarray], friction: float | np.ndarray | None) -> None:
        topology, worlds = self.topology, self.world_count
        state = SoftLanes() if self.lanes > 1 else SoftFloat()
        size = SoftSizes()
        self.state, self._size = state, size
        self.doubles = DoublePositions(self, SoftDoubleLanes if self.lanes > 1 else SoftDouble)
        mu, bulk = moduli(values)
        size.modulus = mu.shape[1]
        state.mu, state.bulk = (self._put(np.broadcast_to(m, (worlds, size.modulus))) for m in (mu, bulk))
        self.device_topology = self._upload(shared=size.modulus == 1)
        self._surface, self._far_surface = Sides(), FarSides()
        for surface in (self._surface, self._far_surface):
            put_sides(surface, topology, self.device, STRETCHED)
        # of a cube whose face's diagonal is the longest edge
        self._side = self._surface.longest / (STRETCHED * np.sqrt(2.0))
        density = values["density"]
        self._set_masses(topology.masses(density[:1] if (density == density[:1]).all() else density))
        own = values["friction"] if friction is None else np.asarray(friction, float).reshape(-1, 1)
        self.scalars = np.zeros((worlds, SCALARS), dtype=np.float32)
        for column, value in enumerate((values["air_drag"], own, values["damping"], np.zeros((1, 1)))):
            self.scalars[:, column] = value[:, 0]
        self._damped = bool(np.any(values["damping"] > 0))
        self._reply = viscous_reply(topology, 2.0 * mu * values["damping"], self._inverse_mass)
        self._allocate_particles()
        for name in SHIFTS:
            setattr(state, name, self._empty(self._whole, self._number)[: self.group_count * self.particle_count])
        size.moved = min(4 * topology.vertex_count, QUEUE + ROOM)
        state.reached, state.moved = self._empty(1, int), self._empty(size.moved, int)

    def _upload(self, shared: bool) -> Tetrahedra:
        """The clusters on the device, sorted by colour; ``shared`` where all elements have the same moduli."""
        topology, made = self.topology, Tetrahedra()
        clusters = topology.clusters

        def put(values: np.ndarray, dtype: Any) -> wp.array:
            kind = np.float32 if dtype in (float, wp.vec4) else np.int32
            return wp.array(np.ascontiguousarray(values, dtype=kind), dtype=dtype, device=self.device)

        made.particles, made.rows = self.particle_count, len(clusters.elements)
        made.speed, made.height, made.differ = self._speed, topology.cell_size, int(not shared)
        made.inner, made.outer = put(clusters.vertices[:, :4], wp.vec4i), put(clusters.vertices[:, 4:], wp.vec4i)
        kinds, kind = rest_shapes(topology)
        outer = (clusters.elements >= 0).sum(axis=1) - 1
        made.number = put(kinds.reshape(-1, 4), wp.vec4)
        made.shape = put(np.column_stack([kind * ELEMENTS, outer]), wp.vec2i)
        made.modulus = put(np.zeros(1) if shared else np.maximum(clusters.elements, 0).ravel(), int)
        made.colour = put(clusters.offsets, int)
        return made

    def _pack_clusters(self) -> SimdClusters:
        """The clusters by groups of sixteen; a group that would be short repeats its last cluster."""
        narrow, simd = self.device_topology, SimdClusters()
        rows, starts = [], [0]
        for first, last in pairwise(self.topology.clusters.offsets.tolist()):
            count = -(-(last - first) // LANES)
            rows.append(np.minimum(first + np.arange(count * LANES), last - 1).reshape(count, LANES))
            starts.append(starts[-1] + count)
        table = np.concatenate(rows)

        def put(values: np.ndarray, dtype: Any) -> wp.array:
            """(rows, 16, k) as (rows * k) vectors."""
            values = np.ascontiguousarray(values.reshape(len(table), LANES, -1).transpose(0, 2, 1))
            return wp.array(values.reshape(-1, LANES), dtype=dtype, device="cpu")

        simd.particles, simd.rows, simd.differ = narrow.particles, len(table), narrow.differ
        simd.speed, simd.height = narrow.speed, narrow.height
        simd.inner, simd.outer = (put(a.numpy()[table], lane_int) for a in (narrow.inner, narrow.outer))
        # an element that only others of the group have is one of zeros, which does nothing
        first, outer = narrow.shape.numpy()[table].transpose(2, 0, 1)
        simd.count = wp.array(outer.max(axis=1), dtype=int, device="cpu")
        shapes = narrow.number.numpy().reshape(-1, ELEMENTS, COLUMNS)
        simd.number = put(shapes[first // ELEMENTS], lane)
        modulus = (
            narrow.modulus.numpy().reshape(-1, ELEMENTS) if narrow.differ else np.zeros((narrow.rows, ELEMENTS), int)
        )
        simd.modulus = put(modulus[table].astype(np.int32), lane_int)
        simd.colour = wp.array(np.array(starts, np.int32), dtype=int, device="cpu")
        simd.scalars = wp.zeros(SCALARS, dtype=lane, device="cpu")
        simd.notes = wp.zeros(NOTES, dtype=lane, device="cpu")
        return simd

    def _advance(self, run: Settings, substeps: int) -> None:
        doubles = self.doubles.bring(run)
        if self.plan == "grid":
            if self._grid is None:
                self._grid = self._grid_plan()
            self._grid.run(run, substeps, doubles)
        else:
            self._launch_worlds(run, substeps, doubles)

    def _launch_worlds(self, run: Settings, substeps: int, doubles: Any) -> None:
        """As all plans but "grid" do it: worlds by themselves, or sixteen at once on the CPU."""
        states = [self.state] if doubles is None else [doubles, self.state]
        if self._cuda:
            name, threads = self._block_kernel(doubles is not None)
            after = [self._size, run, self.shapes, substeps, threads]
            launches = [(FAR, self._far_surface)] if substeps > 1 or not self._has_features else []
            launches += [(FEATURES, self._surface)] if self._has_features else []
            for kernels, surface in launches:
                inputs = [*states, self.device_topology, surface, *after]
                wp.launch(
                    kernels[name], dim=self.group_count * threads, inputs=inputs, device=self.device, block_dim=threads
                )
        elif self.plan == "vector":
            if self._simd is None:
                self._simd = self._pack_clusters()
            inputs = [*states, self.device_topology, self._simd, self._surface, self._size, run, self.shapes, substeps]
            kernel = run_soft_simd if doubles is None else run_soft_double_simd
            self._launches.launch(kernel, 1, inputs)
        else:
            lanes, worlds = (run_soft_lanes, run_soft_double_lanes), (run_soft_worlds, run_soft_double_worlds)
            kernel = (lanes if self.lanes > 1 else worlds)[doubles is not None]
            before = [*states, self.device_topology, self._surface, self._size]
            launch_groups(self._launches, kernel, before, self.shapes, self.group_count, run, substeps)

    def _block_groups(self) -> tuple[int, int]:
        """Return how many worlds block groups go through at once, and the blocks of each."""
        return block_groups_of(self.world_count, cores_of(self.device), self.particle_count / ALONE)

    def _block_group_pays(self) -> bool:
        """Return True if worlds by block groups of multiprocessors are quicker than by one each."""
        block_groups, blocks = self._block_groups()
        alone = self.particle_count / ALONE
        by_block_groups = -(-self.world_count // block_groups) * (1.0 + alone / blocks)
        return SLOWER * by_block_groups < -(-self.world_count // cores_of(self.device)) * alone

    def _grid_plan(self) -> GridPlan:
        block_groups, blocks = self._block_groups()
        shared = wp.zeros(SHARED_FIGURES * self.world_count, dtype=float, device=self.device)
        before, after = (self.device_topology, self._surface, self._size), (self.shapes, shared)
        kernels = run_soft_grid, run_soft_double_grid
        return GridPlan(
            kernels, self.state, before, lambda _: after, self.device, self.world_count, block_groups, blocks,
            SOFT_THREADS, self._launch_worlds,
        )  # fmt: skip

    def _forget_launches(self) -> None:
        self._grid = None

    def _block_kernel(self, doubles: bool) -> tuple[str, int]:
        """The kernel that has as much of a world in shared memory and registers as fits, and its threads."""
        if doubles:
            fits = self.shared_memory and self.particle_count <= DOUBLE_PARTICLES
            return "double_blocks_partly" if fits else "double_blocks", FEW_THREADS
        if not self.shared_memory or self.particle_count > SHARED_PARTICLES:
            return "blocks", FEW_THREADS
        few = self.group_count <= cores_of(self.device)
        if self.particle_count > ROOMY_PARTICLES:
            return "few_partly" if few else "blocks_partly", FEW_THREADS
        return ("few_shared", FEW_THREADS) if few else ("blocks_shared", MANY_THREADS)


def rest_shapes(topology: SoftTopology) -> tuple[np.ndarray, np.ndarray]:
    """Return the rest shapes of clusters (k, 5, 8), `COLUMNS` of each element, and of which a cluster is, (s,).

    The voxels of a lattice have the same numbers, which are then always near at hand. Those are alike that differ by
    less than what float32 can tell.
    """
    clusters = topology.clusters
    there = clusters.elements >= 0
    element = clusters.elements[there]
    inverse = np.linalg.inv(edge_matrices(topology.rest, clusters.corners[there]))
    volume = topology.volume[element]
    products = (inverse @ inverse.transpose(0, 2, 1) * volume[:, None, None]).reshape(-1, 9)[:, [0, 4, 8, 1, 2, 5]]
    numbers = np.zeros((*there.shape, COLUMNS))
    numbers[there] = np.column_stack([products, 1.0 / (6.0 * volume), topology.fraction[element]])
    numbers[topology.voxels, 0, -1] *= -1.0  # a voxel with a mean
    # products have the size of the largest of a cluster, the rest their own
    size = np.abs(numbers)
    size[..., :6] = size[..., :6].max(axis=(1, 2), keepdims=True)
    grain = np.exp2(np.ceil(np.log2(np.maximum(size, 1e-30))) - DIGITS)
    rounded = (np.round(numbers / grain) * grain).reshape(len(numbers), -1)
    _, first, kind = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return numbers[first], kind.reshape(-1)


def viscous_reply(topology: SoftTopology, viscosity: np.ndarray, inverse_mass: np.ndarray) -> float:
    """Return the mean over the elements of viscosity x volume x sum of w_i |grad N_i|^2 [1/s], of the fastest world.

    Args:
        topology: The body's elements.
        viscosity: (worlds, m or 1) [Pa s].
        inverse_mass: (worlds, n) [1/kg].
    """
    steep = (shape_gradients(topology.inverse) ** 2).sum(axis=2)
    weight = (inverse_mass[:, topology.tets] * steep).sum(axis=2) * topology.volume * topology.fraction
    return float((weight * viscosity).mean(axis=1).max())


def loosened(positions: np.ndarray, cell: float) -> np.ndarray:
    """Return positions (worlds, n, 3) [m], shaken by a tenth of ``cell`` where a world is a line or a point."""
    spread = positions - positions.mean(axis=1, keepdims=True)
    # widths across the line that fits best: root mean squares
    width = np.sqrt(np.maximum(np.linalg.eigvalsh(np.swapaxes(spread, 1, 2) @ spread)[:, :2].sum(axis=1), 0.0))
    flat = width < COLLAPSED * cell * np.sqrt(positions.shape[1])
    if not flat.any():
        return positions
    shake = np.random.default_rng(0).normal(scale=LOOSENING * cell, size=positions.shape[1:])
    return np.where(flat[:, None, None], positions + shake, positions)
