"""Arithmetic on sixteen numbers at once against numpy's, to the bit."""

import numpy as np
import warp as wp

from nuno.numbers.lanes import LANES, add, choose, div, lane, maximum, minimum, mul, sub  # noqa: F401

COUNT = 17


@wp.kernel(enable_backward=False)
def _all_kinds(a: wp.array(dtype=lane), b: wp.array(dtype=lane), s: float, out: wp.array(dtype=lane)):
    x = a[0]
    y = b[0]
    out[0] = x + y
    out[1] = x + s
    out[2] = s + x
    out[3] = x - y
    out[4] = x - s
    out[5] = s - x
    out[6] = x * y
    out[7] = x * s
    out[8] = s * x
    out[9] = x / y
    out[10] = x / s
    out[11] = s / x
    out[12] = minimum(x, s)
    out[13] = maximum(s, x)
    out[14] = choose(y, s, x)
    out[15] = choose(y, x, s)
    out[16] = choose(y, s, 2.0)


def test_lanes_and_numbers_give_the_bits_of_single_floats():
    """Every operator, with a number for all lanes on either side, rounds as the same operation on floats does."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, LANES)).astype(np.float32)
    s = np.float32(0.3)
    out = wp.zeros(COUNT, dtype=lane, device="cpu")
    inputs = [wp.array(v[None], dtype=lane, device="cpu") for v in (a, b)]
    wp.launch(_all_kinds, dim=1, inputs=[*inputs, float(s), out], device="cpu")
    same = np.full(LANES, s)
    expected = [
        *(a + b, a + s, s + a, a - b, a - s, s - a, a * b, a * s, s * a, a / b, a / s, s / a),
        *(np.minimum(a, s), np.maximum(s, a), np.where(b > 0, same, a), np.where(b > 0, a, same)),
        np.where(b > 0, s, np.float32(2.0)),
    ]
    np.testing.assert_array_equal(out.numpy(), np.stack(expected))
