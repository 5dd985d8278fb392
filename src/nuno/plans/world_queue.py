"""Worlds that take turns: where there are more than a CUDA device has room for, each goes on by a few frames at a time.

With a block per world for a whole run, the last blocks of a launch would leave most of the device idle for about half
as long as a run of one takes, and worlds that fold more for longer. So there are as many blocks as fit, and each takes
the next of all turns: those of all worlds, one world after the other, then the second turns of all, and so on. The turn
before of the same world was given out long ago, and to a block that is running; only if it is not over does a block
wait for it, and so the launch ends however many blocks there is room for. What is computed is the same.
"""

# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="valid-type, empty-body"

import warp as wp


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__shared__ int next;
// all have done with what was shared, and read the last number
__syncthreads();
if (threadIdx.x == 0) {
    const int k = atomicAdd(work_counts.data + 1, 1);
    if (k < slices) {
        volatile int* over = work_counts.data + 8 * (k % worlds);
        while (*over < k / worlds) __nanosleep(200);
        // what the block before wrote of this world is seen from here on
        __threadfence();
    }
    next = k;
}
__syncthreads();
return next;
#else
return slices;
#endif
""")
def next_slice(work_counts: wp.array(dtype=int), worlds: int, slices: int) -> int:
    """Take the next of all turns, once the same world's turn before is over; ``slices`` or more says that none is left.

    Args:
        work_counts: `State.work_counts`, which nobody needs where worlds queue up, zero before the launch: of each
            world how many turns are over, and at place 1 how many are given out.
        worlds: How many worlds there are.
        slices: How many turns all of them have.
    """
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__syncthreads();
if (threadIdx.x == 0) {
    __threadfence();
    atomicAdd(work_counts.data + 8 * world, 1);
}
#endif
""")
def end_slice(work_counts: wp.array(dtype=int), world: int):
    """Say that a world's turn is over, once all threads of the block have done with it."""
    ...
