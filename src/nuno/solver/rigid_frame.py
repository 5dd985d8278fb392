"""A substep of rigid bodies as a list of phases, and the kernels that walk through it.

``thread`` and ``threads`` say which share of a phase's work is whose: on the CPU a thread has a world to itself, on
CUDA a block of threads or a team of blocks. ``those`` wait for each other between the phases.
"""

from typing import Any

import warp as wp

from nuno.contact.convex import Parts
from nuno.contact.rigid_manifolds import COUNTS, ENTRIES, LEFT, OVERFLOW, ROUNDS, Contacts, forget_impulses
from nuno.contact.rigid_pairs import Rules, end_listing, list_rows, measure, must_list, refresh_rows, reset_measures
from nuno.contact.rigid_rounds import line_up, sort_rounds
from nuno.solver.rigid_body import RigidState, begin_body, move_body, push_body, read_velocity
from nuno.solver.rigid_contact import aim_entry, mend_entry, part_entry, slow_entry, start_entry
from nuno.solver.team import begin_to_meet, call_roll, team_of, wait_for


@wp.struct
class RigidSettings:
    """What holds for the whole run."""

    dt: float
    gravity: wp.vec3
    down: float  # size of gravity [m/s2]
    must_list: int
    passes: int  # over the velocities
    frame: int  # substeps that are left when the last frame begins, from which on impulses are added up; 0: none begins


@wp.func
def predict_worlds(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, world: int, thread: int, threads: int,
    those: Any,
):  # fmt: skip
    """Contacts as they are now, then where each body would go under its forces and those of the last substep."""
    base = world * s.capacity
    if thread == 0:
        reset_measures(c, world)
    wait_for(those)
    measure(s, c, rules, world, thread, threads)
    wait_for(those)
    if must_list(c, world, run.dt):
        list_rows(s, parts, c, rules, world, run.dt, thread, threads)
        wait_for(those)
        if c.counts[world * COUNTS + OVERFLOW] != 0:
            return 0
        end_listing(s, c, world, run.dt, thread, threads)
    wait_for(those)
    for k in range(thread, s.capacity, threads):
        begin_body(s, base + k, s.active[k])
    wait_for(those)
    refresh_rows(s, parts, c, world, run.dt, run.down, thread, threads, those)
    wait_for(those)
    up = -wp.normalize(run.gravity)
    if threads == 1:
        line_up(s, parts, c, world, up)
    else:
        sort_rounds(s, parts, c, world, thread, threads, those)
    for k in range(thread, s.capacity, threads):
        push_body(s, base + k, run.gravity, run.dt)
    wait_for(those)
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            start_entry(s, parts, c, world, c.order[order + k], run.dt)
        wait_for(those)
    for k in range(thread, s.capacity, threads):
        move_body(s, base + k, s.active[k], run.dt)
    wait_for(those)
    return 1


@wp.func
def contact_worlds(
    s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, thread: int, threads: int, those: Any
):
    """One pass over the positions."""
    order = world * c.parts * c.row
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            part_entry(s, parts, c, world, c.order[order + k], run.dt)
        wait_for(those)


@wp.func
def finish_worlds(
    s: RigidState, parts: Parts, c: Contacts, run: RigidSettings, world: int, thread: int, threads: int, those: Any
):
    """Velocities: read off the positions, then of what touches."""
    base = world * s.capacity
    for k in range(thread, s.capacity, threads):
        read_velocity(s, base + k, s.active[k], run.dt)
    wait_for(those)
    order = world * c.parts * c.row
    # what gravity gives in two substeps is no impact (Müller et al., section 3.6)
    still = 2.0 * run.down * run.dt
    for k in range(thread, c.counts[world * COUNTS + ENTRIES], threads):
        aim_entry(s, parts, c, world, c.order[order + k], run.dt, still)
    wait_for(those)
    for m in range(run.passes):
        for r in range(c.counts[world * COUNTS + ROUNDS]):
            for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
                slow_entry(s, parts, c, world, c.order[order + k], run.dt, m % 2)
            wait_for(those)
    for r in range(c.counts[world * COUNTS + ROUNDS]):
        for k in range(c.bounds[order + r] + thread, c.bounds[order + r + 1], threads):
            mend_entry(s, parts, c, world, c.order[order + k], run.dt, still)
        wait_for(those)


@wp.func
def go_through(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int, world: int, thread: int,
    threads: int, those: Any,
):  # fmt: skip
    """Whole substeps of a world (phase 0), or one phase of one: 1 predict, 2 contacts, 3 finish."""
    left = c.counts[world * COUNTS + LEFT]
    go = int(1)
    while left > 0 and go == 1:
        if phase <= 1:
            if left == run.frame:
                forget_impulses(s, parts, c, world, thread, threads)
            # a row that is too short ends the run here, before anything moved: the host makes longer ones and goes on
            go = predict_worlds(s, parts, c, rules, run, world, thread, threads, those)
        if go == 1:
            if phase == 0 or phase == 2:
                contact_worlds(s, parts, c, run, world, thread, threads, those)
            if phase == 0 or phase == 3:
                finish_worlds(s, parts, c, run, world, thread, threads, those)
            left = left - 1
    wait_for(those)
    if thread == 0:
        c.counts[world * COUNTS + LEFT] = left


@wp.kernel(enable_backward=False, module="nuno.solver.run_rigid")
def run_rigid(s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int, threads: int):
    """`go_through` every world by itself, on CUDA by a block."""
    tid = wp.tid()
    go_through(s, parts, c, rules, run, phase, tid / threads, tid % threads, threads, threads)


@wp.kernel(enable_backward=False, module="nuno.solver.run_rigid_team")
def run_rigid_team(
    s: RigidState, parts: Parts, c: Contacts, rules: Rules, run: RigidSettings, phase: int, gate: wp.array(dtype=int),
    worlds: int, blocks: int, threads: int,
):  # fmt: skip
    """`go_through` every world by a team of blocks; nothing where not all are there."""
    world, team = team_of(wp.tid(), gate, 0, worlds, blocks, threads)
    if call_roll(gate, 0, worlds, worlds * blocks):
        begin_to_meet(team)
        go_through(s, parts, c, rules, run, phase, world, team.turn, team.turns, team)
