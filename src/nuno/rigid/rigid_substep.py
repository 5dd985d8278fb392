"""A substep of rigid bodies as a list of phases, and the kernels that walk through it.

A crew goes through a world: a thread of the CPU, on CUDA the threads of a block or of a block group. ``rank`` and
``size`` say which share of a phase's work is whose; the crew waits for itself between the phases.

The loop is not `nuno.plans.substep.advance`, and could not be without loss. Of that one's phases it has but two, and
otherwise: the prediction begins with the manifolds, as the last substep's forces start it, and velocities are solved
for, pass by pass, after they are read off. What is left to do is counted by world on the device: a world whose rows
turn out too short stops by itself, before anything moved, and goes on from there once the host has made longer ones,
where `advance` stops for all worlds, and the run is gone through again from its start. And `nuno.plans` lies above
`nuno.rigid`.
"""

from typing import Any

import warp as wp

from nuno.numbers.block_group import all_resident, begin_grid_barrier, block_group_of, wait_for
from nuno.rigid.broad_phase import (
    Rules,
    end_listing,
    list_entries,
    list_rows,
    measure,
    must_list,
    refresh_rows,
    reset_measures,
)
from nuno.rigid.convex import Parts
from nuno.rigid.persistent_manifolds import COLOURS, COUNTS, ENTRIES, LEFT, OVERFLOW, Contacts, forget_impulses
from nuno.rigid.rigid_body import RigidState, begin_body, move_body, push_body, read_velocity
from nuno.rigid.rigid_contact import aim_entry, begin_mending, mend_entry, part_entry, slow_entry, start_entry
from nuno.rigid.solve_order import line_up, sort_colours


@wp.struct
class RigidSettings:
    """Settings of a whole run."""

    dt: float
    gravity: wp.vec3
    down: float  # size of gravity [m/s2]
    must_list: int
    passes: int  # over the velocities
    frame: int  # substeps that are left when the last frame begins, from which on impulses are added up; 0: none begins


@wp.func
def predict_worlds(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, world: int, rank: int, size: int,
    crew: Any,
):  # fmt: skip
    """Contacts as they are now, then where each body would go under its forces and those of the last substep."""
    base = world * s.capacity
    if rank == 0:
        reset_measures(c, world)
    wait_for(crew)
    measure(s, c, rules, world, rank, size)
    wait_for(crew)
    if must_list(c, world, run.dt):
        list_rows(s, parts, c, rules, world, run.dt, rank, size)
        wait_for(crew)
        if c.counts[world * COUNTS + OVERFLOW] != 0:
            return 0
        end_listing(s, c, world, run.dt, rank, size)
    wait_for(crew)
    if size == 1:
        list_entries(parts, c, world)
    for k in range(rank, s.capacity, size):
        begin_body(s, base + k, s.active[k])
    wait_for(crew)
    refresh_rows(s, parts, c, world, run.dt, run.down, rank, size, crew)
    wait_for(crew)
    up = -wp.normalize(run.gravity)
    if size == 1:
        line_up(s, parts, c, world, up)
    else:
        sort_colours(s, parts, c, world, rank, size, crew)
    for k in range(rank, s.capacity, size):
        push_body(s, base + k, run.gravity, run.dt)
    wait_for(crew)
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + COLOURS]):
        for k in range(c.bounds[order + r] + rank, c.bounds[order + r + 1], size):
            start_entry(s, parts, c, world, c.order[order + k], run.dt)
        wait_for(crew)
    for k in range(rank, s.capacity, size):
        move_body(s, base + k, s.active[k], run.dt)
    wait_for(crew)
    return 1


@wp.func
def contact_worlds(
    s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, rank: int, size: int, crew: Any
):
    """One pass over the positions."""
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + COLOURS]):
        for k in range(c.bounds[order + r] + rank, c.bounds[order + r + 1], size):
            part_entry(s, parts, c, world, c.order[order + k], run.dt)
        wait_for(crew)


@wp.func
def finish_worlds(
    s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, rank: int, size: int, crew: Any
):
    """Velocities: read off the positions, then of what touches."""
    base = world * s.capacity
    for k in range(rank, s.capacity, size):
        read_velocity(s, base + k, s.active[k], run.dt)
    wait_for(crew)
    order = world * c.parts * c.row
    # what gravity gives in two substeps is no impact (Müller et al., section 3.6)
    still = 2.0 * run.down * run.dt
    for k in range(rank, c.counts[world * COUNTS + ENTRIES], size):
        aim_entry(s, parts, c, world, c.order[order + k], run.dt, still)
    wait_for(crew)
    for m in range(run.passes):
        for r in range(c.counts[world * COUNTS + COLOURS]):
            for k in range(c.bounds[order + r] + rank, c.bounds[order + r + 1], size):
                slow_entry(s, parts, c, world, c.order[order + k], run.dt, m % 2)
            wait_for(crew)
    for k in range(rank, s.capacity, size):
        begin_mending(s, base + k)
    wait_for(crew)
    for r in range(c.counts[world * COUNTS + COLOURS]):
        for k in range(c.bounds[order + r] + rank, c.bounds[order + r + 1], size):
            mend_entry(s, parts, c, world, c.order[order + k], run.dt, still)
        wait_for(crew)


@wp.func
def go_through(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int, world: int, rank: int,
    size: int, crew: Any,
):  # fmt: skip
    """Whole substeps of a world (phase 0), or one phase of one: 1 predict, 2 contacts, 3 finish."""
    left = c.counts[world * COUNTS + LEFT]
    go = int(1)
    while left > 0 and go == 1:
        if phase <= 1:
            if left == run.frame:
                forget_impulses(s, parts, c, world, rank, size)
            # a row that is too short ends the run here, before anything moved: the host makes longer ones and goes on
            go = predict_worlds(s, parts, c, rules, run, world, rank, size, crew)
        if go == 1:
            if phase == 0 or phase == 2:
                contact_worlds(s, parts, c, run, world, rank, size, crew)
            if phase == 0 or phase == 3:
                finish_worlds(s, parts, c, run, world, rank, size, crew)
            left = left - 1
    wait_for(crew)
    if rank == 0:
        c.counts[world * COUNTS + LEFT] = left


@wp.kernel(enable_backward=False, module="nuno.rigid.run_rigid")
def run_rigid(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int, size: int, first_world: int
):
    """`go_through` every world by itself, on CUDA by a block."""
    tid = wp.tid()
    go_through(s, parts, c, rules, run, phase, first_world + tid / size, tid % size, size, size)


@wp.kernel(enable_backward=False, module="nuno.rigid.run_rigid_group")
def run_rigid_group(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int,
    barrier_counts: wp.array(dtype=int),
    worlds: int, blocks: int, block_size: int,
):  # fmt: skip
    """`go_through` every world by a block group; nothing where not all are there."""
    world, block_group = block_group_of(wp.tid(), barrier_counts, 0, worlds, blocks, block_size)
    if all_resident(barrier_counts, 0, worlds, worlds * blocks):
        begin_grid_barrier(block_group)
        go_through(s, parts, c, rules, run, phase, world, block_group.rank, block_group.size, block_group)
