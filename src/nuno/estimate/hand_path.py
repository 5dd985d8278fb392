"""Hands: where they were in time, and when they held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import as_array, checked, finite_array


@dataclass(frozen=True, eq=False)
class HandPath:
    """One hand as it was seen: positions at times, and whether it held.

    Attributes:
        times: (k,) float [s], increasing.
        positions: (k, 3) float [m], where what it holds would be; straight lines between them.
        held: (k,) bool, whether it held at each time.

    Raises:
        InvalidInputError: not finite, times that do not increase, or shapes that do not fit each other.
    """

    times: np.ndarray
    positions: np.ndarray
    held: np.ndarray

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, times: ArrayLike, positions: ArrayLike, held: ArrayLike,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        times = finite_array("a hand's times", self.times, ("k",))
        later = np.diff(times)
        if (later <= 0.0).any():
            k = int(np.argmax(later <= 0.0))
            raise InvalidInputError(
                f"a hand's times must increase; number {k + 1} is {times[k + 1]} s, after {times[k]} s"
            )
        positions = finite_array("a hand's positions", self.positions, (len(times), 3))
        held = as_array("held", self.held)
        if held.shape != times.shape or held.dtype != bool:
            raise InvalidInputError(
                f"held must be bool of shape ({len(times)},), one for each time, got {held.dtype} of shape {held.shape}"
            )
        for name, array in (("times", times), ("positions", positions), ("held", held.copy())):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def holds(self) -> list[tuple[float, float]]:
        """Begin and end [s] of each hold: halfway between the last time without (with) and the first with (without).

        A hold at the first time begins there; one at the last time has no end (infinity).
        """
        held = self.held.astype(int)
        change = np.flatnonzero(np.diff(held))
        at = 0.5 * (self.times[change] + self.times[change + 1])
        begins, ends = list(at[held[change + 1] == 1]), list(at[held[change] == 1])
        if held[0]:
            begins.insert(0, float(self.times[0]))
        if held[-1]:
            ends.append(np.inf)
        return [(float(a), float(b)) for a, b in zip(begins, ends, strict=True)]

    @checked
    def at(self, time: ArrayLike) -> np.ndarray:
        """Return positions (..., 3) [m] at ``time`` (...) [s]; before the first and after the last it rests."""
        when = np.asarray(time, dtype=float)
        return np.stack([np.interp(when, self.times, self.positions[:, axis]) for axis in range(3)], axis=-1)

    @checked
    def holds_at(self, time: float) -> bool:
        """Return True if it holds at ``time`` [s]."""
        return any(begin <= time < end for begin, end in self.holds)
