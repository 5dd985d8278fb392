"""Values of a trial: arrays by name, as rows of single trials, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError


def rows_of(returned: Any, trial_count: int, name: str) -> list[dict[str, np.ndarray]]:
    """Divide what a trial returned for a batch into the values of each world.

    Raises:
        InvalidInputError: not arrays by name, or without one row for each world.
    """
    if not isinstance(returned, Mapping):
        raise InvalidInputError(f"{name} must return a dict of arrays, got {type(returned).__name__}")
    arrays = {key: _array(key, value, name) for key, value in returned.items()}
    for key, array in arrays.items():
        if array.ndim == 0 or len(array) != trial_count:
            raise InvalidInputError(
                f"{name} must return arrays with one row for each of {trial_count} worlds; {key!r} has shape "
                f"{array.shape}"
            )
    return [{key: np.array(array[k]) for key, array in arrays.items()} for k in range(trial_count)]


def single_row(returned: Any, name: str) -> dict[str, np.ndarray]:
    """Return the values of a trial of one world.

    Raises:
        InvalidInputError: not values by name.
    """
    if not isinstance(returned, Mapping):
        raise InvalidInputError(f"{name} must return a dict of values, got {type(returned).__name__}")
    return {key: _array(key, value, name) for key, value in returned.items()}


def as_json(array: np.ndarray) -> Any:
    """Return an array as JSON can hold it, every digit kept: NaN becomes null, infinity {"float": "inf"}."""
    return _encoded(array.tolist())


def from_json(data: Any) -> np.ndarray:
    """Return the array that `as_json` wrote; float32 comes back as float64."""
    return np.array(_decoded(data))


def _array(key: Any, value: Any, name: str) -> np.ndarray:
    if not isinstance(key, str):
        raise InvalidInputError(f"{name} must return values by names that are strings, got {key!r}")
    array = value.numpy() if hasattr(value, "numpy") else np.asarray(value)
    if array.dtype.kind not in "biufU":
        raise InvalidInputError(f"{name} must return numbers, bools or strings; {key!r} is of type {array.dtype}")
    # the types that a results file gives back, so that both are the same to the bit
    return array.astype({"f": np.float64, "i": np.int64, "u": np.int64}.get(array.dtype.kind, array.dtype))


def _encoded(item: Any) -> Any:
    if isinstance(item, list):
        return [_encoded(each) for each in item]
    if isinstance(item, float) and not math.isfinite(item):
        return None if math.isnan(item) else {"float": repr(item)}
    return item


def _decoded(item: Any) -> Any:
    if isinstance(item, list):
        return [_decoded(each) for each in item]
    if isinstance(item, dict):
        return float(item["float"])
    return math.nan if item is None else item
