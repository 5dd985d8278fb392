"""Operations of the 32 threads of a warp on CUDA: maxima, and places in a list with one atomic for all of them.

All threads of a warp must come to these functions. On the CPU threads follow one another, and each speaks for itself.
"""

import warp as wp

WARP = 32
"""Threads of a warp."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
if (size % 32 == 0)
    for (int k = 16; k > 0; k /= 2) value = fmaxf(value, __shfl_xor_sync(0xffffffffu, value, k));
#endif
return value;
""")
def warp_max(value: float, size: int) -> float:
    """The largest value of the 32 threads."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return size % 32 != 0 || rank % 32 == 0;
#else
return true;
#endif
""")
def leads_warp(rank: int, size: int) -> bool:
    """Return True if the thread speaks for those that `warp_max` has looked at."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return size % 32 == 0;
#else
return false;
#endif
""")
def in_warps(size: int) -> bool:
    """Return True if the threads of a world are whole warps."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const unsigned all = 0xffffffffu;
if (!__any_sync(all, mine)) return 0;
const int lane = threadIdx.x % 32;
int sum = mine;
for (int k = 1; k < 32; k *= 2) {
    int below = __shfl_up_sync(all, sum, k);
    if (lane >= k) sum += below;
}
int start = 0;
if (lane == 31 && sum > 0) start = atomicAdd(&count.data[which], sum);
return __shfl_sync(all, start, 31) + sum - mine;
#else
int start = count.data[which];
count.data[which] += mine;
return start;
#endif
""")
def claim(count: wp.array(dtype=int), which: int, mine: int) -> int:
    """Raise a count by what each of the 32 threads asks for; the first place that is the thread's own."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __shfl_sync(0xffffffffu, value, lane);
#else
return value;
#endif
""")
def warp_broadcast(value: int, lane: int) -> int:
    """The value that another of the 32 threads has."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return (int)__ballot_sync(0xffffffffu, yes);
#else
return yes;
#endif
""")
def vote(yes: bool) -> int:
    """The set of those of the 32 threads that say yes."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
for (int k = 16; k > 0; k /= 2) value += __shfl_xor_sync(0xffffffffu, value, k);
#endif
return value;
""")
def sum_of_warp(value: int) -> int:
    """The sum of the 32 threads' values."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
for (int k = 16; k > 0; k /= 2) bits |= __shfl_xor_sync(0xffffffffu, bits, k);
#endif
return bits;
""")
def union_of_warp(bits: int) -> int:
    """Return the union of the sets of the 32 threads."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __popc(bits);
#else
return __builtin_popcount(bits);
#endif
""")
def size_of_set(bits: int) -> int:
    """Return the number of elements of a set."""
    ...


@wp.func
def below_in(bits: int, lane: int):
    """Return how many numbers below one, from 0 to 31, are in a set."""
    return size_of_set(bits & ((1 << lane) - 1))


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __ffs(bits) - 1;
#else
return __builtin_ctz(bits);
#endif
""")
def lowest(bits: int) -> int:
    """The smallest number in a set that is not empty."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __syncthreads_or(yes);
#else
return yes;
#endif
""")
def anyone(yes: bool) -> bool:
    """Return True if a thread of the block says yes; all wait for each other."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __any_sync(0xffffffffu, yes);
#else
return true;
#endif
""")
def any_of_warp(yes: bool) -> bool:
    """Return True if one of the 32 threads says yes; on the CPU, where they are played in turn, always."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __syncthreads_or(yes);
#else
return true;
#endif
""")
def any_of_block(yes: bool) -> bool:
    """The same of the block's threads; all wait for each other."""
    ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
__syncwarp();
#endif
""")
def sync_warp():
    """Wait for the 32 threads; what they wrote is there then."""
    ...
