"""The crew of a world: whoever goes through its phases together, shares its loops and waits for the rest.

A crew is a thread on the CPU, the threads of a CUDA block (`Crew`), or those of several blocks
(`nuno.numbers.block_group.BlockGroup`). Of a loop over n elements a member of rank r takes r, r + size, r + 2 size ...
"""

import warp as wp


@wp.struct
class Crew:
    """A thread by itself, or a thread among those of its CUDA block."""

    rank: int
    size: int


@wp.func
def crew_of(rank: int, size: int):
    """The crew of ``size`` threads as the one of a rank sees it."""
    crew = Crew()
    crew.rank = rank
    crew.size = size
    return crew


@wp.func_native("""
#if defined(__CUDA_ARCH__)
if (size > 1) __syncthreads();
#endif
""")
def barrier(size: int):
    """Wait for all threads of the block; nothing to wait for on the CPU."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return true;
#else
return size > 1;
#endif
""")
def shares_work(size: int) -> bool:
    """Return True if threads share the work; known to CUDA's compiler at once, which then leaves the rest out."""
    ...
