"""Blocks of a CUDA launch that have no world of their own help the others list pairs.

Where worlds are fewer than multiprocessors, the others would idle while the most folded world lists its pairs, which
takes it as long as all else. Whatever warp is free takes the next batch of pairs of blocks, of a world's own block like
of its helpers, and the own block alone waits until all are done. It never waits for a batch that nobody has taken, so
that a launch ends whether or not there is room for helpers. Who finds a pair does not matter: the list is a set.
"""

import warp as wp

from nuno.contact.batches import BATCH, queue_blocks, search_batch
from nuno.solver.lanes import barrier, window
from nuno.solver.state import COUNTS, LEFT_OUT, THICKNESS, Settings, Sizes, StateFloat, Topology, view
from nuno.solver.warps import WARP, anyone, sync_warp, told

FOUND, QUEUED = wp.constant(2), wp.constant(5)
"""Where in `State.help` the counts of listed pairs stand, and how many pairs of blocks are queued. Before them are the
batches left and those done, between them whether the world's launch is over. Counts are read from place 2 on, so that
what warps had no room for comes to stand at 6."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int* h = help.data;
h[1] = 0;
h[2] = first;
h[3] = second;
h[6] = 0;
h[5] = queued;
// all that the block wrote before is there for who takes a batch
__threadfence();
atomicExch(help.data, (queued + batch - 1) / batch);
#endif
""")
def offer(help: wp.array(dtype=int), queued: int, batch: int, first: int, second: int):
    """Offer the queue; ``first`` and ``second`` are the counts of pairs listed so far. One thread does it."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const int left = atomicSub(help.data, 1);
__threadfence();
return left;
#else
return 0;
#endif
""")
def take(help: wp.array(dtype=int)) -> int:
    """Take a batch: its number from 1 on, or none."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
volatile int* h = help.data;
while (h[0] <= 0) {
    if (h[4] != 0) return false;
    __nanosleep(300);
}
return true;
#else
return false;
#endif
""")
def await_work(help: wp.array(dtype=int)) -> bool:
    """Wait until there are batches to take; or not, once the launch is over."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__threadfence();
atomicAdd(help.data + 1, 1);
#endif
""")
def hand_in(help: wp.array(dtype=int)):
    """Say that a batch is done, once all threads of the warp have done with it."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
volatile int* h = help.data;
while (h[1] < batches) __nanosleep(20);
__threadfence();
#endif
""")
def await_all(help: wp.array(dtype=int), batches: int):
    """Wait until so many batches are done."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__threadfence();
atomicExch(help.data + 4, 1);
#endif
""")
def send_home(help: wp.array(dtype=int)):
    """Say that no more batches will come."""
    ...


@wp.func
def take_part(t: StateFloat, topo: Topology, far: float, thread: int, threads: int):
    """Take batches until none is left: each warp by itself."""
    number = int(1)
    while number > 0:
        number = 0
        if thread % WARP == 0:
            number = take(t.help)
        number = told(number, 0)
        if number > 0:
            first = (number - 1) * BATCH
            search_batch(t, topo, far, first, wp.min(first + BATCH, t.help[QUEUED]), thread, threads)
            sync_warp()
            if thread % WARP == 0:
                hand_in(t.help)


@wp.func
def find_with_help(t: StateFloat, topo: Topology, far: float, thread: int, threads: int):
    """List the elements of listed blocks that are nearer than ``far``, with whoever helps."""
    queued = queue_blocks(t, topo, far, thread, threads)
    own = t.pair_count
    t.pair_count = window(t.help, FOUND, COUNTS)
    barrier(threads)
    if thread == 0:
        offer(t.help, queued, BATCH, own[0], own[1])
    barrier(threads)
    take_part(t, topo, far, thread, threads)
    barrier(threads)
    if thread == 0:
        await_all(t.help, (queued + BATCH - 1) / BATCH)
        own[0] = t.help[FOUND]
        own[1] = t.help[FOUND + 1]
        own[LEFT_OUT] = wp.max(own[LEFT_OUT], t.help[FOUND + LEFT_OUT])
    t.pair_count = own
    barrier(threads)


@wp.func
def help_out(s: StateFloat, topo: Topology, size: Sizes, run: Settings, helper: int, thread: int, threads: int):
    """A helper's work, for as long as its world's launch takes."""
    n = topo.particles
    t = view(s, helper % s.worlds, n, size)
    # the positions that are listed, for the world's own go on in another block's memory
    t.x = window(t.listed, 0, n)
    t.y = window(t.listed, n, n)
    t.z = window(t.listed, 2 * n, n)
    t.pair_count = window(t.help, FOUND, COUNTS)
    t.touch_edge = window(s.help_room, helper * t.touch_edge.shape[0], t.touch_edge.shape[0])
    far = t.scalars[THICKNESS] + 1.01 * run.margin
    while anyone(thread == 0 and await_work(t.help)):
        take_part(t, topo, far, thread, threads)
