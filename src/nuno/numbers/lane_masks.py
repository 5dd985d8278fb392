"""Masks of lanes, bit by bit: what worlds that share a vector have apart, such as lists that each would make alone."""

import warp as wp

from nuno.numbers.lanes import LANES, lane, lane_int

ALL_LANES = wp.constant((1 << LANES) - 1)
"""All lanes, bit by bit."""


@wp.func
def lanes_without(a: float):
    """Return the lanes, bit by bit, in which a number is not above zero; 0 of a number by itself."""
    return 0


@wp.func
def lanes_without(a: lane):
    found = int(0)
    lanes = int(LANES)  # a variable, or Warp would unroll the loop
    for k in range(lanes):
        if a[k] <= 0.0:
            found = found | (1 << k)
    return found


@wp.func
def in_lanes(a: float, lanes: int, other: float):
    """Return a number, but ``other`` in the lanes given bit by bit."""
    return a


@wp.func
def in_lanes(a: lane, lanes: int, other: float):
    result = a
    if lanes != 0:
        count = int(LANES)
        for k in range(count):
            if (lanes >> k) & 1 != 0:
                result[k] = other
    return result


@wp.func
def lanes_without_bits(a: lane_int, b: lane_int, c: lane_int, bits: int):
    """Return the lanes, bit by bit, in which none of three whole numbers has any of some bits."""
    found = int(0)
    lanes = int(LANES)
    for k in range(lanes):
        if ((a[k] | b[k] | c[k]) & bits) == 0:
            found = found | (1 << k)
    return found
