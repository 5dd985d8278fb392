"""Sensor models: what a sensor makes of the truth: samples at its own rate, late, noisy and biased."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import finite_array, number

EARLY = 1e-9
"""[s] By which a sample may be taken or told before its time: the rounding of times that were added up."""


@dataclass(frozen=True, eq=False)
class SensorModel:
    """Errors of a sensor: rate, delay, noise and bias; none by default.

    Attributes:
        noise: Standard deviation of each sample, independent and normal, in the quantity's unit: a number, or one for
            each component.
        bias: What is added to every sample, likewise.
        rate: Samples a second [1/s]; None takes one whenever it is read. In between the last sample stands.
        latency: How long after it was taken a sample is told [s].

    Raises:
        InvalidInputError: not finite, negative noise or latency, or a rate that is not positive.
    """

    noise: ArrayLike = 0.0
    bias: ArrayLike = 0.0
    rate: float | None = None
    latency: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise", "bias"):
            values = finite_array(name, getattr(self, name), (), ("components",))
            if name == "noise" and (values < 0.0).any():
                least = " of at least 0" if name == "noise" else ""
                raise InvalidInputError(f"{name} must be a finite number{least} or one a component, got {values!r}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if self.rate is not None:
            number("rate", self.rate, above=0.0)
        number("latency", self.latency, low=0.0)


class Channel:
    """One quantity of one sensor, and the samples that are on their way.

    Args:
        name: What it is, which with the seed decides its noise.
        model: Its model.
        size: Components.
        seed: Of the noise.

    Attributes:
        is_exact: Whether it tells nothing but the truth, at once.

    Raises:
        InvalidInputError: noise or bias for another number of components.
    """

    def __init__(self, name: str, model: SensorModel, size: int, seed: int) -> None:
        for what in ("noise", "bias"):
            shape = np.shape(getattr(model, what))
            if shape not in ((), (size,)):
                raise InvalidInputError(f"{what} of {name!r} must be a number or ({size},), got shape {shape}")
        self.model, self._size, self._start = model, size, [int(seed), crc32(name.encode())]
        self._noise, self._bias = np.asarray(model.noise, dtype=float), np.asarray(model.bias, dtype=float)
        self._noisy, self._biased = bool(self._noise.any()), bool(self._bias.any())
        self.is_exact = not self._noisy and not self._biased and model.rate is None and model.latency == 0.0
        self.forget()

    def forget(self) -> None:
        """Begin anew, with the same noise."""
        self._random = np.random.default_rng(self._start)
        self._coming: deque[tuple[float, Any]] = deque()
        self._delivered: tuple[float, Any] | None = None
        self._next, self._last = -np.inf, -np.inf

    def read(self, time: float, truth: Any) -> tuple[float, Any]:
        """Return when the newest sample that has arrived was taken [s], and the sample.

        Until the first sample has come through it is told all the same: a sensor did not begin with the simulation.

        Args:
            time: Now [s]; one before the last makes it begin anew, as in a world that was restored.
            truth: (size,) float.
        """
        if self.is_exact:
            return time, truth
        if time < self._last - EARLY:
            self.forget()
        self._last = time
        if time >= self._next - EARLY:
            self._coming.append((time, self._sample(truth)))
            if self.model.rate is not None:
                period = 1.0 / self.model.rate
                # on a grid of its own, whatever the ticks are; a tick that comes late does not shift it
                start = time if self._next == -np.inf else self._next
                self._next = start + period * max(1.0, np.floor((time - start + EARLY) / period) + 1.0)
        while self._coming and (self._delivered is None or self._coming[0][0] + self.model.latency <= time + EARLY):
            self._delivered = self._coming.popleft()
        assert self._delivered is not None
        return self._delivered

    def _sample(self, truth: Any) -> Any:
        value = truth + self._bias if self._biased else truth
        return value + self._noise * self._random.standard_normal(self._size) if self._noisy else value
