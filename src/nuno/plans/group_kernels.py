"""A cloth's or soft body's frame by a block group, for `nuno.plans.group_plan.GridPlan`.

The phases are those of `nuno.plans.substep`, so that colours come in the same order and give the same bits: what one
colour's elements, or particles, do does not depend on who does it. Blocks wait for each other inside of the launch.
Every block keeps the figures that all threads read in shared memory, its own copy.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.self.group_search import Lists
from nuno.numbers.block_group import BlockGroup, all_resident, begin_grid_barrier, block_group_of
from nuno.numbers.crew import barrier
from nuno.numbers.warps import in_warps
from nuno.plans.group_figures import begin_sharing
from nuno.plans.shared_memory import MAX_STEPS, bring_figures, bring_notes, figures, program
from nuno.plans.stage_kernels import BlockShare, Work, grips_on, steps_of
from nuno.plans.substep import advance
from nuno.state.cloth_state import Settings, Shapes, Sizes, StateDouble, StateFloat, Topology, view
from nuno.state.soft_state import Sides, SoftDouble, SoftFloat, SoftSizes, Tetrahedra
from nuno.state.soft_state import view as soft_view

THREADS = 512
"""Threads of a block for a cloth."""
SOFT_THREADS = 256
"""Of one for a soft body: clusters take all registers that so many have."""

for _name in ("run_grid", "run_double_grid", "run_soft_grid", "run_soft_double_grid"):
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def view_of(s: Any, world: int, n: int, sizes: Sizes):
    """The part of the state that belongs to one world."""
    return view(s, world, n, sizes)


@wp.func
def view_of(s: Any, world: int, n: int, sizes: SoftSizes):
    return soft_view(s, world, n, sizes)


@wp.func
def with_figures(rounded: Any, t: Any):
    """A world's state with coordinates as floats, and the figures of ``t``."""
    floats = rounded
    floats.scalars = t.scalars
    floats.notes = t.notes
    return floats


@wp.func
def floats_of(t: StateFloat, rounded: StateFloat, world: int, n: int, sizes: Sizes):
    """A world's state with coordinates as floats: itself where they are, else of ``rounded``, with the same figures."""
    return t


@wp.func
def floats_of(t: SoftFloat, rounded: SoftFloat, world: int, n: int, sizes: SoftSizes):
    return t


@wp.func
def floats_of(t: StateDouble, rounded: StateFloat, world: int, n: int, sizes: Sizes):
    return with_figures(view(rounded, world, n, sizes), t)


@wp.func
def floats_of(t: SoftDouble, rounded: SoftFloat, world: int, n: int, sizes: SoftSizes):
    return with_figures(soft_view(rounded, world, n, sizes), t)


@wp.func
def cloth_share(topo: Topology, work: Work, lists: Lists):
    """A cloth's elements, still without a block's share of them."""
    share = BlockShare()
    share.particles = topo.particles
    share.work = work
    share.lists = lists
    return share


@wp.func
def share_of_block(table: BlockShare, block_group: BlockGroup):
    """The elements with a block's share of them; those of a soft body are not shared out beforehand."""
    share = table
    size = block_group.block_size
    share.first = table.particles * block_group.block / block_group.blocks
    share.last = table.particles * (block_group.block + 1) / block_group.blocks
    share.steps = steps_of(table.work, block_group.block)
    if in_warps(size) and table.work.steps <= MAX_STEPS:
        share.steps = program(0)
        stored = steps_of(table.work, block_group.block)
        for k in range(block_group.rank_in_block, 4 * table.work.steps, size):
            share.steps[k] = stored[k]
    return share


@wp.func
def share_of_block(table: Tetrahedra, block_group: BlockGroup):
    return table


@wp.func
def share_of_world(table: BlockShare, t: Any, run: Settings, world: int):
    """The elements with what a block's share has of a world."""
    share = table
    share.world = world
    # the first step is that of the particles
    share.held_first = grips_on(t, run, table.steps[2], table.steps[3])
    share.held = grips_on(t, run, table.first, table.last)
    return share


@wp.func
def share_of_world(table: Tetrahedra, t: Any, run: Settings, world: int):
    return table


@wp.func
def run_block_groups(
    s: Any, rounded: Any, table: Any, surface: Any, sizes: Any, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int, size: int, thread: int,
):  # fmt: skip
    """Run a thread's block group through its worlds; nothing where not all blocks are there."""
    first, block_group = block_group_of(thread, barrier_counts, call, block_groups, blocks, size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        block_share = share_of_block(table, block_group)
        for world in range(first, s.worlds, block_groups):
            t = view_of(s, world, table.particles, sizes)
            scalars = t.scalars
            notes = t.notes
            if in_warps(size):
                t.scalars = figures(0)
                t.notes = figures(8)
                bring_figures(t, scalars, notes, block_group.rank_in_block)
            barrier(size)
            floats = floats_of(t, rounded, world, table.particles, sizes)
            share = share_of_world(block_share, t, run, world)
            crew = begin_sharing(block_group, shared, world)
            advance(t, t, floats, floats, share, surface, run, shapes, 0, substeps, crew)
            if block_group.rank == 0:
                bring_notes(notes, t.notes)
            barrier(size)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_grid")
def run_grid(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int, size: int,
):  # fmt: skip
    """A frame, or some of one, of every cloth by a block group; nothing where not all blocks are there."""
    run_block_groups(
        s, s, cloth_share(topo, work, lists), topo, sizes, run, shapes, shared, barrier_counts, call, substeps,
        block_groups, blocks, size, wp.tid(),
    )  # fmt: skip


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_double_grid")
def run_double_grid(
    s: StateDouble, rounded: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work,
    lists: Lists, shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int, blocks: int, size: int,
):  # fmt: skip
    """`run_grid` where coordinates are doubles."""
    run_block_groups(
        s, rounded, cloth_share(topo, work, lists), topo, sizes, run, shapes, shared, barrier_counts, call, substeps,
        block_groups, blocks, size, wp.tid(),
    )  # fmt: skip


@wp.kernel(enable_backward=False, launch_bounds=(SOFT_THREADS, 1), module="nuno.plans.run_soft_grid")
def run_soft_grid(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int, size: int,
):  # fmt: skip
    """`run_grid` of soft bodies."""
    run_block_groups(
        s, s, topo, sides, sizes, run, shapes, shared, barrier_counts, call, substeps, block_groups, blocks, size,
        wp.tid(),
    )  # fmt: skip


@wp.kernel(enable_backward=False, launch_bounds=(SOFT_THREADS, 1), module="nuno.plans.run_soft_double_grid")
def run_soft_double_grid(
    s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int, size: int,
):  # fmt: skip
    """`run_soft_grid` where coordinates are doubles."""
    run_block_groups(
        s, rounded, topo, sides, sizes, run, shapes, shared, barrier_counts, call, substeps, block_groups, blocks, size,
        wp.tid(),
    )  # fmt: skip
