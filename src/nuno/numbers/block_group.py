"""Several CUDA blocks that work on one world in one launch, and wait for each other.

CUDA promises nothing about when the blocks of a launch begin: if some were to wait for others that have no room on the
device, they would wait for ever. So there are never more of them than multiprocessors, each has room for one, and
before anything is done they check that all are resident. Whatever else the device is busy with, in this process or in
another: if not all have answered in time, all go home and nothing has changed. Once all have answered none is taken off
the device without the others, for the device is shared by turns as a whole or by room that stays a block's own.
"""

import warp as wp

from nuno.numbers.crew import Crew, barrier

PATIENCE = 200_000_000
"""[ns] How long the blocks wait for all to answer."""
COUNT = 32
"""Numbers that each count has to itself, so that none waits for another's memory line."""
ANSWERED, RESIDENCY, ARRIVALS = 0, 1, 2
"""Counts of a launch: blocks that answered the check; 1 if all did and 2 if they gave up; behind these, for each world,
how often a block came to a wait."""


def counts_of(worlds: int) -> int:
    """Numbers that a launch needs for its counts, zero when it begins."""
    return COUNT * (ARRIVALS + worlds)


@wp.struct
class BlockGroup:
    """The blocks that work on one world, as one of their threads sees them."""

    barrier_counts: wp.array(dtype=int)
    place: int  # of the world's count in ``barrier_counts``
    block: int
    blocks: int
    # within the block
    rank_in_block: int
    block_size: int
    # figures that the blocks share, and where the world's begin among them
    shared: wp.array(dtype=float)
    first_shared: int
    # among all, the warps of all blocks by turns: what has work for few is then spread over all multiprocessors
    rank: int
    size: int


@wp.func
def block_group_of(tid: int, barrier_counts: wp.array(dtype=int), call: int, worlds: int, blocks: int, block_size: int):
    """The world of thread ``tid``, and its place in that world's block group; ``call`` is the number of the launch."""
    world = tid / (blocks * block_size)
    block_group = BlockGroup()
    block_group.barrier_counts = barrier_counts
    block_group.place = COUNT * (call * (ARRIVALS + worlds) + ARRIVALS + world)
    block_group.block = tid / block_size % blocks
    block_group.blocks = blocks
    block_group.rank_in_block = tid % block_size
    block_group.block_size = block_size
    block_group.size = blocks * block_size
    block_group.rank = block_group.rank_in_block
    if block_size % 32 == 0:
        block_group.rank = (
            block_group.rank_in_block / 32 * blocks + block_group.block
        ) * 32 + block_group.rank_in_block % 32
    return world, block_group


@wp.func_native("""
#if defined(__CUDA_ARCH__)
// arrivals, of all blocks, after which all are there
__shared__ unsigned int goal;
__syncthreads();
if (blocks == 0) {
    if (threadIdx.x == 0) goal = 0;
} else if (blocks > 1 && threadIdx.x == 0) {
    // what all threads of the block wrote is handed over by one, and so is what those of other blocks did
    unsigned int* arrived = reinterpret_cast<unsigned int*>(barrier_counts.data) + place;
    unsigned int now;
    goal += blocks;
    asm volatile("red.add.release.gpu.global.u32 [%0], 1;" :: "l"(arrived) : "memory");
    do {
        asm volatile("ld.acquire.gpu.global.u32 %0, [%1];" : "=r"(now) : "l"(arrived) : "memory");
    } while ((int)(now - goal) < 0);
}
__syncthreads();
#endif
""")
def wait_for_blocks(barrier_counts: wp.array(dtype=int), place: int, blocks: int):
    """Wait for all threads of ``blocks`` blocks, which count their arrivals at ``place``; of none, begin to count."""
    ...


@wp.func
def begin_grid_barrier(block_group: BlockGroup):
    """To be called once by all threads before the first `grid_barrier`."""
    wait_for_blocks(block_group.barrier_counts, block_group.place, 0)


@wp.func
def grid_barrier(block_group: BlockGroup):
    """Wait for all threads of the group; what they wrote is there then."""
    wait_for_blocks(block_group.barrier_counts, block_group.place, block_group.blocks)


@wp.func
def wait_for(crew: int):
    """Wait for the whole crew: the threads of a block, so many, or all of a block group."""
    barrier(crew)


@wp.func
def wait_for(crew: Crew):
    barrier(crew.size)


@wp.func
def wait_for(crew: BlockGroup):
    grid_barrier(crew)


@wp.func
def wait_for_block(crew: Crew):
    """Wait for those of the crew that are in the same block."""
    barrier(crew.size)


@wp.func
def wait_for_block(crew: BlockGroup):
    barrier(crew.block_size)


@wp.func
def rank_in_block(crew: Crew):
    """The rank among those of the crew that are in the same block, who share its figures."""
    return crew.rank


@wp.func
def rank_in_block(crew: BlockGroup):
    return crew.rank_in_block


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int residency;
if (threadIdx.x == 0) {
    int* arrivals = barrier_counts.data + first;
    volatile int* decision = arrivals + width;
    if (call > 0 && *(volatile int*)(arrivals - stride + width) != 1) {
        atomicExch(arrivals + width, 2);
    } else {
        unsigned long long start, now;
        asm volatile("mov.u64 %0, %globaltimer;" : "=l"(start));
        if (atomicAdd(arrivals, 1) + 1 == blocks) atomicCAS(arrivals + width, 0, 1);
        while (*decision == 0) {
            __nanosleep(100);
            asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now));
            if (now - start > patience) atomicCAS(arrivals + width, 0, 2);
        }
    }
    residency = *decision;
    __threadfence();
}
__syncthreads();
return residency == 1;
#else
barrier_counts.data[first + width] = 1;
return true;
#endif
""")
def check_residency(
    barrier_counts: wp.array(dtype=int), first: int, width: int, stride: int, call: int, blocks: int, patience: int
) -> bool: ...


@wp.func
def all_resident(barrier_counts: wp.array(dtype=int), call: int, worlds: int, blocks: int):
    """Return True if all ``blocks`` blocks of the launch are resident, and those of the launches before it were."""
    stride = COUNT * (ARRIVALS + worlds)
    return check_residency(barrier_counts, call * stride, COUNT, stride, call, blocks, PATIENCE)
