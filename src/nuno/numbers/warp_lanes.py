"""The 32 lanes of a CUDA warp, and what they hand to each other: a number, or a vector of three.

All lanes of a warp must come to an exchange. `Lane.exchanged` plays it on the CPU, where a kernel goes through one lane
after the other: each writes there what it hands over, and takes from there what another handed over when all were gone
through the time before. Once nothing there changes any more, every lane has had what it would have had beside the
others. `tests/plans` hold CUDA's methods to their plain constraints that way; no plan on the CPU comes here.
"""

import warp as wp

from nuno.numbers.vec3 import Vec3, vec3
from nuno.numbers.warps import WARP

LANES_OF_WARP = wp.constant(WARP)


@wp.struct
class Lane:
    """A thread as a lane of its warp."""

    lane: int
    warp: int  # its number among the block's
    warps: int  # of the block
    exchanged: wp.array(dtype=float)  # on the CPU: the number of the next exchange, then a row of 32 numbers for each


@wp.func
def lane_of(rank: int, size: int):
    """Thread ``rank`` of a block of ``size``, whole warps."""
    own = Lane()
    own.lane = rank % LANES_OF_WARP
    own.warp = rank / LANES_OF_WARP
    own.warps = size / LANES_OF_WARP
    return own


SHUFFLES = """
#if defined(__CUDA_ARCH__)
auto shuffle = [&](float v, int source) { return __shfl_sync(0xffffffffu, v, source); };
auto shuffle_up = [&](float v, int shift, int span) { return __shfl_up_sync(0xffffffffu, v, shift, span); };
auto shuffle_down = [&](float v, int shift, int span) { return __shfl_down_sync(0xffffffffu, v, shift, span); };
#else
auto play = [&](float v) {
    const int next = (int)exchanged.data[0];
    float* row = exchanged.data + 1 + 32 * next;
    exchanged.data[0] = next + 1;
    row[lane] = v;
    return row;
};
auto shuffle = [&](float v, int source) { return play(v)[source]; };
auto shuffle_up = [&](float v, int shift, int span) { return play(v)[lane % span < shift ? lane : lane - shift]; };
auto shuffle_down = [&](float v, int shift, int span) {
    return play(v)[lane % span + shift < span ? lane + shift : lane];
};
#endif
"""
"""C++ of the exchanges, for natives with the arguments ``exchanged`` and ``lane``."""


@wp.func_native(f"{SHUFFLES}return shuffle_up(value, shift, span);")
def from_below(exchanged: wp.array(dtype=float), lane: int, value: float, shift: int, span: int) -> float:
    """The value of the lane ``shift`` below among ``span`` neighbours; where there is none, the lane's own."""
    ...


@wp.func_native(f"{SHUFFLES}return shuffle_down(value, shift, span);")
def from_above(exchanged: wp.array(dtype=float), lane: int, value: float, shift: int, span: int) -> float:
    """The value of the lane ``shift`` above among ``span`` neighbours; where there is none, the lane's own."""
    ...


@wp.func
def below(own: Lane, v: Vec3, span: int):
    """The vector of the lane below."""
    x = from_below(own.exchanged, own.lane, v.x, 1, span)
    y = from_below(own.exchanged, own.lane, v.y, 1, span)
    return vec3(x, y, from_below(own.exchanged, own.lane, v.z, 1, span))


@wp.func
def above(own: Lane, v: Vec3, span: int):
    """The vector of the lane above."""
    x = from_above(own.exchanged, own.lane, v.x, 1, span)
    y = from_above(own.exchanged, own.lane, v.y, 1, span)
    return vec3(x, y, from_above(own.exchanged, own.lane, v.z, 1, span))


@wp.func
def quotient(a: int, b: int):
    """The quotient of two counts of which neither is large, by the float unit: a tenth of an integer division."""
    return int((float(a) + 0.5) / float(b))
