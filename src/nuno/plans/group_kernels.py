"""A cloth's frame by a block group, for `nuno.plans.group_plan.GridPlan`.

The phases are those of `nuno.plans.cloth_substep`, so that colours come in the same order and give the same bits;
blocks wait for each other inside of the launch. Every block keeps the figures that all threads read in shared memory,
its own copy.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.constraints.damping import damp_bends
from nuno.constraints.grips import forget_loads, pull_points, read_loads
from nuno.contact.particle.feature_contact import push_features
from nuno.contact.particle.feature_lists import clear_features, list_features, mark_features
from nuno.contact.particle.shape_contact import measure_box, reset_box, select_shapes, sort_shapes
from nuno.contact.self.group_search import Lists, rebuild_by_group
from nuno.contact.self.self_contact import take_moves, touch_edge_edge, touch_vertex_triangle
from nuno.numbers.block_group import BlockGroup, all_resident, begin_grid_barrier, block_group_of, grid_barrier
from nuno.numbers.lanes import barrier
from nuno.numbers.warps import in_warps
from nuno.plans.cloth_substep import meet_shapes
from nuno.plans.shared_memory import MOST_STEPS, figures, program
from nuno.plans.stage_kernels import Work, go_through, grips_on, steps_of
from nuno.state.cloth_state import (
    COMPLIANT_GRIPS,
    MOTION,
    NOTES,
    SELF_CONTACT,
    SHAPES,
    SPEED,
    VELOCITIES,
    Settings,
    Shapes,
    Sizes,
    StateDouble,
    StateFloat,
    Topology,
    view,
)
from nuno.state.integrate import read_velocities, reset_speed, round_places, tick

THREADS = 512
"""Threads of a block."""

for _name in ("run_grid", "run_double_grid"):
    wp.get_module(f"nuno.plans.{_name}").options["fast_math"] = True  # as in the plans for a block


@wp.func
def near_shapes(t: Any, topo: Any, run: Settings, shapes: Shapes, block_group: BlockGroup):
    """Choose the shapes that matter for the next frame, and what sharp ones may touch between vertices."""
    n = topo.particles
    reset_box(t, block_group.rank)
    clear_features(t, topo, block_group.rank)
    grid_barrier(block_group)
    measure_box(t, n, block_group.rank, block_group.group_size)
    grid_barrier(block_group)
    select_shapes(t, shapes, float(run.frame) * run.dt, block_group.rank, block_group.group_size)
    grid_barrier(block_group)
    sort_shapes(t, block_group.rank)
    grid_barrier(block_group)
    mark_features(t, topo, run, shapes, block_group.rank, block_group.group_size)
    grid_barrier(block_group)
    list_features(t, topo, block_group.rank, block_group.group_size)
    grid_barrier(block_group)


@wp.func
def share_speed(t: Any, speeds: wp.array(dtype=float), own: int, other: int, block_group: BlockGroup):
    """Raise a speed of all blocks to the block's, wait, and take it; the one of the substep before has served."""
    barrier(block_group.block_size)
    if block_group.rank_in_block == 0:
        wp.atomic_max(speeds, own, t.notes[SPEED])
    if block_group.rank == 0:
        speeds[other] = 0.0
    grid_barrier(block_group)
    if block_group.rank_in_block == 0:
        t.notes[SPEED] = speeds[own]
    barrier(block_group.block_size)


@wp.func
def come_to_rest(
    t: Any, near: Any, n: int, run: Settings, shapes: Shapes, grips: int, first: int, last: int, rank: int,
    size: int,
):  # fmt: skip
    """End a substep of the particles first to last: sums of contact, stiff grips, shapes, velocities.

    ``grips`` is none where no stiff grip is on one of these; ``near`` is as `nuno.plans.cloth_substep.advance` has it.
    """
    if run.parts & SELF_CONTACT != 0 and run.touching != 0:
        for i in range(first + rank, last, size):
            take_moves(t, n, i, n)
    if run.parts & SHAPES != 0:
        if grips > 0:
            barrier(size)
            for g in range(rank, grips, size):
                i = t.grip_corner[3 * g]
                if i >= first and i < last:
                    read_loads(t, run, g, grips)
            barrier(size)
        meet_shapes(t, last, shapes, run.dt, first + rank, size)
    if run.parts & VELOCITIES != 0:
        read_velocities(t, last, run, first + rank, size)
        round_places(near, t, last, first + rank, size)


