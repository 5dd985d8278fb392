"""A cloth's launches: which kernel runs it, over how many blocks and threads, with which of its arrays."""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.bodies.resolution import Resolution
from nuno.constraints.compliances import Compliances
from nuno.contact.self.group_search import make_lists
from nuno.kernels.module_loads import wait_for_load
from nuno.plans.block_plan import (
    FEW_FRAMES,
    FEW_THREADS,
    FEW_WORLDS,
    MANY_AT_ONCE,
    MANY_FRAMES,
    MANY_THREADS,
    run_blocks,
    run_blocks_many,
    run_blocks_partly,
    run_blocks_shared,
    run_blocks_small,
    run_double_blocks,
    run_double_blocks_partly,
)
from nuno.plans.cloth_worlds import (
    run_double_lanes,
    run_double_simd,
    run_double_worlds,
    run_lanes,
    run_simd,
    run_worlds,
)
from nuno.plans.cpu_groups import launch_groups
from nuno.plans.group_figures import SHARED_FIGURES
from nuno.plans.group_kernels import THREADS, run_double_grid, run_grid
from nuno.plans.group_plan import GridPlan, block_groups_of, cores_of
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.plans.shared_memory import DOUBLE_PARTICLES, SHARED_PARTICLES, SMALL_PARTICLES, WHOLE_PARTICLES
from nuno.plans.simd_elements import pack_topology
from nuno.plans.stage_kernels import divide, make_work
from nuno.solvers.particle_solver import ParticleSolver
from nuno.state.cloth_state import Settings
from nuno.state.double_positions import DOUBLE_RATE
from nuno.topology.cloth_topology import ClothTopology

BLOCK_PARTICLES = 4096
"""Above this a world does not fit a block well and takes a device's blocks together."""
GROUP_PARTICLES = 1024
"""Particles of a smaller world for each block of a block group that takes less time than one block alone (an H200)."""
SHARED_OUT = 7.0
"""Of the plan "grid", see `nuno.plans.group_plan.block_groups_of`; 6,561 vertices on an H200, 1 to 132 blocks; 23 for
16,641."""


