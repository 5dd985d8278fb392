"""Unit quaternions (w, x, y, z): the arithmetic of orientations, over any leading axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
ROUNDING = 4.0 * np.finfo(float).eps
"""Tolerance of a unit quaternion's length, after division by its length."""


def unit(name: str, value: Any, *shapes: tuple[int | str, ...]) -> np.ndarray:
    """Return ``value`` as unit quaternions of one of the given shapes; those of length 1 stay as they are, to the bit.

    Raises:
        InvalidInputError: another shape, not finite, or of length zero.
    """
    q = finite_array(name, value, *shapes)
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if (length < 1e-9).any():
        raise InvalidInputError(f"{name} must not be of length zero; no rotation is (1, 0, 0, 0)")
    return np.where(np.abs(length - 1.0) <= ROUNDING, q, q / length)


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the product a b, the rotation b followed by a; (..., 4) each."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    q = np.empty((*w.shape, 4))
    q[..., 0] = w
    q[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    q[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    q[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return q


def inverse(q: np.ndarray) -> np.ndarray:
    """Return the inverse of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Rotate vectors (..., 3) by unit quaternions (..., 4); exact for the identity."""
    u, w = q[..., 1:], q[..., :1]
    t = 2.0 * _cross(u, v)
    return v + w * t + _cross(u, t)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the same as ``np.cross`` to the bit, of (..., 3) each, in a third of its time."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    x = ay * bz - az * by
    c = np.empty((*x.shape, 3))
    c[..., 0] = x
    c[..., 1] = az * bx - ax * bz
    c[..., 2] = ax * by - ay * bx
    return c


def from_axis_angle(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the rotation about unit axes (..., 3) by angles (...) [rad]."""
    half = 0.5 * np.asarray(angle, dtype=float)
    sine = np.sin(half)[..., None] * axis
    cosine = np.broadcast_to(np.cos(half)[..., None], (*sine.shape[:-1], 1))
    return np.concatenate([cosine, sine], axis=-1)


def to_matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    return np.swapaxes(rotate(q[..., None, :], np.eye(3)), -1, -2)


def slerp(a: np.ndarray, b: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Interpolate the short way from a (s = 0) to b (s = 1); a, b (..., 4), s (...). Equal ones stay."""
    same = (a == b).all(axis=-1, keepdims=True)
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0.0, -b, b)
    if np.ndim(s) == 0 and s in (0.0, 1.0):  # at an end, to the bit as below
        q = 0.0 * a + b if s == 1.0 else a + 0.0 * b
        return np.where(same, a, q / np.linalg.norm(q, axis=-1, keepdims=True))
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    near = angle < 1e-6  # the weights below are 0/0 there, and their limit is linear
    safe = np.where(near, 1.0, np.sin(angle))
    s = np.asarray(s, dtype=float)[..., None]
    first = np.where(near, 1.0 - s, np.sin((1.0 - s) * angle) / safe)
    second = np.where(near, s, np.sin(s * angle) / safe)
    q = first * a + second * b
    return np.where(same, a, q / np.linalg.norm(q, axis=-1, keepdims=True))
