"""Checks of what a caller passes in: finite, of a valid shape, in range.

Every check runs before any state changes, and its message says what was received and what is valid.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.errors import InvalidInputError

Shape = tuple[int | str, ...]


def finite_array(name: str, value: Any, *shapes: Shape, error: type[Exception] = InvalidInputError) -> np.ndarray:
    """Return ``value`` as a new float64 array of one of the given shapes.

    Args:
        name: What the value is, for the message.
        value: Anything that NumPy makes an array of.
        shapes: Valid shapes; a string stands for any length of at least one, e.g. ``("k", 3)``.
        error: The error to raise.

    Raises:
        InvalidInputError: (or ``error``) not numbers, not finite, or of another shape.
    """
    try:
        array = np.array(value)
        if array.dtype.kind in "SU":
            raise ValueError("text is no number")
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(f"{name} must be numbers of shape {_shape_text(shapes)}, got {_short(value)}") from problem
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise error(f"{name} must have shape {_shape_text(shapes)}, got {array.shape}")
    if not np.isfinite(array).all():
        raise error(f"{name} must be finite, got {np.count_nonzero(~np.isfinite(array))} values that are not")
    return array


def index_array(name: str, value: Any, *shapes: Shape, low: int, high: int,
                error: type[Exception] = InvalidInputError) -> np.ndarray:  # fmt: skip
    """Return ``value`` as a new int32 array of one of the given shapes, every index in [low, high).

    Raises:
        InvalidInputError: (or ``error``) not whole numbers, out of range, or of another shape.
    """
    try:
        array = np.array(value)
    except ValueError as problem:
        raise error(f"{name} must be indices of shape {_shape_text(shapes)}, got {value!r}") from problem
    if array.dtype.kind not in "iu":
        raise error(f"{name} must be whole numbers of shape {_shape_text(shapes)}, got {array.dtype}")
    if not any(_fits(array.shape, shape) for shape in shapes):
        raise error(f"{name} must have shape {_shape_text(shapes)}, got {array.shape}")
    if array.min() < low or array.max() >= high:
        raise error(f"{name} must lie in [{low}, {high - 1}], got {array.min()} to {array.max()}")
    return array.astype(np.int32)


def number(name: str, value: Any, *, low: float = -np.inf, above: float = -np.inf, high: float = np.inf) -> float:
    """Return ``value`` as a finite float with low <= value <= high and value > above.

    Raises:
        InvalidInputError: not a number, not finite, or out of range.
    """
    valid = f"> {above:g}" if above > -np.inf else f">= {low:g}" if low > -np.inf else "finite"
    if high < np.inf:
        valid += f" and <= {high:g}"
    try:
        if isinstance(value, str | bytes | bool):
            raise TypeError("no number")
        result = float(value)
    except (TypeError, ValueError, OverflowError) as problem:
        wanted = "a finite number" if valid == "finite" else f"a number {valid}"
        raise InvalidInputError(f"{name} must be {wanted}, got {_short(value)}") from problem
    if not np.isfinite(result) or result < low or result <= above or result > high:
        raise InvalidInputError(f"{name} must be {valid}, got {result}")
    return result


def count(name: str, value: Any, *, low: int = 1) -> int:
    """Return ``value`` as an int of at least ``low``.

    Raises:
        InvalidInputError: not a whole number, or too small.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < low:
        raise InvalidInputError(f"{name} must be a whole number of at least {low}, got {value!r}")
    return int(value)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def _fits(actual: tuple[int, ...], wanted: Shape) -> bool:
    if len(actual) != len(wanted):
        return False
    return all(a >= 1 if isinstance(w, str) else a == w for a, w in zip(actual, wanted, strict=True))


def _shape_text(shapes: tuple[Shape, ...]) -> str:
    return " or ".join("(" + ", ".join(map(str, s)) + ("," if len(s) == 1 else "") + ")" for s in shapes)
