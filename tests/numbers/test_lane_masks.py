"""Masks of lanes, bit by bit."""

import numpy as np
import warp as wp

from nuno.numbers.lane_masks import in_lanes, lanes_without, lanes_without_bits
from nuno.numbers.lanes import LANES, lane, lane_int


@wp.kernel
def mask_lanes(a: wp.array(dtype=lane), mask: wp.array(dtype=int), masked: wp.array(dtype=lane)):
    """Find the lanes of a number that are not above zero, and put another number there."""
    mask[0] = lanes_without(a[0])
    masked[0] = in_lanes(a[0], mask[0], -7.0)


def test_lanes_not_above_zero_are_found_and_replaced():
    """Zero, too, has no place among what is above zero; what has one stays, to the bit."""
    values = np.array([1.0, -1.0, 0.0, 2.5, *np.linspace(-3.0, 3.0, LANES - 4)], dtype=np.float32)
    given, mask, masked = wp.array([values], dtype=lane), wp.zeros(1, dtype=int), wp.zeros(1, dtype=lane)
    wp.launch(mask_lanes, 1, inputs=[given, mask, masked])
    below = values <= 0.0
    assert int(mask.numpy()[0]) == sum(1 << k for k in np.flatnonzero(below))
    np.testing.assert_array_equal(masked.numpy()[0], np.where(below, np.float32(-7.0), values))


@wp.kernel
def mask_lanes_by_bits(a: wp.array(dtype=lane_int), bits: int, mask: wp.array(dtype=int)):
    """Find the lanes in which none of three whole numbers has any of some bits."""
    mask[0] = lanes_without_bits(a[0], a[1], a[2], bits)


def test_lanes_in_which_no_number_has_a_bit_are_found():
    """One of three numbers that has one of the bits is enough."""
    values = np.random.default_rng(0).integers(0, 8, (3, LANES)).astype(np.int32)
    mask = wp.zeros(1, dtype=int)
    wp.launch(mask_lanes_by_bits, 1, inputs=[wp.array(values, dtype=lane_int), 5, mask])
    without = ((values & 5) == 0).all(axis=0)
    assert 0 < without.sum() < LANES
    assert int(mask.numpy()[0]) == sum(1 << k for k in np.flatnonzero(without))
