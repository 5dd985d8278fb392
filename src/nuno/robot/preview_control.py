"""Preview control of the zero moment point: how the centre of mass moves so that the point goes where it is to go.

The robot is taken as a cart on a table (Kajita et al. 2003, "Biped walking pattern generation by using preview control
of zero-moment point", eq. 8): a mass at one height h, whose zero moment point is p = x - h/g x''. The input is the
jerk; an optimal servo with preview (Katayama et al. 1985) weighs the error of p against it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_are

from nuno.validation import number

GRAVITY = 9.81
TICK = 0.005
"""[s]"""
HORIZON = 1.6
"""[s] What comes later changes the jerk of now by under 1 %, at heights of the centre of mass up to 1 m."""
DETOUR = 0.5
"""[s] How long it may take to join a reference: half of the time before a first step."""
ERROR_WEIGHT, JERK_WEIGHT = 1.0, 1e-6
"""Of the squared error [1/m2] and jerk [s6/m2]: those of the paper."""


class PreviewControl:
    """The controller of a centre of mass that stays at one height.

    Args:
        height: Above the floor [m].
        tick: Time between two samples [s].
        horizon: How far it looks ahead [s].
        gravity: [m/s2].

    Attributes:
        transition: (3, 3) float, of position, velocity and acceleration over a tick.
        entry: (3,) float, what a jerk of 1 m/s3 adds to them over a tick.
        output: (3,) float, the zero moment point of such a state.
        error_gain: On the sum of errors.
        state_gains: (3,) float.
        preview_gains: (n,) float, on the reference from the next tick on. Beyond the horizon the reference counts as
            constant: the last gain holds the sum of all that would follow, so that nothing depends on the origin.
    """

    def __init__(
        self, height: float, tick: float = TICK, horizon: float = HORIZON, gravity: float = GRAVITY
    ) -> None:  # fmt: skip
        h, t = number("height", height, above=0.0), number("tick", tick, above=0.0)
        n = max(1, round(number("horizon", horizon, above=0.0) / t))
        self.height, self.tick, self.gravity = h, t, number("gravity", gravity, above=0.0)
        self.transition = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
        self.entry = np.array([t**3 / 6.0, 0.5 * t * t, t])
        self.output = np.array([1.0, 0.0, -h / self.gravity])
        self.augmented = np.zeros((4, 4))
        self.augmented[0, 0] = 1.0
        self.augmented[0, 1:], self.augmented[1:, 1:] = self.output @ self.transition, self.transition
        self.augmented_entry = np.concatenate([[self.output @ self.entry], self.entry])[:, None]
        b = self.augmented_entry
        weights = np.diag([ERROR_WEIGHT, 0.0, 0.0, 0.0])
        cost = solve_discrete_are(self.augmented, b, weights, np.array([[JERK_WEIGHT]]))
        self.riccati = cost
        scale = JERK_WEIGHT + (b.T @ cost @ b)[0, 0]
        gains = (b.T @ cost @ self.augmented)[0] / scale
        self.error_gain, self.state_gains = float(gains[0]), gains[1:]
        closed = self.augmented - b @ gains[None]
        self.preview_gains = np.empty(n)
        later = -closed.T @ cost[:, 0]
        self.preview_gains[0] = -self.error_gain
        for k in range(1, n):
            self.preview_gains[k] = b[:, 0] @ later / scale
            later = closed.T @ later
        self.preview_gains[-1] = -self.state_gains[0] - self.preview_gains[:-1].sum()

    def joined(self, reference: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return a reference with a detour in its first half second, which a motion can join without a jolt.

        The divergent component of motion, x + x'/w with w = sqrt(g/h), is the mean of all zero moment points to come,
        weighed by exp(-w t). Where the state has another than the reference asks for, the controller would make up for
        that at once, by accelerations that no sole can bear. To set off, a robot first pushes the other way.

        Args:
            reference: (n, 2) float [m], of the zero moment point at each tick; it stays where it ends.
            state: (3, 2) float, position [m], velocity and acceleration at the first tick.
        """
        w = np.sqrt(self.gravity / self.height)
        fading = np.exp(-w * self.tick * np.arange(len(reference)))
        parts = fading[:-1] - fading[1:]
        between = 0.5 * (reference[:-1] + reference[1:])
        asked = parts @ between + fading[-1] * reference[-1]
        share = np.arange(len(reference)) * self.tick / DETOUR
        way = np.where(share < 1.0, 4.0 * share * (1.0 - share), 0.0) ** 3
        reach = parts @ (0.5 * (way[:-1] + way[1:]))
        return reference + np.outer(way, (state[0] + state[1] / w - asked) / max(reach, 1e-9))

    def follow(
        self, reference: np.ndarray, state: np.ndarray, error_sum: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the states that follow a reference, and the sums of errors.

        Args:
            reference: (n, 2) float [m], of the zero moment point at each tick; it stays where it ends.
            state: (3, 2) float, position [m], velocity and acceleration at the first tick.
            error_sum: (2,) float [m], of the ticks before; None is zero.

        Returns:
            (n, 3, 2) float, of each tick, the first being ``state``; (n, 2) float, of the ticks before each.
        """
        n, ahead = len(reference), len(self.preview_gains)
        held = np.concatenate([reference, np.repeat(reference[-1:], ahead, axis=0)])
        preview = np.stack([np.correlate(held[1:, k], self.preview_gains, "valid")[:n] for k in range(2)], axis=1)
        states, sums = np.empty((n, 3, 2)), np.empty((n, 2))
        states[0], sums[0] = state, 0.0 if error_sum is None else error_sum
        for k in range(n - 1):
            states[k + 1], sums[k + 1] = self.step(states[k], sums[k], reference[k], preview[k])
        return states, sums

    def step(
        self, state: np.ndarray, error_sum: np.ndarray, reference: np.ndarray, preview: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the state of the next tick, and the sum of errors before it.

        Args:
            state: (3, 2) float, of this tick.
            error_sum: (2,) float [m], of the ticks before this one.
            reference: (2,) float [m], of this tick.
            preview: (2,) float, the later references weighed by ``preview_gains``.
        """
        error_sum = error_sum + self.output @ state - reference
        jerk = -self.error_gain * error_sum - self.state_gains @ state - preview
        return self.transition @ state + self.entry[:, None] * jerk, error_sum
