"""Blocks of a CUDA launch that have no world of their own help the others list pairs.

Where worlds are fewer than multiprocessors, the others would idle while the most folded world lists its pairs, which
takes it as long as all else. Whatever warp is free takes the next batch of pairs of leaves, of a world's own block like
of its helpers, and the own block alone waits until all are done. It never waits for a batch that nobody has taken, so
that a launch ends whether or not there is room for helpers. Who finds a pair does not matter: the list is a set.
"""

import warp as wp

from nuno.contact.self.block_search import BATCH, queue_leaf_pairs, search_batch
from nuno.numbers.crew import barrier
from nuno.numbers.lanes import subarray
from nuno.numbers.warps import WARP, anyone, sync_warp, warp_broadcast
from nuno.state.cloth_state import COUNTS, MISSED_ELEMENTS, THICKNESS, Settings, Sizes, StateFloat, Topology, view

FOUND, QUEUED = wp.constant(2), wp.constant(5)
"""Places in `State.work_counts` of the counts of listed pairs, and of how many pairs of leaves are queued. Before them
are the batches left and those done, between them whether the world's launch is over. Counts are read from place 2 on,
so that what warps had no room for comes to stand at 6."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
int* h = work_counts.data;
h[1] = 0;
h[2] = first;
h[3] = second;
h[6] = 0;
h[5] = queued;
// all that the block wrote before is there for who takes a batch
__threadfence();
atomicExch(work_counts.data, (queued + batch - 1) / batch);
#endif
""")
def open_queue(work_counts: wp.array(dtype=int), queued: int, batch: int, first: int, second: int):
    """Offer the queue; ``first`` and ``second`` are the counts of pairs listed so far. One thread does it."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const int left = atomicSub(work_counts.data, 1);
__threadfence();
return left;
#else
return 0;
#endif
""")
def take_batch(work_counts: wp.array(dtype=int)) -> int:
    """Take a batch: its number from 1 on, or none."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
volatile int* h = work_counts.data;
while (h[0] <= 0) {
    if (h[4] != 0) return false;
    __nanosleep(300);
}
return true;
#else
return false;
#endif
""")
def wait_for_batch(work_counts: wp.array(dtype=int)) -> bool:
    """Wait until there are batches to take; or not, once the launch is over."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__threadfence();
atomicAdd(work_counts.data + 1, 1);
#endif
""")
def finish_batch(work_counts: wp.array(dtype=int)):
    """Say that a batch is done, once all threads of the warp have done with it."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
volatile int* h = work_counts.data;
while (h[1] < batches) __nanosleep(20);
__threadfence();
#endif
""")
def wait_for_all(work_counts: wp.array(dtype=int), batches: int):
    """Wait until so many batches are done."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__threadfence();
atomicExch(work_counts.data + 4, 1);
#endif
""")
def close_queue(work_counts: wp.array(dtype=int)):
    """Say that no more batches will come."""
    ...


@wp.func
def search_batches(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """Take batches until none is left: each warp by itself."""
    number = int(1)
    while number > 0:
        number = 0
        if rank % WARP == 0:
            number = take_batch(t.work_counts)
        number = warp_broadcast(number, 0)
        if number > 0:
            first = (number - 1) * BATCH
            search_batch(t, topo, far, first, wp.min(first + BATCH, t.work_counts[QUEUED]), rank, size)
            sync_warp()
            if rank % WARP == 0:
                finish_batch(t.work_counts)


@wp.func
def search_with_spare_blocks(t: StateFloat, topo: Topology, far: float, rank: int, size: int):
    """List the elements of listed leaves that are nearer than ``far``, with whoever helps."""
    queued = queue_leaf_pairs(t, topo, far, rank, size)
    own = t.pair_count
    t.pair_count = subarray(t.work_counts, FOUND, COUNTS)
    barrier(size)
    if rank == 0:
        open_queue(t.work_counts, queued, BATCH, own[0], own[1])
    barrier(size)
    search_batches(t, topo, far, rank, size)
    barrier(size)
    if rank == 0:
        wait_for_all(t.work_counts, (queued + BATCH - 1) / BATCH)
        own[0] = t.work_counts[FOUND]
        own[1] = t.work_counts[FOUND + 1]
        own[MISSED_ELEMENTS] = wp.max(own[MISSED_ELEMENTS], t.work_counts[FOUND + MISSED_ELEMENTS])
    t.pair_count = own
    barrier(size)


@wp.func
def search_for_others(
    s: StateFloat, topo: Topology, sizes: Sizes, run: Settings, spare_block: int, rank: int, size: int
):
    """A helper's work, for as long as its world's launch takes."""
    n = topo.particles
    t = view(s, spare_block % s.worlds, n, sizes)
    # the positions that are listed, for the world's own go on in another block's memory
    t.x = subarray(t.reference, 0, n)
    t.y = subarray(t.reference, n, n)
    t.z = subarray(t.reference, 2 * n, n)
    t.pair_count = subarray(t.work_counts, FOUND, COUNTS)
    t.active_edge = subarray(s.work_queue, spare_block * t.active_edge.shape[0], t.active_edge.shape[0])
    far = t.scalars[THICKNESS] + 1.01 * run.margin
    while anyone(rank == 0 and wait_for_batch(t.work_counts)):
        search_batches(t, topo, far, rank, size)
