"""A soft body's frame by a block group, for `nuno.plans.group_plan.GridPlan`.

The phases are those of `nuno.plans.soft_substep`, with the same bits: what one colour's clusters, or particles, do does
not hang on who does it. Every block keeps the figures that all threads read in shared memory, its own copy.
"""

from typing import Any

import warp as wp

from nuno.constraints.grips import forget_loads, hold_vertices, pull_points, read_loads
from nuno.constraints.position_shifts import clear_shifts
from nuno.contact.particle.feature_contact import push_features
from nuno.contact.particle.shape_contact import touch_shapes
from nuno.numbers.block_group import BlockGroup, all_resident, begin_grid_barrier, block_group_of, grid_barrier
from nuno.numbers.lanes import barrier
from nuno.numbers.warps import in_warps
from nuno.plans.group_kernels import near_shapes
from nuno.plans.shared_memory import figures
from nuno.plans.soft_prefetch import elastic_ahead, viscous_ahead
from nuno.plans.soft_substep import advance_notes
from nuno.state.cloth_state import NOTES, SPEED, Settings, Shapes
from nuno.state.integrate import predict, read_velocities, reset_speed, round_places, tick
from nuno.state.soft_state import SEEN, Sides, SoftDouble, SoftFloat, SoftSizes, Tetrahedra, view

THREADS = 256
"""Of a block: clusters take all registers that so many have."""
SHARED_NOTES = 4
"""Notes that blocks share of a world: its speed and what is inside out, for two substeps alternately."""

for _name in ("run_soft_grid", "run_soft_double_grid"):
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def share_notes(t: Any, shared_notes: wp.array(dtype=float), own: int, other: int, block_group: BlockGroup):
    """Raise the notes of all blocks to the block's, wait, and take them; those of the substep before have served."""
    barrier(block_group.block_size)
    if block_group.rank_in_block == 0:
        wp.atomic_max(shared_notes, own, t.notes[SPEED])
        wp.atomic_max(shared_notes, own + 1, t.notes[SEEN])
    if block_group.rank == 0:
        shared_notes[other] = 0.0
        shared_notes[other + 1] = 0.0
    grid_barrier(block_group)
    if block_group.rank_in_block == 0:
        t.notes[SPEED] = shared_notes[own]
        t.notes[SEEN] = shared_notes[own + 1]
    barrier(block_group.block_size)


@wp.func
def advance_by_group(
    t: Any, near: Any, topo: Tetrahedra, sides: Sides, run: Settings, shapes: Shapes,
    shared_notes: wp.array(dtype=float),
    world: int, substeps: int, block_group: BlockGroup,
):  # fmt: skip
    """The phases of ``substeps`` substeps, the first of which begins a frame.

    ``near`` is as `nuno.plans.cloth_substep.advance` has it.
    """
    n = topo.particles
    forget_loads(t, run, block_group.rank, block_group.group_size)
    if block_group.rank == 0:
        shared_notes[SHARED_NOTES * world] = 0.0
        shared_notes[SHARED_NOTES * world + 1] = 0.0
    near_shapes(near, sides, run, shapes, block_group)
    for k in range(substeps):
        tick(t, run, block_group.rank_in_block)
        advance_notes(t, block_group.rank_in_block)
        barrier(block_group.block_size)
        if run.damped != 0 and k % wp.max(run.damped, 1) == 0:
            viscous_ahead(t, topo, run, block_group.rank, block_group.group_size, block_group)
        predict(t, n, run, block_group.rank, block_group.group_size)
        grid_barrier(block_group)
        if run.grips > 0:
            hold_vertices(t, run, block_group.rank, block_group.group_size)
            grid_barrier(block_group)
        elastic_ahead(t, topo, run, block_group.rank, block_group.group_size, block_group)
        if run.pulled != 0:
            pull_points(t, run, block_group.rank, block_group.group_size)
            grid_barrier(block_group)
        if t.feature_shapes[0] > 0:
            # few elements in many colours, between which a block waits for itself alone
            if block_group.block == 0:
                push_features(t, sides, run, shapes, block_group.rank_in_block, block_group.block_size)
            grid_barrier(block_group)
        if run.grips > 0:
            read_loads(t, run, block_group.rank, block_group.group_size)
            grid_barrier(block_group)
        touch_shapes(t, n, shapes, run.dt, block_group.rank, block_group.group_size)
        reset_speed(t, block_group.rank_in_block)
        barrier(block_group.block_size)
        clear_shifts(t, n, block_group.rank, block_group.group_size)
        read_velocities(t, n, run, block_group.rank, block_group.group_size)
        round_places(near, t, n, block_group.rank, block_group.group_size)
        share_notes(
            t, shared_notes, SHARED_NOTES * world + 2 * (k % 2), SHARED_NOTES * world + 2 * ((k + 1) % 2), block_group
        )


@wp.func
def near_of(t: SoftFloat, floats: SoftFloat, world: int, n: int, sizes: SoftSizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def near_of(t: SoftDouble, floats: SoftFloat, world: int, n: int, sizes: SoftSizes):
    near = view(floats, world, n, sizes)
    near.scalars = t.scalars
    near.notes = t.notes
    return near


@wp.func
def run_block_groups(
    s: Any, floats: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared_notes: wp.array(dtype=float), first: int, substeps: int, block_groups: int, block_group: BlockGroup,
):  # fmt: skip
    """Run a block group through its worlds, from ``first`` on."""
    size = block_group.block_size
    for world in range(first, s.worlds, block_groups):
        t = view(s, world, topo.particles, sizes)
        notes = t.notes
        if in_warps(size):
            scalars = t.scalars
            t.scalars = figures(0)
            t.notes = figures(8)
            if block_group.rank_in_block == 0:
                for k in range(7):
                    t.scalars[k] = scalars[k]
                for k in range(NOTES):
                    t.notes[k] = notes[k]
        barrier(size)
        near = near_of(t, floats, world, topo.particles, sizes)
        advance_by_group(t, near, topo, sides, run, shapes, shared_notes, world, substeps, block_group)
        if block_group.rank == 0:
            for k in range(NOTES):
                notes[k] = t.notes[k]
        barrier(size)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_soft_grid")
def run_soft_grid(
    s: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared_notes: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int, blocks: int,
    block_size: int,
):  # fmt: skip
    """A frame, or the beginning of one, of every world by a block group; nothing where not all are there."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, s, topo, sides, sizes, run, shapes, shared_notes, first, substeps, block_groups, block_group
        )


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_soft_double_grid")
def run_soft_double_grid(
    s: SoftDouble, floats: SoftFloat, topo: Tetrahedra, sides: Sides, sizes: SoftSizes, run: Settings, shapes: Shapes,
    shared_notes: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int, blocks: int,
    block_size: int,
):  # fmt: skip
    """`run_soft_grid` where coordinates are doubles."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, floats, topo, sides, sizes, run, shapes, shared_notes, first, substeps, block_groups, block_group
        )