@wp.func
def advance_by_group(
    t: Any, near: Any, topo: Topology, work: Work, steps: wp.array(dtype=int), run: Settings, shapes: Shapes,
    lists: Lists, speeds: wp.array(dtype=float), world: int, substeps: int, block_group: BlockGroup,
):  # fmt: skip
    """The phases of ``substeps`` substeps: all of them, or those of the parts that are asked for.

    ``near`` is as `nuno.plans.cloth_substep.advance` has it.
    """
    n = topo.particles
    first = n * block_group.block / block_group.blocks
    last = n * (block_group.block + 1) / block_group.blocks
    # the first step is that of the particles
    held_here = grips_on(t, run, steps[2], steps[3])
    held = grips_on(t, run, first, last)
    if block_group.rank == 0:
        speeds[2 * world] = 0.0
    grid_barrier(block_group)
    for k in range(substeps):
        if run.parts & MOTION != 0:
            if (run.first + k) % run.frame == 0:
                forget_loads(t, run, block_group.rank, block_group.group_size)
                near_shapes(near, topo, run, shapes, block_group)
            tick(t, run, block_group.rank_in_block)
            barrier(block_group.block_size)
            if run.touching != 0:
                rebuild_by_group(near, topo, run, lists, world, block_group)
            if run.damped != 0:
                damp_bends(t, topo, run, block_group.rank, block_group.group_size, block_group)
            go_through(t, topo, work, steps, run, held_here, 0, work.steps, block_group)
            grid_barrier(block_group)
        if run.pulled != 0 and run.parts & COMPLIANT_GRIPS != 0:
            pull_points(t, run, block_group.rank, 1)
            grid_barrier(block_group)
        if run.touching != 0 and run.parts & SELF_CONTACT != 0:
            for again in range(run.passes):
                if again > 0:
                    for i in range(first + block_group.rank_in_block, last, block_group.block_size):
                        take_moves(t, n, i, n)
                    grid_barrier(block_group)
                touch_edge_edge(t, n, run, block_group.rank, block_group.group_size)
                touch_vertex_triangle(t, n, run, block_group.rank, block_group.group_size)
                grid_barrier(block_group)
        if t.feature_shapes[0] > 0 and run.parts & SHAPES != 0:
            if run.touching != 0 and run.parts & SELF_CONTACT != 0:
                for i in range(first + block_group.rank_in_block, last, block_group.block_size):
                    take_moves(t, n, i, n)
                grid_barrier(block_group)
            # few elements in many colours, between which a block waits for itself alone
            if block_group.block == 0:
                push_features(t, topo, run, shapes, block_group.rank_in_block, block_group.block_size)
            grid_barrier(block_group)
        if run.parts & VELOCITIES != 0:
            reset_speed(t, block_group.rank_in_block)
            barrier(block_group.block_size)
        come_to_rest(t, near, n, run, shapes, held, first, last, block_group.rank_in_block, block_group.block_size)
        if run.parts & VELOCITIES != 0:
            share_speed(t, speeds, 2 * world + k % 2, 2 * world + (k + 1) % 2, block_group)


@wp.func
def near_of(t: StateFloat, floats: StateFloat, world: int, n: int, sizes: Sizes):
    """A world's state with coordinates as floats: itself where they are, else of ``floats``, with the same figures."""
    return t


@wp.func
def near_of(t: StateDouble, floats: StateFloat, world: int, n: int, sizes: Sizes):
    near = view(floats, world, n, sizes)
    near.scalars = t.scalars
    near.notes = t.notes
    return near


@wp.func
def run_block_groups(
    s: Any, floats: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    speeds: wp.array(dtype=float), first: int, substeps: int, block_groups: int, block_group: BlockGroup,
):  # fmt: skip
    """Run a block group through its worlds, from ``first`` on."""
    size = block_group.block_size
    steps = steps_of(work, block_group.block)
    if in_warps(size) and work.steps <= MOST_STEPS:
        steps = program(0)
        stored = steps_of(work, block_group.block)
        for k in range(block_group.rank_in_block, 4 * work.steps, size):
            steps[k] = stored[k]
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
        advance_by_group(t, near, topo, work, steps, run, shapes, lists, speeds, world, substeps, block_group)
        if block_group.rank == 0:
            for k in range(NOTES):
                notes[k] = t.notes[k]
        barrier(size)


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_grid")
def run_grid(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work, lists: Lists,
    speeds: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int, block_groups: int,
    blocks: int,
    block_size: int,
):  # fmt: skip
    """A frame, or some of one, of every world by a block group; nothing where not all are there."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, s, topo, sizes, run, shapes, work, lists, speeds, first, substeps, block_groups, block_group
        )


@wp.kernel(enable_backward=False, launch_bounds=(THREADS, 1), module="nuno.plans.run_double_grid")
def run_double_grid(
    s: StateDouble, floats: StateFloat, topo: Topology, sizes: Sizes, run: Settings, shapes: Shapes, work: Work,
    lists: Lists, speeds: wp.array(dtype=float), barrier_counts: wp.array(dtype=int), call: int, substeps: int,
    block_groups: int,
    blocks: int, block_size: int,
):  # fmt: skip
    """`run_grid` where coordinates are doubles."""
    first, block_group = block_group_of(wp.tid(), barrier_counts, call, block_groups, blocks, block_size)
    if blocks == 1 or all_resident(barrier_counts, call, block_groups, block_groups * blocks):
        begin_grid_barrier(block_group)
        run_block_groups(
            s, floats, topo, sizes, run, shapes, work, lists, speeds, first, substeps, block_groups, block_group
        )
