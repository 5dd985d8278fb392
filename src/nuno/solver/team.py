"""Several CUDA blocks that work on one world in one launch, and wait for each other.

CUDA promises nothing about when the blocks of a launch begin: if some were to wait for others that have no room on the
device, they would wait for ever. So there are never more of them than multiprocessors, each has room for one, and
before anything is done they call a roll. Whatever else the device is busy with, in this process or in another: if not
all have answered in time, all go home and nothing has changed. Once all have answered none is taken off the device
without the others, for the device is shared by turns as a whole or by room that stays a block's own.
"""

import warp as wp

from nuno.solver.lanes import barrier

PATIENCE = 200_000_000
"""[ns] How long the blocks wait for all to answer."""
COUNT = 32
"""Numbers that each count has to itself, so that none waits for another's memory line."""
ROLL, VERDICT, ARRIVED = 0, 1, 2
"""Counts of a launch: blocks that answered the roll; 1 if all did and 2 if they gave up; behind these, for each world,
how often a block came to a wait."""


def counts_of(worlds: int) -> int:
    """Numbers that a launch needs for its counts, zero when it begins."""
    return COUNT * (ARRIVED + worlds)


@wp.struct
class Team:
    """The blocks that work on one world, as one of their threads sees them."""

    gate: wp.array(dtype=int)
    place: int  # of the world's count in ``gate``
    block: int
    blocks: int
    # within the block
    thread: int
    threads: int
    # among all, the warps of all blocks by turns: what has work for few is then spread over all multiprocessors
    turn: int
    turns: int


@wp.func
def team_of(tid: int, gate: wp.array(dtype=int), call: int, worlds: int, blocks: int, threads: int):
    """The world of thread ``tid``, and its place in that world's team; ``call`` is the number of the launch."""
    world = tid / (blocks * threads)
    team = Team()
    team.gate = gate
    team.place = COUNT * (call * (ARRIVED + worlds) + ARRIVED + world)
    team.block = tid / threads % blocks
    team.blocks = blocks
    team.thread = tid % threads
    team.threads = threads
    team.turns = blocks * threads
    team.turn = team.thread
    if threads % 32 == 0:
        team.turn = (team.thread / 32 * blocks + team.block) * 32 + team.thread % 32
    return world, team


@wp.func_native("""
#if defined(__CUDA_ARCH__)
// arrivals, of all blocks, after which all are there
__shared__ unsigned int goal;
__syncthreads();
if (blocks == 0) {
    if (threadIdx.x == 0) goal = 0;
} else if (blocks > 1 && threadIdx.x == 0) {
    // what all threads of the block wrote is handed over by one, and so is what those of other blocks did
    unsigned int* arrived = reinterpret_cast<unsigned int*>(gate.data) + place;
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
def meet_blocks(gate: wp.array(dtype=int), place: int, blocks: int):
    """Wait for all threads of ``blocks`` blocks, which count their arrivals at ``place``; of none, begin to count."""
    ...


@wp.func
def begin_to_meet(team: Team):
    """To be called once by all threads before the first `meet`."""
    meet_blocks(team.gate, team.place, 0)


@wp.func
def meet(team: Team):
    """Wait for all threads of the team; what they wrote is there then."""
    meet_blocks(team.gate, team.place, team.blocks)


@wp.func
def wait_for(those: int):
    """Wait for all threads of the block, so many, or for all of a team."""
    barrier(those)


@wp.func
def wait_for(those: Team):
    meet(those)


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int verdict;
if (threadIdx.x == 0) {
    int* roll = gate.data + first;
    volatile int* said = roll + width;
    if (call > 0 && *(volatile int*)(roll - stride + width) != 1) {
        atomicExch(roll + width, 2);
    } else {
        unsigned long long start, now;
        asm volatile("mov.u64 %0, %globaltimer;" : "=l"(start));
        if (atomicAdd(roll, 1) + 1 == blocks) atomicCAS(roll + width, 0, 1);
        while (*said == 0) {
            __nanosleep(100);
            asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now));
            if (now - start > patience) atomicCAS(roll + width, 0, 2);
        }
    }
    verdict = *said;
    __threadfence();
}
__syncthreads();
return verdict == 1;
#else
gate.data[first + width] = 1;
return true;
#endif
""")
def answered(
    gate: wp.array(dtype=int), first: int, width: int, stride: int, call: int, blocks: int, patience: int
) -> bool: ...


@wp.func
def call_roll(gate: wp.array(dtype=int), call: int, worlds: int, blocks: int):
    """Whether all ``blocks`` blocks of the launch are on the device, and those of the launches before it were."""
    stride = COUNT * (ARRIVED + worlds)
    return answered(gate, call * stride, COUNT, stride, call, blocks, PATIENCE)
