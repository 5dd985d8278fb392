"""Knots: a smooth motion of some numbers through few of them, as a planner varies it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.shapes.path import Path, path_through
from nuno.validation import checked, finite_array, number

LONGEST = 3600.0
"""[s] That a motion may take."""


@dataclass(frozen=True, eq=False)
class Knots:
    """A motion of d numbers from where they are now through k knots, evenly spread over a time.

    Between knots runs a cubic that keeps to monotone stretches (PCHIP: Fritsch and Butland, SIAM J. Sci. Stat. Comput.
    5, 1984): the motion never leaves the range of its knots, so bounds of knots are bounds of the motion. After the
    last knot it rests there.

    Attributes:
        now: (d,), at time 0; or (n, d), of each of n worlds.
        values: (k, d), the j-th at (j + 1) / k of the time; or (n, k, d).
        seconds: When the last knot is reached [s].

    Raises:
        InvalidInputError: not finite, shapes that do not fit, or a time that is not positive or above an hour.
    """

    now: np.ndarray
    values: np.ndarray
    seconds: float

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(self, now: ArrayLike, values: ArrayLike, seconds: float) -> None: ...

    def __post_init__(self) -> None:
        values = finite_array("values", self.values, ("k", "d"), ("n", "k", "d"))
        d = values.shape[-1]
        now = finite_array("now", self.now, (d,), ("n", d) if values.ndim == 2 else (len(values), d))
        if now.ndim == 2 and values.ndim == 2:
            raise InvalidInputError(f"now of {len(now)} worlds needs values of each of them, (n, k, d)")
        for name, array in (("now", now), ("values", values)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "seconds", number("seconds", self.seconds, above=0.0, high=LONGEST))

    @property
    def world_count(self) -> int | None:
        """The number of worlds that the motion tells apart, or None where one motion serves all."""
        return len(self.values) if self.values.ndim == 3 else None

    @checked
    def at(self, times: ArrayLike) -> np.ndarray:
        """Return the numbers at ``times`` (m,) [s] from now: (m, d) or (n, m, d)."""
        from scipy.interpolate import PchipInterpolator

        when = np.clip(finite_array("times", times, ("m",)), 0.0, self.seconds)
        count = self.values.shape[-2]
        first = np.broadcast_to(self.now[..., None, :], (*self.values.shape[:-2], 1, self.now.shape[-1]))
        keys = np.concatenate([first, self.values], axis=-2)
        spline = PchipInterpolator(np.linspace(0.0, self.seconds, count + 1), keys, axis=-2)
        return np.asarray(spline(when))

    @checked
    def path(self, begin: float, columns: slice | Sequence[int] = slice(0, 3), step: float = 1.0 / 60.0) -> Path:
        """Return three of the numbers as a path of positions, for a grip or a body.

        Args:
            begin: The world's time now [s].
            columns: Which three.
            step: Between keys of the path [s].

        Raises:
            InvalidInputError: other than three columns, or ones that there are not.
        """
        t0, span = number("begin", begin), number("step", step, above=0.0)
        count = max(1, int(np.ceil(min(self.seconds / span, 1e6) - 1e-9)))
        times = np.linspace(0.0, self.seconds, count + 1)
        try:
            now, values = (part[..., columns] for part in (self.now, self.values))  # type: ignore[index]
        except (IndexError, TypeError, ValueError):
            now = values = times
        if values.shape[-1] != 3 or values.ndim != self.values.ndim:
            raise InvalidInputError(f"columns must choose 3 of {self.now.shape[-1]} numbers, got {columns!r}")
        return path_through(t0 + times, Knots(now, values, self.seconds).at(times))

    @checked
    def later(self, seconds: float, *, shrink: bool = False) -> Knots:
        """Return what is left of the motion after ``seconds`` [s], with as many knots.

        Args:
            seconds: [s].
            shrink: The rest ends when this motion ends; else it takes as long as this, and rests in the end.

        Raises:
            InvalidInputError: with ``shrink``, nothing is left.
        """
        elapsed = number("seconds", seconds, low=0.0)
        left = self.seconds - elapsed if shrink else self.seconds
        if left <= 1e-9:
            raise InvalidInputError(f"after {elapsed:g} s nothing is left of a motion of {self.seconds:g} s")
        count = self.values.shape[-2]
        values = self.at(elapsed + np.linspace(0.0, left, count + 1))
        return Knots(values[..., 0, :], values[..., 1:, :], left)
