"""A substep of rigid bodies as a list of phases, and the kernels that walk through it.

``thread`` and ``threads`` say which share of a phase's work is whose: on the CPU a thread has a world to itself, on
CUDA a block of threads, with barriers between the phases.
"""

import warp as wp

from nuno.contact.convex import Parts
from nuno.contact.rigid_manifolds import COUNTS, ENTRIES, LEFT, OVERFLOW, ROUNDS, Contacts
from nuno.contact.rigid_pairs import Rules, end_listing, list_rows, measure, must_list, refresh_rows, reset_measures
from nuno.contact.rigid_rounds import line_up, sort_rounds
from nuno.solver.lanes import barrier
from nuno.solver.rigid_body import RigidState, begin_body, move_body, push_body, read_velocity
from nuno.solver.rigid_contact import aim_entry, mend_entry, part_entry, slow_entry, start_entry


@wp.struct
class RigidSettings:
    """What holds for the whole run."""

    dt: float
    gravity: wp.vec3
    down: float  # size of gravity [m/s2]
    must_list: int
    passes: int  # over the velocities


@wp.func
def predict_worlds(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, world: int, thread: int, threads: int
):
    """Contacts as they are now, then where each body would go under its forces and those of the last substep."""
    base = world * s.capacity
    if thread == 0:
        reset_measures(c, world)
    barrier(threads)
    measure(s, c, rules, world, thread, threads)
    barrier(threads)
    if must_list(c, world, run.dt):
        list_rows(s, parts, c, rules, world, run.dt, thread, threads)
        barrier(threads)
        if c.counts[world * COUNTS + OVERFLOW] != 0:
            return 0
        end_listing(s, c, world, run.dt, thread, threads)
    barrier(threads)
    for k in range(thread, s.capacity, threads):
        begin_body(s, base + k, s.active[k])
    barrier(threads)
    refresh_rows(s, parts, c, world, run.dt, run.down, thread, threads)
    barrier(threads)
    up = -wp.normalize(run.gravity)
    if threads == 1:
        line_up(s, parts, c, world, up)
    else:
        sort_rounds(s, parts, c, world, thread, threads)
    for k in range(thread, s.capacity, threads):
        push_body(s, base + k, run.gravity, run.dt)
    barrier(threads)
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            start_entry(s, parts, c, world, c.order[order + k], run.dt)
        barrier(threads)
    for k in range(thread, s.capacity, threads):
        move_body(s, base + k, s.active[k], run.dt)
    barrier(threads)
    return 1


@wp.func
def contact_worlds(s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, thread: int, threads: int):
    """One pass over the positions."""
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            part_entry(s, parts, c, world, c.order[order + k], run.dt)
        barrier(threads)


@wp.func
def finish_worlds(s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, thread: int, threads: int):
    """Velocities: read off the positions, then of what touches."""
    base = world * s.capacity
    for k in range(thread, s.capacity, threads):
        read_velocity(s, base + k, s.active[k], run.dt)
    barrier(threads)
    order = world * c.parts * c.row
    # what gravity gives in two substeps is no impact (Müller et al., section 3.6)
    still = 2.0 * run.down * run.dt
    for k in range(thread, c.counts[world * COUNTS + ENTRIES], threads):
        aim_entry(s, parts, c, world, c.order[order + k], run.dt, still)
    barrier(threads)
    for m in range(run.passes):
        for r in range(c.counts[world * COUNTS + ROUNDS]):
            for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
                slow_entry(s, parts, c, world, c.order[order + k], run.dt, m % 2)
            barrier(threads)
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            mend_entry(s, parts, c, world, c.order[order + k], run.dt, still)
        barrier(threads)


@wp.kernel(enable_backward=False, module="nuno.solver.run_rigid")
def run_rigid(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, first: int, phase: int,
    threads: int,
):  # fmt: skip
    """Whole substeps (phase 0), or one phase of one: 1 predict, 2 contacts, 3 finish."""
    tid = wp.tid()
    world = first + tid / threads
    thread = tid % threads
    left = c.counts[world * COUNTS + LEFT]
    go = int(1)
    while left > 0 and go == 1:
        if phase <= 1:
            # a row that is too short ends the run here, before anything moved: the host makes longer ones and goes on
            go = predict_worlds(s, parts, c, rules, run, world, thread, threads)
        if go == 1:
            if phase == 0 or phase == 2:
                contact_worlds(s, parts, c, run, world, thread, threads)
            if phase == 0 or phase == 3:
                finish_worlds(s, parts, c, run, world, thread, threads)
            left = left - 1
    barrier(threads)
    if thread == 0:
        c.counts[world * COUNTS + LEFT] = left
