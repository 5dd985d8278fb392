"""The CUDA plan for worlds that fit a block: a block per world, positions in shared memory where they fit.

The counts of the pair lists always are there, for an atomic on them answers many times sooner than one on the device's
memory, and threads that list pairs wait for the answer.
"""

from __future__ import annotations

import warp as wp

from nuno.solver.frame import advance
from nuno.solver.lanes import barrier
from nuno.solver.state import Settings, Shapes, Sizes, StateFloat, Topology, view

SHARED_FLOATS = 12000
"""Floats in a static buffer: 48 KB less the 1 KB that Warp takes for itself, and the counts."""
SHARED_PARTICLES = SHARED_FLOATS // 4
"""Particles whose coordinates and inverse masses fit."""
BLOCKS_AT_ONCE = 2
"""Blocks that a multiprocessor's registers must have room for; left to itself, the compiler takes all for one, and
nothing runs while that waits. The same for few worlds and for many, so that they are the same code."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ float buffer[12000];
return (wp::uint64)buffer;
#else
return 0;
#endif
""")
def shared_buffer() -> wp.uint64:
    """Address of the block's own memory."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int counts[4];
return (wp::uint64)counts;
#else
return 0;
#endif
""")
def shared_counts() -> wp.uint64:
    """Address of four integers in the block's own memory."""
    ...


@wp.func
def advance_block(
    t: StateFloat, topo: Topology, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int
):
    """`advance` with the counts of the pair lists in shared memory for as long as the launch takes."""
    listed = t.pair_count
    picked = t.touch_count
    counts = shared_counts()
    t.pair_count = wp.array(ptr=counts, shape=(2,), dtype=int)
    t.touch_count = wp.array(ptr=counts + wp.uint64(8), shape=(2,), dtype=int)
    if thread < 2:
        t.pair_count[thread] = listed[thread]
        t.touch_count[thread] = picked[thread]
    barrier(threads)
    advance(t, topo, run, shapes, substeps, thread, threads)
    barrier(threads)
    if thread < 2:
        listed[thread] = t.pair_count[thread]
        picked[thread] = t.touch_count[thread]


# A module each, so that only the kind that is run is compiled.


@wp.kernel(enable_backward=False, launch_bounds=(256, BLOCKS_AT_ONCE), module="nuno.solver.run_blocks")
def run_blocks(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int):
    """Every world by a block of ``threads`` threads."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    advance_block(t, topo, run, shapes, substeps, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(256, BLOCKS_AT_ONCE), module="nuno.solver.run_blocks_shared")
def run_blocks_shared(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """The same with x, y, z and w in shared memory for as long as the launch takes."""
    tid = wp.tid()
    n = topo.particles
    thread = tid % threads
    t = view(s, tid / threads, n, size)
    outside = view(s, tid / threads, n, size)
    buffer = shared_buffer()
    step = wp.uint64(n) * wp.uint64(4)
    t.x = wp.array(ptr=buffer, shape=(n,), dtype=float)
    t.y = wp.array(ptr=buffer + step, shape=(n,), dtype=float)
    t.z = wp.array(ptr=buffer + step * wp.uint64(2), shape=(n,), dtype=float)
    t.w = wp.array(ptr=buffer + step * wp.uint64(3), shape=(n,), dtype=float)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
    advance_block(t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]
