"""Vectors of three numbers: the same source on floats, lanes and doubles, with the bits of coordinates written out."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from nuno.numbers.doubles import double_lane, float64
from nuno.numbers.lanes import LANES, add, div, lane, mul, sub, to_float  # noqa: F401
from nuno.numbers.vec3 import cross, dot, less_product, mat3, offset, transposed_mul, vec3


@wp.func
def _vector(x: Any, row: int):
    return vec3(x[3 * row], x[3 * row + 1], x[3 * row + 2])


@wp.func
def _write(out: Any, row: int, v: Any):
    out[3 * row] = v.x
    out[3 * row + 1] = v.y
    out[3 * row + 2] = v.z


@wp.func
def _compute(x: Any, s: Any, out: Any):
    a = _vector(x, 0)
    b = _vector(x, 1)
    m = mat3(_vector(x, 2), _vector(x, 3), _vector(x, 4))
    _write(out, 0, a + b * s[0] - cross(a, b) / s[0])
    _write(out, 1, m * a)
    _write(out, 2, transposed_mul(m, a))
    _write(out, 3, less_product(a, m, b))
    _write(out, 4, to_float(a) + 2.0 * offset(b, a))
    out[15] = dot(a, b)


@wp.kernel(enable_backward=False)
def _floats(x: wp.array(dtype=float), s: wp.array(dtype=float), out: wp.array(dtype=float)):
    _compute(x, s, out)


@wp.kernel(enable_backward=False)
def _lanes(x: wp.array(dtype=lane), s: wp.array(dtype=lane), out: wp.array(dtype=lane)):
    _compute(x, s, out)


@wp.func
def _move(x: Any, way: Any, out: Any, moved: Any):
    a = _vector(x, 0)
    b = _vector(x, 1)
    _write(out, 0, a - b)
    _write(out, 1, offset(a, b))
    _write(out, 2, to_float(a))
    _write(moved, 0, a + _vector(way, 0))
    _write(moved, 1, a - _vector(way, 0))


@wp.kernel(enable_backward=False)
def _doubles(
    x: wp.array(dtype=float64), way: wp.array(dtype=float), out: wp.array(dtype=float), moved: wp.array(dtype=float64)
):
    _move(x, way, out, moved)


@wp.kernel(enable_backward=False)
def _double_lanes(
    x: wp.array(dtype=double_lane),
    way: wp.array(dtype=lane),
    out: wp.array(dtype=lane),
    moved: wp.array(dtype=double_lane),
):
    _move(x, way, out, moved)


def _array(values, dtype):
    """Numbers (n, lanes) as Warp's array of floats (one lane) or of lanes."""
    return wp.array(values[:, 0] if values.shape[1] == 1 else values, dtype=dtype, device="cpu")


@pytest.mark.parametrize(("kernel", "number", "lanes"), [(_floats, float, 1), (_lanes, lane, LANES)])
def test_vectors_have_the_bits_of_their_coordinates(kernel, number, lanes):
    """Sums run from x to z and each operation is rounded by itself, on floats as in lanes."""
    x = np.random.default_rng(1).normal(size=(15, lanes)).astype(np.float32)
    s = np.full((1, lanes), 0.7, np.float32)
    out = wp.zeros(16, dtype=number, device="cpu")
    wp.launch(kernel, dim=1, inputs=[_array(x, number), _array(s, number), out], device="cpu")
    a, b, m = x[:3], x[3:6], x[6:].reshape(3, 3, lanes)
    c = np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
    expected = [
        a + b * s - c / s,
        m[:, 0] * a[0] + m[:, 1] * a[1] + m[:, 2] * a[2],
        m[0] * a[0] + m[1] * a[1] + m[2] * a[2],
        a - m[:, 0] * b[0] - m[:, 1] * b[1] - m[:, 2] * b[2],
        a + np.float32(2.0) * b,
        (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])[None],
    ]
    np.testing.assert_array_equal(out.numpy().reshape(16, lanes), np.concatenate(expected))


@pytest.mark.parametrize(
    ("kernel", "number", "place", "lanes"), [(_doubles, float, float64, 1), (_double_lanes, lane, double_lane, LANES)]
)
def test_places_in_doubles_lose_no_digits(kernel, number, place, lanes):
    """A difference of places is rounded once, to floats, and a move by floats is added in doubles."""
    rng = np.random.default_rng(2)
    x = 0.5 + 1.0e-9 * rng.normal(size=(6, lanes))
    way = (1.0e-9 * rng.normal(size=(3, lanes))).astype(np.float32)
    out, moved = wp.zeros(9, dtype=number, device="cpu"), wp.zeros(6, dtype=place, device="cpu")
    wp.launch(kernel, dim=1, inputs=[_array(x, place), _array(way, number), out, moved], device="cpu")
    a, b = x[:3], x[3:]
    expected = np.concatenate([a - b, a - b, a]).astype(np.float32)
    np.testing.assert_array_equal(out.numpy().reshape(9, lanes), expected)
    np.testing.assert_array_equal(moved.numpy().reshape(6, lanes), np.concatenate([a + way, a - way]))
