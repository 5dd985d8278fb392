"""Joint trajectories: where joints are to be and when, and the splines between those points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.validation import checked, finite_array

LONGEST = 1e9
"""[s] That a trajectory may take: the wire has 32 bits for it."""


@dataclass(frozen=True, eq=False)
class JointTrajectory:
    """Points that joints go through; between them splines as ros2_control's joint_trajectory_controller has them.

    Positions alone are joined by straight lines, with velocities by cubic splines, with accelerations also by quintic
    ones.

    Attributes:
        names: Of the joints, m of them, each once.
        times: (k,) float [s] from the start of the trajectory, not negative and increasing.
        positions: (k, m) float [rad; m for slides].
        velocities: (k, m) float [rad/s; m/s], or None.
        accelerations: (k, m) float [rad/s2; m/s2], or None; only with velocities.

    Raises:
        InvalidInputError: no joints or one twice; times that do not increase or are beyond ``LONGEST``; not finite;
            shapes that do not fit.
    """

    names: tuple[str, ...]
    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray | None = None
    accelerations: np.ndarray | None = None

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, names: Sequence[str], times: ArrayLike, positions: ArrayLike,
            velocities: ArrayLike | None = None, accelerations: ArrayLike | None = None,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        names = joint_names(self.names)
        if not names or not all(isinstance(name, str) for name in names):
            raise InvalidInputError(f"a trajectory needs the names of its joints, got {self.names!r}")
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InvalidInputError(f"a trajectory has each joint once; {twice!r} is in it twice")
        times = finite_array("times", self.times, ("k",))
        wrong = np.flatnonzero(np.diff(times) <= 0.0)
        if times[0] < 0.0 or wrong.size:
            what = f"the first is {times[0]:g} s"
            if times[0] >= 0.0:
                what = f"point {wrong[0] + 1} is at {times[wrong[0] + 1]:g} s, after {times[wrong[0]]:g} s"
            raise InvalidInputError(f"times must be at least 0 and increase from point to point: {what}")
        if times[-1] > LONGEST:
            raise InvalidInputError(f"a trajectory takes at most {LONGEST:g} s, got {times[-1]:g} s")
        if self.velocities is None and self.accelerations is not None:
            raise InvalidInputError("accelerations need velocities beside them")
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "times", times)
        for what in ("positions", "velocities", "accelerations"):
            value = getattr(self, what)
            if value is not None or what == "positions":
                value = finite_array(what, value, (len(times), len(names)))
                value.setflags(write=False)
                object.__setattr__(self, what, value)
        times.setflags(write=False)

    @property
    def duration(self) -> float:
        """Return when the last point is due [s]."""
        return float(self.times[-1])

    @checked
    def of(self, names: Sequence[str]) -> JointTrajectory:
        """Return the part of some joints, in their order.

        Raises:
            UnknownNameError: a joint that is not in the trajectory.
        """
        for name in names:
            if name not in self.names:
                raise UnknownNameError("joint of the trajectory", name, list(self.names))
        columns = [self.names.index(name) for name in names]
        velocities = None if self.velocities is None else self.velocities[:, columns]
        accelerations = None if self.accelerations is None else self.accelerations[:, columns]
        return JointTrajectory(tuple(names), self.times, self.positions[:, columns], velocities, accelerations)


Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Positions, velocities and accelerations (m,) of some joints at one time."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A polynomial that joints follow for a while.

    Attributes:
        start: When it begins [s].
        end: When the next one takes over [s].
        coefficients: (6, m) float, of the powers 0 to 5 of the time since ``start``.
    """

    start: float
    end: float
    coefficients: np.ndarray

    def at(self, time: float) -> Motion:
        """Return the motion of the joints at a time [s]."""
        return evaluate(with_derivatives(self.coefficients), time - self.start)