class ClothLaunches(ParticleSolver):
    """A body of particles with a cloth's elements, and how its kernels are launched.

    A class under it makes the arrays, and says what the substeps resolve.

    Attributes:
        topology: The cloth's elements.
        resolution: What the substeps make of the material.
        sweeps: Sweeps through shear and stretch in a substep; 0 for one plain pass.
        shared_memory: Whether blocks keep their world in shared memory, as far as it fits.
    """

    topology: ClothTopology
    resolution: Resolution
    sweeps: int
    shared_memory: bool
    _compliances: Compliances
    _launches: RecordedLaunches
    _grid: GridPlan | None
    _left_out: bool  # whether parts of substeps were not done since this was asked last
    _crowded: bool  # whether the device once had no room for block groups
    _simd: Any
    _shares: tuple[int, Any] | None  # of a block group's blocks
    _lists: Any  # a block group's room for listing pairs

    @property
    def _double_rate(self) -> float:
        """Substeps a second [1/s] from which on coordinates are doubles: any, where the rule chose them."""
        return DOUBLE_RATE if self.resolution.given else 0.0

    def _advance(self, run: Settings, substeps: int) -> None:
        doubles = self.doubles.bring(run)
        states = [self.state] if doubles is None else [doubles, self.state]
        if self.plan == "grid":
            if self._grid is None:
                self._grid = self._grid_plan()
            self._grid.run(run, substeps, doubles)
        elif self._cuda:
            self._launch_blocks(run, substeps, doubles)
        elif self.plan == "vector":
            if self._simd is None:
                self._simd = pack_topology(self.topology, self.device_topology)
            inputs = [*states, self.device_topology, self._simd, self._size, run, self.shapes, substeps]
            self._launches.launch(run_simd if doubles is None else run_double_simd, 1, inputs)
        else:
            kernels = (run_lanes, run_double_lanes) if self.lanes > 1 else (run_worlds, run_double_worlds)
            kernel = kernels[doubles is not None]
            before = [*states, self.device_topology, self._size]
            launch_groups(self._launches, kernel, before, self.shapes, self.group_count, run, substeps)

    def _launch_blocks(self, run: Settings, substeps: int, doubles: Any) -> None:
        """Launch a block for each world and each that helps, or as many as there is room for, which take turns."""
        state, blocks = self.state, self.world_count
        kernel = self._block_kernel(doubles is not None)
        states = [state] if doubles is None else [doubles, state]
        cores = cores_of(self.device)
        slices = kernel in (run_blocks_shared, run_blocks_many, run_blocks_small)
        few = kernel is run_blocks_shared if slices else blocks <= cores
        threads = FEW_THREADS if few else MANY_THREADS
        inputs = [*states, self.device_topology, self._size, run, self.shapes, substeps, threads]
        shared, queued = state.spare_blocks > 0 and substeps > 1, False
        if slices:
            room = cores if few else cores * MANY_AT_ONCE
            slice_length = (FEW_FRAMES if few else MANY_FRAMES) * run.frame
            queued = blocks > room and substeps > slice_length
            blocks = room if queued else blocks
            inputs.append(slice_length if queued else substeps)
        if shared or queued:
            state.work_counts.zero_()
        blocks += state.spare_blocks if shared else 0
        wait_for_load(kernel.module, self.device, threads)
        wp.launch(kernel, dim=blocks * threads, inputs=inputs, device=self.device, block_dim=threads)

    def _block_kernel(self, doubles: bool) -> Any:
        """The kernel that has as much of a world in shared memory as fits."""
        n = self.particle_count if self.shared_memory else BLOCK_PARTICLES
        if doubles:
            return run_double_blocks_partly if n <= DOUBLE_PARTICLES else run_double_blocks
        if n <= WHOLE_PARTICLES:
            if self.world_count <= FEW_WORLDS * cores_of(self.device):
                return run_blocks_shared
            return run_blocks_small if n <= SMALL_PARTICLES else run_blocks_many
        return run_blocks_partly if n <= SHARED_PARTICLES else run_blocks

    def _block_group_pays(self) -> bool:
        """Return True if a world fits no block, or a block group is quicker for one beyond a block's memory."""
        if self.particle_count > BLOCK_PARTICLES:
            return True
        share = cores_of(self.device) // self.world_count
        doubles = self.frame_rate * self.substeps >= self._double_rate
        return doubles and DOUBLE_PARTICLES < self.particle_count <= GROUP_PARTICLES * share

    def _forget_launches(self) -> None:
        if self._grid is not None:
            self._left_out |= self._grid.left_out()
        self._grid = None

    def _grid_plan(self) -> GridPlan:
        block_groups, blocks = self.world_count, 1
        if not self._crowded:
            block_groups, blocks = block_groups_of(self.world_count, cores_of(self.device), SHARED_OUT)
        if self._lists is None:
            self._lists = make_lists(self.device_topology, self.world_count, self.device)
        shared = wp.zeros(SHARED_FIGURES * self.world_count, dtype=float, device=self.device)

        def after(blocks: int) -> tuple[Any, ...]:
            return self.shapes, self._work(blocks), self._lists, shared

        return GridPlan(
            (run_grid, run_double_grid), self.state, (self.device_topology, self._size), after, self.device,
            self.world_count, block_groups, blocks, THREADS,
        )  # fmt: skip

    def _work(self, blocks: int) -> Any:
        """The elements in the shares of so many blocks, kept for the next launch."""
        if self._shares is None or self._shares[0] != blocks:
            stages = divide(self.topology, blocks, self.sweeps)
            self._shares = blocks, make_work(self.topology, self._compliances, stages, self.device)
        return self._shares[1]
