"""The CUDA plan for worlds that fit a block: a block per world, its particles in shared memory where they fit.

The counts of the pair lists and the figures that all threads read are always there, for what lies in the device's
memory answers many times later, and threads wait for the answer.
"""

from __future__ import annotations

from typing import Any

import warp as wp

from nuno.contact.helping import help_out, send_home
from nuno.solver.frame import advance
from nuno.solver.lanes import barrier
from nuno.solver.shared_memory import (
    FINE_PARTICLES,
    SHARED_PARTICLES,
    WHOLE_PARTICLES,
    column,
    counts,
    figures,
    fine_column,
    whole,
)
from nuno.solver.state import COUNTS, NOTES, Settings, Shapes, Sizes, StateFine, StateFloat, Topology, view
from nuno.solver.taking_turns import end_turn, next_turn

BLOCKS_AT_ONCE = 2
"""Blocks of 256 threads that a multiprocessor's registers must have room for; left to itself, the compiler takes all
for one, and nothing runs while that waits."""
MANY_AT_ONCE = 3
"""The same of cloth in many worlds: as many as its shared memory has room for."""
FEW_WORLDS = 1.2
"""Worlds for each multiprocessor up to which they are few: a block of many threads each that takes turns is sooner done
with 1.2 worlds than three blocks of fewer threads beside each other are with one each."""
FEW_FRAMES, MANY_FRAMES = 2, 15
"""Frames that a world's turn takes where they are few and where they are many: so few that blocks end at about the same
time, and so many that to read and write a world costs little beside them."""
FEW_THREADS, MANY_THREADS = 512, 256
"""Threads of a block where every world has a multiprocessor to itself, and where worlds queue up for them: some blocks
then share one, so that other worlds run while one waits. Both do the same, and so the bits are the same."""


@wp.func
def advance_block(
    t: Any, near: Any, topo: Topology, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int
):
    """`advance` with the counts of the pair lists and the figures in shared memory for as long as the launch takes."""
    listed = t.pair_count
    picked = t.touch_count
    scalars = t.scalars
    notes = t.notes
    t.pair_count = counts(0)
    t.touch_count = counts(COUNTS)
    t.scalars = figures(0)
    t.notes = figures(8)
    near.pair_count = counts(0)
    near.touch_count = counts(COUNTS)
    near.scalars = figures(0)
    near.notes = figures(8)
    if thread == 0:
        for k in range(COUNTS):
            t.pair_count[k] = listed[k]
        for k in range(2):
            t.touch_count[k] = picked[k]
        for k in range(7):
            t.scalars[k] = scalars[k]
        for k in range(NOTES):
            t.notes[k] = notes[k]
    barrier(threads)
    advance(t, near, topo, run, shapes, substeps, thread, threads)
    barrier(threads)
    if thread == 0:
        for k in range(COUNTS):
            listed[k] = t.pair_count[k]
        for k in range(2):
            picked[k] = t.touch_count[k]
        for k in range(NOTES):
            notes[k] = t.notes[k]
        if t.helpers > 0:
            send_home(t.help)


# A module each, so that only the kind that is run is compiled. Quotients and roots as the processor has them, which
# may be off by two in the last place: a tenth of the time, and the same bits for the same input all the same.
for _name in (
    "run_blocks", "run_blocks_partly", "run_blocks_shared", "run_blocks_many", "run_fine_blocks",
    "run_fine_blocks_partly",
):  # fmt: skip
    wp.get_module(f"nuno.solver.{_name}").options["fast_math"] = True


