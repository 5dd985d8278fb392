"""Paths: where a gripped point goes, as key poses in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.shapes import quaternion as quat
from nuno.validation import finite_array

INTERPOLATIONS = ("linear", "minimum_jerk")


@dataclass(frozen=True, eq=False)
class Path:
    """Key poses in the world frame; before the first key and after the last one the pose holds.

    Attributes:
        times: (k,) float [s] of the world's clock, increasing.
        positions: (k, 3) or (worlds, k, 3) float [m].
        quaternions: (k, 4) or (worlds, k, 4) float, (w, x, y, z), or None where nothing turns.
        interpolation: "linear", or "minimum_jerk": rest at every key and ``minimum_jerk`` between.

    Raises:
        InvalidInputError: times that do not increase, not finite, or shapes that do not fit.
    """

    times: np.ndarray
    positions: np.ndarray
    quaternions: np.ndarray | None = None
    interpolation: Literal["linear", "minimum_jerk"] = "linear"

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, times: ArrayLike, positions: ArrayLike, quaternions: ArrayLike | None = None,
            interpolation: Literal["linear", "minimum_jerk"] = "linear",
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        times = finite_array("times", self.times, ("k",))
        if (np.diff(times) <= 0.0).any():
            raise InvalidInputError("times must increase from key to key")
        k = len(times)
        positions = finite_array("positions", self.positions, (k, 3), ("worlds", k, 3))
        if not isinstance(self.interpolation, str) or self.interpolation not in INTERPOLATIONS:
            raise InvalidInputError(f"interpolation must be one of {INTERPOLATIONS}, got {self.interpolation!r}")
        turns = self.quaternions
        if turns is not None:
            turns = quat.unit("quaternions", turns, (k, 4), ("worlds", k, 4))
            counts = {a.shape[0] for a in (positions, turns) if a.ndim == 3}
            if len(counts) > 1:
                raise InvalidInputError(f"positions and quaternions are for different numbers of worlds: {counts}")
            turns.setflags(write=False)
        for name, array in (("times", times), ("positions", positions)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "quaternions", turns)

    @property
    def world_count(self) -> int | None:
        """The number of worlds that the path tells apart, or None where one path serves all."""
        arrays = (self.positions, self.quaternions)
        return next((a.shape[0] for a in arrays if a is not None and a.ndim == 3), None)

    def at(self, time: ArrayLike) -> np.ndarray:
        """Return positions at ``time`` [s], a number or (m,): (3,) or (m, 3), or (worlds, ...) of these."""
        first, last, s = self.keys_around(finite_array("time", time, (), ("m",)))
        a, b = self.positions[..., first, :], self.positions[..., last, :]
        return a + s[..., None] * (b - a)

    def quaternion_at(self, time: ArrayLike) -> np.ndarray:
        """Return orientations, as ``at`` returns positions; the identity where none is given."""
        first, last, s = self.keys_around(finite_array("time", time, (), ("m",)))
        if self.quaternions is None:
            return np.broadcast_to(quat.IDENTITY, (*s.shape, 4)).copy()
        return quat.slerp(self.quaternions[..., first, :], self.quaternions[..., last, :], s)

    def sampled(self, times: ArrayLike) -> Path:
        """Return a path with keys at ``times`` (m,) [s] on this one, joined by straight lines."""
        when = finite_array("times", times, ("m",))
        turns = None if self.quaternions is None else self.quaternion_at(when)
        return Path(when, self.at(when), turns)

    def keys_around(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the keys before and after and the eased fraction between them."""
        k = len(self.times)
        first = np.minimum(np.maximum(np.searchsorted(self.times, t, side="right") - 1, 0), max(k - 2, 0))
        last = np.minimum(first + 1, k - 1)
        span = np.where(last > first, self.times[last] - self.times[first], 1.0)
        s = np.minimum(np.maximum((t - self.times[first]) / span, 0.0), 1.0)
        if self.interpolation == "minimum_jerk":
            s = minimum_jerk(s)
        return first, last, s


def path_as_it_is(
    times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray | None, interpolation: str = "linear"
) -> Path:
    """Return a path through poses that bodies have: arrays as those of `Path`, whose turns keep every bit.

    What came out of the dynamics turned by a float32 is not of length 1 to the last digit, and stands as it is.
    """
    path: Path = object.__new__(Path)
    for name, array in (("times", times), ("positions", positions), ("quaternions", quaternions)):
        if array is not None:
            array = np.array(array)
            array.setflags(write=False)
        path.__dict__[name] = array
    path.__dict__["interpolation"] = interpolation
    return path


def path_through(times: np.ndarray, positions: np.ndarray) -> Path:
    """Return a path by straight lines through positions (k, 3) or (worlds, k, 3) [m], which it takes as its own.

    Arrays are not copied, as of many worlds that takes most of the time; otherwise it is as ``Path(times, positions)``.

    Args:
        times: (k,) float [s], increasing.
        positions: Nobody else is to write to them.

    Raises:
        InvalidInputError: positions that are not finite, as sums of very large ones are, or times that do not increase,
            as after a very late one.
    """
    if (np.diff(times) <= 0.0).any():
        raise InvalidInputError("times must increase from key to key")
    if not np.isfinite(positions).all():
        raise InvalidInputError("positions must be finite")
    path: Path = object.__new__(Path)
    for name, array in (("times", times), ("positions", positions)):
        array.setflags(write=False)
        path.__dict__[name] = array
    path.__dict__.update(quaternions=None, interpolation="linear")
    return path


def minimum_jerk(share: np.ndarray) -> np.ndarray:
    """Return how far a motion of least jerk, from rest to rest, is at a share of its time, both in [0, 1].

    10 s^3 - 15 s^4 + 6 s^5 (Flash and Hogan 1985).
    """
    return share**3 * (10.0 + share * (6.0 * share - 15.0))
