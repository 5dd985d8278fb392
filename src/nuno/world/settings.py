"""Settings: gravity, frame rate and substeps of a world, which may change between two frames."""

from __future__ import annotations

from abc import abstractmethod
from contextlib import AbstractContextManager
from typing import Any

from numpy.typing import ArrayLike

from nuno.validation import count, finite_array, number

MAX_SUBSTEPS = 10_000
"""Of a frame: at 60 frames a second 1.7 us each, in which what moves at 1 cm/s does so by less than floats resolve."""
MAX_FRAMES = 1_000_000.0
"""A second, [1/s]."""


class Settings:
    """The numbers that all solvers of a world go by, from the next frame on also those of bodies that move already.

    Raises:
        InvalidInputError: a value that is not finite or out of range.
        BodyStateError: set from ``each_frame``.
    """

    def __init__(self, gravity: ArrayLike, frame_rate: float, substeps: int | None) -> None:
        self._gravity, self._frame_rate = _gravity(gravity), _frame_rate(frame_rate)
        self._substeps = _substeps(substeps)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """The acceleration of what falls, (3,) [m/s2]."""
        return self._gravity

    @gravity.setter
    def gravity(self, gravity: ArrayLike) -> None:
        self._set("gravity", _gravity(gravity))

    @property
    def frame_rate(self) -> float:
        """Frames per second of simulated time [1/s]."""
        return self._frame_rate

    @frame_rate.setter
    def frame_rate(self, frame_rate: float) -> None:
        self._set("frame_rate", _frame_rate(frame_rate))

    @property
    def substeps(self) -> int | None:
        """Substeps of a frame; None lets each solver choose by its rule."""
        return self._substeps

    @substeps.setter
    def substeps(self, substeps: int | None) -> None:
        self._set("substeps", _substeps(substeps))

    def _set(self, name: str, value: Any) -> None:
        with self._change(name):
            if value != getattr(self, name):
                self._go_by(**{name: value})

    def _take_settings(self, gravity: tuple[float, float, float], frame_rate: float, substeps: int | None) -> None:
        """Have these settings, for solvers that are made from now on."""
        self._gravity, self._frame_rate, self._substeps = gravity, frame_rate, substeps

    @abstractmethod
    def _change(self, what: str) -> AbstractContextManager[None]:
        """Hold the lock for a call that changes the world."""

    @abstractmethod
    def _go_by(self, **changed: Any) -> None:
        """Let all that moves go by other settings from now on."""


def _gravity(value: ArrayLike) -> tuple[float, float, float]:
    gx, gy, gz = finite_array("gravity", value, (3,))
    return float(gx), float(gy), float(gz)


def _frame_rate(value: float) -> float:
    return number("frame_rate", value, above=0.0, high=MAX_FRAMES)


def _substeps(value: int | None) -> int | None:
    return None if value is None else count("substeps", value, high=MAX_SUBSTEPS)
