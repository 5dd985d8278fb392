"""The CUDA plan for worlds that fit a block: a block per world, its particles in shared memory where they fit.

The counts of the pair lists and the figures that all threads read are always there, for what lies in the device's
memory answers many times later, and threads wait for the answer.
"""

from __future__ import annotations

import warp as wp

from nuno.solver.frame import advance
from nuno.solver.lanes import barrier
from nuno.solver.state import Settings, Shapes, Sizes, StateFloat, Topology, view

SHARED_FLOATS = 11500
"""Floats in the static buffer: 48 KB less the 2 KB that Warp takes for itself at 512 threads, the counts and the
figures."""
SHARED_PARTICLES = SHARED_FLOATS // 4
"""Particles whose coordinates and inverse masses fit; of `SHARED_FLOATS` / 10 all that changes in a substep does."""
BLOCKS_AT_ONCE = 2
"""Blocks of 256 threads that a multiprocessor's registers must have room for; left to itself, the compiler takes all
for one, and nothing runs while that waits."""
FEW_THREADS, MANY_THREADS = 512, 256
"""Threads of a block where every world has a multiprocessor to itself, and where worlds queue up for them: two blocks
then share one, so that another world runs while one waits. The kernel is the same for both, and so are the bits."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ float buffer[11500];
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
__shared__ int figures[20];
return (wp::uint64)figures;
#else
return 0;
#endif
""")
def shared_figures() -> wp.uint64:
    """Address of twenty numbers in the block's own memory: four counts, and the world's scalars and notes."""
    ...


@wp.func
def advance_block(
    t: StateFloat, topo: Topology, run: Settings, shapes: Shapes, substeps: int, thread: int, threads: int
):
    """`advance` with the counts of the pair lists and the figures in shared memory for as long as the launch takes."""
    listed = t.pair_count
    picked = t.touch_count
    scalars = t.scalars
    notes = t.notes
    figures = shared_figures()
    t.pair_count = wp.array(ptr=figures, shape=(2,), dtype=int)
    t.touch_count = wp.array(ptr=figures + wp.uint64(8), shape=(2,), dtype=int)
    t.scalars = wp.array(ptr=figures + wp.uint64(16), shape=(7,), dtype=float)
    t.notes = wp.array(ptr=figures + wp.uint64(48), shape=(6,), dtype=float)
    if thread == 0:
        for k in range(2):
            t.pair_count[k] = listed[k]
            t.touch_count[k] = picked[k]
        for k in range(7):
            t.scalars[k] = scalars[k]
        for k in range(6):
            t.notes[k] = notes[k]
    barrier(threads)
    advance(t, topo, run, shapes, substeps, thread, threads)
    barrier(threads)
    if thread == 0:
        for k in range(2):
            listed[k] = t.pair_count[k]
            picked[k] = t.touch_count[k]
        for k in range(6):
            notes[k] = t.notes[k]


@wp.func
def place_in(buffer: wp.uint64, k: int, n: int):
    """The k-th array of n floats in the block's own memory."""
    return wp.array(ptr=buffer + wp.uint64(4 * k * n), shape=(n,), dtype=float)


# A module each, so that only the kind that is run is compiled. Quotients and roots as the processor has them, which
# may be off by two in the last place: a tenth of the time, and the same bits for the same input all the same.
for _name in ("run_blocks", "run_blocks_shared"):
    wp.get_module(f"nuno.solver.{_name}").options["fast_math"] = True


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_blocks")
def run_blocks(s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int):
    """Every world by a block of ``threads`` threads."""
    tid = wp.tid()
    t = view(s, tid / threads, topo.particles, size)
    advance_block(t, topo, run, shapes, substeps, tid % threads, threads)


@wp.kernel(enable_backward=False, launch_bounds=(FEW_THREADS, 1), module="nuno.solver.run_blocks_shared")
def run_blocks_shared(
    s: StateFloat, topo: Topology, size: Sizes, run: Settings, shapes: Shapes, substeps: int, threads: int
):
    """The same with x, y, z and w, and if they fit p and v, in shared memory for as long as the launch takes."""
    tid = wp.tid()
    n = topo.particles
    thread = tid % threads
    t = view(s, tid / threads, n, size)
    outside = view(s, tid / threads, n, size)
    buffer = shared_buffer()
    whole = 10 * n <= SHARED_FLOATS
    t.x = place_in(buffer, 0, n)
    t.y = place_in(buffer, 1, n)
    t.z = place_in(buffer, 2, n)
    t.w = place_in(buffer, 3, n)
    if whole:
        t.px = place_in(buffer, 4, n)
        t.py = place_in(buffer, 5, n)
        t.pz = place_in(buffer, 6, n)
        t.vx = place_in(buffer, 7, n)
        t.vy = place_in(buffer, 8, n)
        t.vz = place_in(buffer, 9, n)
    for i in range(thread, n, threads):
        t.x[i] = outside.x[i]
        t.y[i] = outside.y[i]
        t.z[i] = outside.z[i]
        t.w[i] = outside.w[i]
        if whole:
            t.px[i] = outside.px[i]
            t.py[i] = outside.py[i]
            t.pz[i] = outside.pz[i]
            t.vx[i] = outside.vx[i]
            t.vy[i] = outside.vy[i]
            t.vz[i] = outside.vz[i]
    advance_block(t, topo, run, shapes, substeps, thread, threads)
    for i in range(thread, n, threads):
        outside.x[i] = t.x[i]
        outside.y[i] = t.y[i]
        outside.z[i] = t.z[i]
        if whole:
            outside.px[i] = t.px[i]
            outside.py[i] = t.py[i]
            outside.pz[i] = t.pz[i]
            outside.vx[i] = t.vx[i]
            outside.vy[i] = t.vy[i]
            outside.vz[i] = t.vz[i]