@dataclass(frozen=True, eq=False)
class Spline:
    """A trajectory from how the joints move when it begins.

    Attributes:
        start: When the trajectory begins [s].
        joined: When the joints begin to follow it [s], at its start or later, where it came late.
        first: Motion of the joints then.
        trajectory: Where they go.
    """

    start: float
    joined: float
    first: Motion
    trajectory: JointTrajectory

    @property
    def end(self) -> float:
        """Return when the last point is due [s]."""
        return self.start + self.trajectory.duration

    @property
    def order(self) -> int:
        """Of the polynomials between points: 1, 3 or 5."""
        if self.trajectory.velocities is None:
            return 1
        return 3 if self.trajectory.accelerations is None else 5

    def at(self, time: float) -> Motion:
        """Return the motion of the joints at a time [s]; after the end they rest at the last point."""
        return self.piece(time).at(time)

    def piece(self, time: float) -> Piece:
        """Return the polynomial that holds at a time [s]."""
        times = self.trajectory.times
        t = time - self.start
        if t >= times[-1]:
            return Piece(self.end, np.inf, resting_at(self.trajectory.positions[-1]))
        k = int(np.searchsorted(times, t, side="right"))  # the point that comes next
        before, begin = (self.first, self.joined - self.start) if k == 0 else (self._point(k - 1), float(times[k - 1]))
        span = float(times[k]) - begin
        found = coefficients(before, self._point(k), span, self.order)
        return Piece(self.start + begin, self.start + float(times[k]), found)

    def _point(self, k: int) -> Motion:
        own = self.trajectory
        rest = np.zeros(len(own.names))
        return (
            own.positions[k],
            rest if own.velocities is None else own.velocities[k],
            rest if own.accelerations is None else own.accelerations[k],
        )


def passing_velocities(steps: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """Return velocities with which joints pass the points of a way, and rest at its last.

    The mean of those before and after, or none where these differ in sign or take no time.

    Args:
        steps: (..., k, n) from each point to the next [rad; m for slides], the first one from where the joints are.
        spans: (k,) what each takes [s].
    """
    slopes = np.divide(steps, spans[:, None], out=np.zeros_like(steps), where=spans[:, None] > 0.0)
    found = np.zeros_like(steps)
    before, after = steps[..., :-1, :], steps[..., 1:, :]
    mean = 0.5 * (slopes[..., :-1, :] + slopes[..., 1:, :])
    found[..., :-1, :] = np.where(before * after >= 0.0, mean, 0.0)
    found[..., :-1, :][..., (spans[:-1] <= 0.0) | (spans[1:] <= 0.0), :] = 0.0
    return found


def resting_at(positions: np.ndarray) -> np.ndarray:
    """Return the coefficients (6, m) of joints that rest."""
    found = np.zeros((6, len(positions)))
    found[0] = positions
    return found


def coefficients(a: Motion, b: Motion, span: float, order: int) -> np.ndarray:
    """Return the polynomials (6, m) that lead from one motion to another.

    Args:
        a: At the beginning; of order 1 its positions count, of order 3 velocities too, of order 5 all.
        b: At the end, likewise.
        span: How long it takes, positive [s].
        order: 1, 3 or 5.
    """
    (p0, v0, a0), (p1, v1, a1) = a, b
    found = np.zeros((6, len(p0)))
    mean = (p1 - p0) / span
    found[0] = p0
    if order == 1:
        found[1] = mean
        return found
    found[1] = v0
    if order == 3:
        found[2] = (3.0 * mean - 2.0 * v0 - v1) / span
        found[3] = (v0 + v1 - 2.0 * mean) / span**2
        return found
    found[2] = 0.5 * a0
    found[3] = (20.0 * mean - 8.0 * v1 - 12.0 * v0 + (a1 - 3.0 * a0) * span) / (2.0 * span**2)
    found[4] = (-30.0 * mean + 14.0 * v1 + 16.0 * v0 + (3.0 * a0 - 2.0 * a1) * span) / (2.0 * span**3)
    found[5] = (12.0 * mean - 6.0 * (v1 + v0) + (a1 - a0) * span) / (2.0 * span**4)
    return found


def with_derivatives(polynomials: np.ndarray) -> np.ndarray:
    """Return the coefficients (6, 3, m) of polynomials (6, m) and of their first and second derivatives."""
    found = np.zeros((6, 3, polynomials.shape[1]))
    found[:, 0] = polynomials
    found[:5, 1] = np.arange(1.0, 6.0)[:, None] * polynomials[1:]
    found[:4, 2] = np.array([2.0, 6.0, 12.0, 20.0])[:, None] * polynomials[2:]
    return found


def evaluate(polynomials: np.ndarray, t: float | np.ndarray) -> Motion:
    """Return the motion on polynomials ``with_derivatives`` (6, 3, m) at a time [s] since they began, or (m,) times."""
    motion = polynomials[5].copy()
    for coefficients in polynomials[4::-1]:
        motion *= t
        motion += coefficients
    return motion[0], motion[1], motion[2]


def joint_names(names: Any) -> tuple[str, ...]:
    """Return names of joints, of one or several.

    Raises:
        InvalidInputError: neither text nor a sequence.
    """
    if isinstance(names, str):
        return (names,)
    if not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise InvalidInputError(f"names must be those of joints, got {names!r}")
    return tuple(names)
