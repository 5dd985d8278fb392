"""The CUDA plan for worlds that fit a block: a block per world, its particles in shared memory where they fit.

The counts of the pair lists and the figures that all threads read are always there, for what lies in the device's
memory answers many times later, and threads wait for the answer.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.self.search_queue import close_queue, search_for_others
from nuno.numbers.crew import barrier, crew_of
from nuno.plans.shared_memory import (
    DOUBLE_PARTICLES,
    SHARED_PARTICLES,
    SMALL_PARTICLES,
    WHOLE_PARTICLES,
    bring_figures,
    bring_masses,
    bring_notes,
    bring_places,
    bring_starts,
    column,
    counts,
    double_column,
    figures,
    small_column,
    whole,
)
from nuno.plans.substep import advance
from nuno.plans.world_queue import end_slice, next_slice
from nuno.state.cloth_state import COUNTS, Settings, Shapes, Sizes, StateDouble, StateFloat, Topology, view

BLOCKS_AT_ONCE = 2
"""Blocks of 256 threads that a multiprocessor's registers must have room for; left to itself, the compiler takes all
for one, and nothing runs while that waits."""
MANY_AT_ONCE = 3
"""The same of cloth in many worlds: as many as its shared memory has room for."""
FEW_WORLDS = 1.2
"""Worlds for each multiprocessor up to which they are few: a block of many threads each that takes turns is sooner done
with 1.2 worlds than three blocks of fewer threads beside each other are with one each."""
FEW_FRAMES, MANY_FRAMES = 2, 5
"""Frames that a world's turn takes where they are few and where they are many: so few that blocks end at about the same
time, and so many that to read and write a world costs little beside them."""
FEW_THREADS, MANY_THREADS = 512, 256
"""Threads of a block where every world has a multiprocessor to itself, and where worlds queue up for them: some blocks
then share one, so that other worlds run while one waits. Both do the same, and so the bits are the same."""


@wp.func
def advance_block(
    t: Any, floats: Any, topo: Topology, run: Settings, shapes: Shapes, substeps: int, rank: int, size: int
):
    """`advance` with the counts of the pair lists and the figures in shared memory for as long as the launch takes."""
    device_pairs = t.pair_count
    device_active = t.active_count
    scalars = t.scalars
    notes = t.notes
    t.pair_count = counts(0)
    t.active_count = counts(COUNTS)
    t.scalars = figures(0)
    t.notes = figures(8)
    floats.pair_count = counts(0)
    floats.active_count = counts(COUNTS)
    floats.scalars = figures(0)
    floats.notes = figures(8)
    if rank == 0:
        for k in range(COUNTS):
            t.pair_count[k] = device_pairs[k]
        for k in range(2):
            t.active_count[k] = device_active[k]
    bring_figures(t, scalars, notes, rank)
    barrier(size)
    advance(t, t, floats, floats, topo, topo, run, shapes, 0, substeps, crew_of(rank, size))
    barrier(size)
    if rank == 0:
        for k in range(COUNTS):
            device_pairs[k] = t.pair_count[k]
        for k in range(2):
            device_active[k] = t.active_count[k]
        bring_notes(notes, t.notes)
        if t.spare_blocks > 0:
            close_queue(t.work_counts)


# A module each, so that only the kind that is run is compiled. Quotients and roots as the processor has them, which
# may be off by two in the last place: a tenth of the time, and the same bits for the same input all the same.
for _name in (
    "run_blocks", "run_blocks_partly", "run_blocks_shared", "run_blocks_many", "run_blocks_small",
    "run_double_blocks", "run_double_blocks_partly",
):  # fmt: skip
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True


@wp.func
def advance_blocks(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int, rank: int,
    size: int,
):  # fmt: skip
    """Every world by a block of ``size`` threads."""
    t = view(s, block, topo.particles, sizes)
    advance_block(t, t, topo, run, shapes, substeps, rank, size)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.plans.run_blocks")
def run_blocks(s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, size: int):
    """Every world by a block of ``size`` threads."""
    tid = wp.tid()
    if tid / size < s.worlds:
        advance_blocks(s, topo, sizes, run, shapes, substeps, tid / size, tid % size, size)
    else:
        search_for_others(s, topo, sizes, run, tid / size - s.worlds, tid % size, size)


@wp.func
def advance_blocks_partly(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int, rank: int,
    size: int,
):  # fmt: skip
    """The same with x, y, z and w in shared memory for as long as the launch takes."""
    n = topo.particles
    t = view(s, block, n, sizes)
    outside = view(s, block, n, sizes)
    t.x = column(0)
    t.y = column(SHARED_PARTICLES)
    t.z = column(2 * SHARED_PARTICLES)
    t.w = column(3 * SHARED_PARTICLES)
    bring_places(t, outside, n, rank, size)
    bring_masses(t, outside, n, rank, size)
    advance_block(t, t, topo, run, shapes, substeps, rank, size)
    bring_places(outside, t, n, rank, size)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.plans.run_blocks_partly")
def run_blocks_partly(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, size: int
):
    """The same with x, y, z and w in shared memory for as long as the launch takes."""
    tid = wp.tid()
    if tid / size < s.worlds:
        advance_blocks_partly(s, topo, sizes, run, shapes, substeps, tid / size, tid % size, size)
    else:
        search_for_others(s, topo, sizes, run, tid / size - s.worlds, tid % size, size)


def _queue(own: Any, room: int) -> Any:
    """Return `advance_from_queue` for worlds of at most ``room`` particles, in the shared memory ``own``."""

    @wp.func(name=f"advance_blocks_of_{room}")
    def advance_blocks_shared(
        s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int,
        rank: int, size: int,
    ):  # fmt: skip
        """The same with x, y, z, w and p in shared memory, and what contacts move particles by."""
        n = topo.particles
        t = view(s, block, n, sizes)
        outside = view(s, block, n, sizes)
        t.x = own(0)
        t.y = own(room)
        t.z = own(2 * room)
        t.w = own(3 * room)
        t.px = own(4 * room)
        t.py = own(5 * room)
        t.pz = own(6 * room)
        t.moved = whole(own(7 * room))
        bring_places(t, outside, n, rank, size)
        bring_masses(t, outside, n, rank, size)
        bring_starts(t, outside, n, rank, size)
        for i in range(rank, 4 * n, size):
            t.moved[i] = 0
        advance_block(t, t, topo, run, shapes, substeps, rank, size)
        bring_places(outside, t, n, rank, size)
        bring_starts(outside, t, n, rank, size)

    @wp.func(name=f"advance_from_queue_of_{room}")
    def advance_from_queue(
        s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int, slice_length: int,
        block: int, rank: int, size: int,
    ):  # fmt: skip
        """Take ``slice_length`` substeps at a time, whole frames, of the world that is next; or all of one world."""
        slices = s.worlds * ((substeps + slice_length - 1) / slice_length)
        k = int(block)
        if slice_length < substeps:
            k = next_slice(s.work_counts, s.worlds, slices)
        while k < slices:
            world = k % s.worlds
            left = substeps - k / s.worlds * slice_length
            advance_blocks_shared(s, topo, sizes, run, shapes, wp.min(slice_length, left), world, rank, size)
            if slice_length < substeps:
                end_slice(s.work_counts, world)
                k = next_slice(s.work_counts, s.worlds, slices)
            else:
                k = slices

    return advance_from_queue


advance_whole, advance_small = _queue(column, int(WHOLE_PARTICLES)), _queue(small_column, int(SMALL_PARTICLES))


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.plans.run_blocks_shared")
def run_blocks_shared(
    s: StateFloat,
    topo: Topology,
    sizes: Sizes,
    run: Settings,
    shapes: Shapes,
    substeps: int,
    size: int,
    slice_length: int,
):
    """The same with x, y, z, w and p in shared memory, and what contacts move particles by."""
    tid = wp.tid()
    if tid / size < s.worlds:
        advance_whole(s, topo, sizes, run, shapes, substeps, slice_length, tid / size, tid % size, size)
    else:
        search_for_others(s, topo, sizes, run, tid / size - s.worlds, tid % size, size)


@wp.kernel(enable_backward=False, launch_bounds=(MANY_THREADS, MANY_AT_ONCE), module="nuno.plans.run_blocks_many")
def run_blocks_many(
    s: StateFloat,
    topo: Topology,
    sizes: Sizes,
    run: Settings,
    shapes: Shapes,
    substeps: int,
    size: int,
    slice_length: int,
):
    """The same where worlds queue up: with fewer registers a thread, so that more blocks share a multiprocessor."""
    tid = wp.tid()
    advance_whole(s, topo, sizes, run, shapes, substeps, slice_length, tid / size, tid % size, size)


@wp.kernel(enable_backward=False, launch_bounds=(MANY_THREADS, MANY_AT_ONCE), module="nuno.plans.run_blocks_small")
def run_blocks_small(
    s: StateFloat,
    topo: Topology,
    sizes: Sizes,
    run: Settings,
    shapes: Shapes,
    substeps: int,
    size: int,
    slice_length: int,
):
    """The same of small cloths, which leave more of a multiprocessor's memory to its cache."""
    tid = wp.tid()
    advance_small(s, topo, sizes, run, shapes, substeps, slice_length, tid / size, tid % size, size)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.plans.run_double_blocks")
