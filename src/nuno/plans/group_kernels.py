"""A cloth's frame by a block group, for `nuno.plans.group_plan.GridPlan`.

The phases are those of `nuno.plans.substep`, so that colours come in the same order and give the same bits; blocks wait
for each other inside of the launch. Every block keeps the figures that all threads read in shared memory, its own copy.
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

THREADS = 512
"""Threads of a block."""

for _name in ("run_grid", "run_double_grid"):
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def floats_of(t: StateFloat, rounded: StateFloat, world: int, n: int, sizes: Sizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def floats_of(t: StateDouble, rounded: StateFloat, world: int, n: int, sizes: Sizes):
    floats = view(rounded, world, n, sizes)
    floats.scalars = t.scalars
    floats.notes = t.notes
    return floats


@wp.func
def run_block_groups(
    s: Any, rounded: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    shared: wp.array(dtype=float), first: int, substeps: int, block_groups: int, block_group: BlockGroup,
):  # fmt: skip
    """Run a block group through its worlds, from ``first`` on."""
    size = block_group.block_size
    shares = BlockShare()
    shares.particles = topo.particles
    shares.work = work
    shares.lists = lists
    shares.first = topo.particles * block_group.block / block_group.blocks
    shares.last = topo.particles * (block_group.block + 1) / block_group.blocks
    shares.steps = steps_of(work, block_group.block)
    if in_warps(size) and work.steps <= MAX_STEPS:
        shares.steps = program(0)
        stored = steps_of(work, block_group.block)
        for k in range(block_group.rank_in_block, 4 * work.steps, size):
            shares.steps[k] = stored[k]
    for world in range(first, s.worlds, block_groups):
        t = view(s, world, topo.particles, sizes)
        scalars = t.scalars
        notes = t.notes
        if in_warps(size):
            t.scalars = figures(0)
            t.notes = figures(8)
            bring_figures(t, scalars, notes, block_group.rank_in_block)
        barrier(size)
        floats = floats_of(t, rounded, world, topo.particles, sizes)
        shares.world = world
        # the first step is that of the particles
        shares.held_first = grips_on(t, run, shares.steps[2], shares.steps[3])
        shares.held = grips_on(t, run, shares.first, shares.last)
        crew = begin_sharing(block_group, shared, world)
        advance(t, t, floats, floats, shares, topo, run, shapes, 0, substeps, crew)
        if block_group.rank == 0:
            bring_notes(notes, t.notes)
        barrier(size)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_grid")
def run_grid(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int,
    block_size: int,
):  # fmt: skip
    """A frame, or some of one, of every world by a block group; nothing where not all are there."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, s, topo, sizes, run, shapes, work, lists, shared, first, substeps, block_groups, block_group
        )


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_double_grid")
def run_double_grid(
    s: StateDouble, rounded: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work,
    lists: Lists, shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int,
    blocks: int, block_size: int,
):  # fmt: skip
    """`run_grid` where coordinates are doubles."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, rounded, topo, sizes, run, shapes, work, lists, shared, first, substeps, block_groups, block_group
        )
