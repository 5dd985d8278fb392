"""Samplers: parameters drawn at random between bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.validation import finite_array


@dataclass(frozen=True)
class Uniform:
    """Draws each parameter evenly between its bounds, for ``nuno.sweep(trial, Uniform(...), samples=100)``.

    Attributes:
        bounds: (low, high) by name.
        log: Names that are drawn evenly in their logarithm.

    Raises:
        InvalidInputError: bounds that are not two finite, increasing numbers, or not positive where log is wanted.
        UnknownNameError: a name in ``log`` that has no bounds.
    """

    bounds: Mapping[str, tuple[float, float]]
    log: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_bounds(self.bounds, self.log)

    def __call__(self, random: np.random.Generator) -> dict[str, float]:
        """Return one trial's parameters."""
        return {name: scaled(float(random.random()), self.bounds[name], name in self.log) for name in self.bounds}


def check_bounds(bounds: Mapping[str, tuple[float, float]], log: Sequence[str]) -> None:
    """Check that there are bounds, each low < high, and positive where they are in ``log``.

    Raises:
        InvalidInputError: they are not so.
        UnknownNameError: a name in ``log`` that has no bounds.
    """
    if not isinstance(bounds, Mapping) or not bounds:
        raise InvalidInputError(f"bounds must be (low, high) by name, got {bounds!r}")
    if isinstance(log, str) or not isinstance(log, Sequence | set | frozenset):
        raise InvalidInputError(f"log must be a sequence of names, got {log!r}")
    for name in log:
        if not isinstance(name, str) or name not in bounds:
            raise UnknownNameError("bound", name, list(bounds))
    for name, pair in bounds.items():
        low, high = finite_array(f"the bounds of {name!r}", pair, (2,))
        if low >= high:
            raise InvalidInputError(f"the bounds of {name!r} must be low < high, got {low:g} and {high:g}")
        if name in log and low <= 0.0:
            raise InvalidInputError(f"the bounds of {name!r} must be positive for a log scale, got {low:g}")


def scaled(share: float, bounds: tuple[float, float], log: bool) -> float:
    """Return the value at a share [0, 1] of the way from low to high, or of their logarithms."""
    low, high = float(bounds[0]), float(bounds[1])
    value = math.exp(math.log(low) + share * math.log(high / low)) if log else low + share * (high - low)
    return min(max(value, low), high)


def share_of(value: float, bounds: tuple[float, float], log: bool) -> float:
    """Return at which share of the way from low to high a value lies, the inverse of `scaled`."""
    low, high = float(bounds[0]), float(bounds[1])
    return math.log(value / low) / math.log(high / low) if log else (value - low) / (high - low)