def run_double_blocks(
    s: StateDouble, rounded: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int,
    size: int,
):  # fmt: skip
    """Every world by a block of ``size`` threads, coordinates as doubles."""
    tid = wp.tid()
    if tid / size < s.worlds:
        block = tid / size
        t = view(s, block, topo.particles, sizes)
        floats = view(rounded, block, topo.particles, sizes)
        advance_block(t, floats, topo, run, shapes, substeps, tid % size, size)
    else:
        search_for_others(rounded, topo, sizes, run, tid / size - s.worlds, tid % size, size)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.plans.run_double_blocks_partly")
def run_double_blocks_partly(
    s: StateDouble, rounded: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, substeps: int,
    size: int,
):  # fmt: skip
    """The same with x, y and z in shared memory for as long as the launch takes."""
    tid = wp.tid()
    if tid / size < s.worlds:
        block = tid / size
        rank = tid % size
        n = topo.particles
        t = view(s, block, n, sizes)
        outside = view(s, block, n, sizes)
        floats = view(rounded, block, n, sizes)
        t.x = double_column(0)
        t.y = double_column(DOUBLE_PARTICLES)
        t.z = double_column(2 * DOUBLE_PARTICLES)
        bring_places(t, outside, n, rank, size)
        advance_block(t, floats, topo, run, shapes, substeps, rank, size)
        bring_places(outside, t, n, rank, size)
    else:
        search_for_others(rounded, topo, sizes, run, tid / size - s.worlds, tid % size, size)
