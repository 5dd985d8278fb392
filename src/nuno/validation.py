"""Checks of what a caller passes in: finite, of a valid shape, in range.

Every check runs before any state changes, and its message says what was received and what is valid.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from nuno.errors import InvalidInputError, UnknownNameError

Shape = tuple[int | str, ...]
Kind = TypeVar("Kind")


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
        if array.dtype.kind not in "iufO":
            raise ValueError(f"{array.dtype} is no real number")
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
    except (TypeError, ValueError, OverflowError) as problem:
        raise error(f"{name} must be indices of shape {_shape_text(shapes)}, got {_short(value)}") from problem
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
        if isinstance(value, str | bytes | bool | np.bool_ | np.datetime64 | np.timedelta64) or np.ndim(value):
            raise TypeError("no number")
        result = float(value)
    except (TypeError, ValueError, OverflowError) as problem:
        wanted = "a finite number" if valid == "finite" else f"a number {valid}"
        raise InvalidInputError(f"{name} must be {wanted}, got {_short(value)}") from problem
    if not np.isfinite(result) or result < low or result <= above or result > high:
        raise InvalidInputError(f"{name} must be {valid}, got {result}")
    return result


def count(name: str, value: Any, *, low: int = 1, high: int | None = None) -> int:
    """Return ``value`` as an int of at least ``low`` and, where one is given, at most ``high``.

    Raises:
        InvalidInputError: not a whole number, too small or too large.
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < low or (high is not None and value > high):
        valid = f"of at least {low}" if high is None else f"from {low} to {high}"
        raise InvalidInputError(f"{name} must be a whole number {valid}, got {_short(value)}")
    return int(value)


def flag(name: str, value: Any) -> bool:
    """Return ``value`` as a bool.

    Raises:
        InvalidInputError: neither True nor False.
    """
    if not isinstance(value, bool | np.bool_):
        raise InvalidInputError(f"{name} must be True or False, got {_short(value)}")
    return bool(value)


def instance(name: str, value: Any, kind: type[Kind]) -> Kind:
    """Return ``value``, of a class.

    Raises:
        InvalidInputError: of another class.
    """
    if not isinstance(value, kind):
        raise InvalidInputError(f"{name} must be a {kind.__name__}, got {_short(value)}")
    return value


def function(name: str, value: Any) -> Any:
    """Return ``value``, which can be called.

    Raises:
        InvalidInputError: it cannot.
    """
    if not callable(value):
        raise InvalidInputError(f"{name} must be a function, got {_short(value)}")
    return value


def choice(name: str, value: Any, valid: Sequence[str]) -> str:
    """Return ``value``, one of the valid names.

    Raises:
        UnknownNameError: it is none of them.
    """
    if not isinstance(value, str) or value not in valid:
        raise UnknownNameError(name, value, list(valid))
    return value


def text(name: str, value: Any) -> str:
    """Return ``value``, text that is not empty.

    Raises:
        InvalidInputError: no text, or none in it.
    """
    if not isinstance(value, str) or not value:
        raise InvalidInputError(f"{name} must be text that is not empty, got {_short(value)}")
    return value


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def _fits(actual: tuple[int, ...], wanted: Shape) -> bool:
    if len(actual) != len(wanted):
        return False
    return all(a >= 1 if isinstance(w, str) else a == w for a, w in zip(actual, wanted, strict=True))


def _shape_text(shapes: tuple[Shape, ...]) -> str:
    return " or ".join("(" + ", ".join(map(str, s)) + ("," if len(s) == 1 else "") + ")" for s in shapes)
