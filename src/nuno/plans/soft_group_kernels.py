"""A soft body's frame by a block group, for `nuno.plans.group_plan.GridPlan`.

The phases are those of `nuno.plans.substep`, with the same bits: what one colour's clusters, or particles, do does not
depend on who does it. Every block keeps the figures that all threads read in shared memory, its own copy.
"""

from typing import Any

import warp as wp

from nuno.numbers.block_group import BlockGroup, all_resident, begin_grid_barrier, block_group_of
from nuno.numbers.crew import barrier
from nuno.numbers.warps import in_warps
from nuno.plans.group_figures import begin_sharing
from nuno.plans.shared_memory import bring_figures, bring_notes, figures
from nuno.plans.substep import advance
from nuno.state.cloth_state import Settings, Shapes
from nuno.state.soft_state import Sides, SoftDouble, SoftFloat, SoftSizes, Tetrahedra, view

THREADS = 256
"""Of a block: clusters take all registers that so many have."""

for _name in ("run_soft_grid", "run_soft_double_grid"):
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def floats_of(t: SoftFloat, rounded: SoftFloat, world: int, n: int, sizes: SoftSizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def floats_of(t: SoftDouble, rounded: SoftFloat, world: int, n: int, sizes: SoftSizes):
    floats = view(rounded, world, n, sizes)
    floats.scalars = t.scalars
    floats.notes = t.notes
    return floats


@wp.func
def run_block_groups(
    s: Any, rounded: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), first: int, substeps: int, block_groups: int, block_group: BlockGroup,
):  # fmt: skip
    """Run a block group through its worlds, from ``first`` on."""
    size = block_group.block_size
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
        crew = begin_sharing(block_group, shared, world)
        advance(t, t, floats, floats, topo, sides, run, shapes, 0, substeps, crew)
        if block_group.rank == 0:
            bring_notes(notes, t.notes)
        barrier(size)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_soft_grid")
def run_soft_grid(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int, blocks: int,
    block_size: int,
):  # fmt: skip
    """A frame, or the beginning of one, of every world by a block group; nothing where not all are there."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(s, s, topo, sides, sizes, run, shapes, shared, first, substeps, block_groups, block_group)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_soft_double_grid")
def run_soft_double_grid(
    s: SoftDouble, rounded: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int, blocks: int,
    block_size: int,
):  # fmt: skip
    """`run_soft_grid` where coordinates are doubles."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, rounded, topo, sides, sizes, run, shapes, shared, first, substeps, block_groups, block_group
        )