@wp.func
def advance_blocks(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int, thread: int,
    threads: int,
):  # fmt: skip
    """Every world by a block of ``threads`` threads."""
    t = view(s, block, topo.particles, size)
    advance_block(t, t, topo, run, shapes, substeps, thread, threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_blocks")
def run_blocks(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int):
    """Every world by a block of ``threads`` threads."""
    tid = wp.tid()
    if tid / threads < s.worlds:
        advance_blocks(s, topo, size, run, shapes, substeps, tid / threads, tid % threads, threads)
    else:
        help_out(s, topo, size, run, tid / threads - s.worlds, tid % threads, threads)


@wp.func
def advance_blocks_partly(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int, thread: int,
    threads: int,
):  # fmt: skip
    """The same with x, y, z and w in shared memory for as long as the launch takes."""
    n = topo.particles
    t = view(s, block, n, size)
    outside = view(s, block, n, size)
    t.x = column(0)
    t.y = column(SHARED_PARTICLES)
    t.z = column(2 * SHARED_PARTICLES)
    t.w = column(3 * SHARED_PARTICLES)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
    advance_block(t, t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_blocks_partly")
def run_blocks_partly(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """The same with x, y, z and w in shared memory for as long as the launch takes."""
    tid = wp.tid()
    if tid / threads < s.worlds:
        advance_blocks_partly(s, topo, size, run, shapes, substeps, tid / threads, tid % threads, threads)
    else:
        help_out(s, topo, size, run, tid / threads - s.worlds, tid % threads, threads)


@wp.func
def advance_blocks_shared(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, block: int, thread: int,
    threads: int,
):  # fmt: skip
    """The same with x, y, z, w and p in shared memory, and what contacts move particles by."""
    n = topo.particles
    t = view(s, block, n, size)
    outside = view(s, block, n, size)
    t.x = column(0)
    t.y = column(WHOLE_PARTICLES)
    t.z = column(2 * WHOLE_PARTICLES)
    t.w = column(3 * WHOLE_PARTICLES)
    t.px = column(4 * WHOLE_PARTICLES)
    t.py = column(5 * WHOLE_PARTICLES)
    t.pz = column(6 * WHOLE_PARTICLES)
    t.moved = whole(column(7 * WHOLE_PARTICLES))
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
        t.px[i] = outside.px[i]
        t.py[i] = outside.py[i]
        t.pz[i] = outside.pz[i]
    for i in range(thread, 4 * n, threads):
        t.moved[i] = 0
    advance_block(t, t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]
        outside.px[i] = t.px[i]
        outside.py[i] = t.py[i]
        outside.pz[i] = t.pz[i]


@wp.func
def advance_in_turns(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, turn: int, block: int,
    thread: int, threads: int,
):  # fmt: skip
    """The same, ``turn`` substeps at a time, whole frames, of whichever world has its turn; or all of one world."""
    turns = s.worlds * ((substeps + turn - 1) / turn)
    k = int(block)
    if turn < substeps:
        k = next_turn(s.help, s.worlds, turns)
    while k < turns:
        world = k % s.worlds
        left = substeps - k / s.worlds * turn
        advance_blocks_shared(s, topo, size, run, shapes, wp.min(turn, left), world, thread, threads)
        if turn < substeps:
            end_turn(s.help, world)
            k = next_turn(s.help, s.worlds, turns)
        else:
            k = turns


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_blocks_shared")
def run_blocks_shared(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int, turn: int
):
    """The same with x, y, z, w and p in shared memory, and what contacts move particles by."""
    tid = wp.tid()
    if tid / threads < s.worlds:
        advance_in_turns(s, topo, size, run, shapes, substeps, turn, tid / threads, tid % threads, threads)
    else:
        help_out(s, topo, size, run, tid / threads - s.worlds, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(MANY_THREADS, MANY_AT_ONCE), module="nuno.solver.run_blocks_many")
def run_blocks_many(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int, turn: int
):
    """The same where worlds queue up: with fewer registers a thread, so that more blocks share a multiprocessor."""
    tid = wp.tid()
    advance_in_turns(s, topo, size, run, shapes, substeps, turn, tid / threads, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_fine_blocks")
def run_fine_blocks(
    s: StateFine, floats: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int,
    threads: int,
):  # fmt: skip
    """Every world by a block of ``threads`` threads, coordinates as doubles."""
    tid = wp.tid()
    if tid / threads < s.worlds:
        block = tid / threads
        t = view(s, block, topo.particles, size)
        near = view(floats, block, topo.particles, size)
        advance_block(t, near, topo, run, shapes, substeps, tid % threads, threads)
    else:
        help_out(floats, topo, size, run, tid / threads - s.worlds, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_fine_blocks_partly")
def run_fine_blocks_partly(
    s: StateFine, floats: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int,
    threads: int,
):  # fmt: skip
    """The same with x, y and z in shared memory for as long as the launch takes."""
    tid = wp.tid()
    if tid / threads < s.worlds:
        block = tid / threads
        thread = tid % threads
        n = topo.particles
        t = view(s, block, n, size)
        outside = view(s, block, n, size)
        near = view(floats, block, n, size)
        t.x = fine_column(0)
        t.y = fine_column(FINE_PARTICLES)
        t.z = fine_column(2 * FINE_PARTICLES)
        for i in range(thread, n, threads):
            t.x[i] = outside.x[i]
            t.y[i] = outside.y[i]
            t.z[i] = outside.z[i]
        advance_block(t, near, topo, run, shapes, substeps, thread, threads)
        for i in range(thread, n, threads):
            outside.x[i] = t.x[i]
            outside.y[i] = t.y[i]
            outside.z[i] = t.z[i]
    else:
        help_out(floats, topo, size, run, tid / threads - s.worlds, tid % threads, threads)
