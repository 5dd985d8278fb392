"""JointBatch: the joints of many copies of a robot, moved together while nothing happens to their goals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nuno.robot.simulated_joints import SimulatedJoints, limited
from nuno.robot.trajectory import evaluate


class JointBatch:
    """The joints of copies of a robot as arrays, in which a frame is a few operations for all of them.

    What it gives is, to the bit, what each copy's ``SimulatedJoints`` gives, as long as no controller takes up another
    polynomial and no goal ends: `due` says of whom that is not so. For those the copy itself is asked: ``scatter``
    brings it up to date before, ``gather`` takes what it has become.

    Args:
        joints: Of each copy, n of them, with m joints.

    Attributes:
        clock: (n,) [s].
        motion: (3, n, m), positions, velocities and accelerations.
        desired: (3, n, m), as the controllers want them.
    """

    def __init__(self, joints: Sequence[SimulatedJoints]) -> None:
        self._joints = tuple(joints)
        first = self._joints[0]
        self._limits, self._speeds = first.limits, first.velocity_limits
        n, m = len(self._joints), len(first.positions)
        self.clock, self._next_event, self._busy = np.zeros(n), np.zeros(n), np.zeros(n, dtype=bool)
        self.motion, self.desired = np.zeros((3, n, m)), np.zeros((3, n, m))
        self._polynomials, self._begin = np.zeros((6, 3, n, m)), np.zeros((n, m))
        for k in range(n):
            self.gather(k)

    def gather(self, k: int) -> None:
        """Take over how one copy's joints are."""
        own = self._joints[k]
        self.clock[k] = own.clock
        self.motion[:, k], self.desired[:, k] = (own.positions, own.velocities, own.accelerations), own.desired
        self._polynomials[:, :, k], self._begin[k] = own.followed
        controllers = own.controllers.values()
        self._busy[k] = any(each.is_busy for each in controllers)
        self._next_event[k] = min((each.next_event for each in controllers), default=np.inf)

    def scatter(self, k: int) -> None:
        """Give one copy what its joints have become."""
        own = self._joints[k]
        own.clock = float(self.clock[k])
        own.positions, own.velocities, own.accelerations = self.motion[:, k].copy()
        a, b, c = self.desired[:, k].copy()
        own.desired = (a, b, c)

    def due(self, duration: float) -> np.ndarray:
        """Return whose controllers must be asked within ``duration`` [s], (n,) bool."""
        return self.clock + duration >= self._next_event

    def step(self, duration: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the motion ``duration`` [s] later, what is wanted then, (3, n, m) each, and who rests, (n,) bool."""
        now = self.motion
        rests = ~self._busy & (self.desired[0] == now[0]).all(axis=1) & ~now[1].any(axis=1)
        if duration <= 0.0 or rests.all():
            return now, self.desired, rests
        wanted = evaluate(self._polynomials, (self.clock + duration)[:, None] - self._begin)
        reached = limited(wanted, (now[0], now[1], now[2]), duration, self._speeds, self._limits)
        desired = np.array(wanted)
        actual = desired if reached is wanted else np.array(reached)
        if rests.any():
            actual, desired = (
                np.where(rests[:, None], *pair) for pair in ((now, actual), (self.desired, desired))
            )  # fmt: skip
        return actual, desired, rests

    def take(self, who: np.ndarray, duration: float, motion: np.ndarray, desired: np.ndarray) -> None:
        """Take a step that was worked out, for those of ``who`` (n,) bool."""
        self.clock[who] += duration
        self.motion = np.where(who[:, None], motion, self.motion)
        self.desired = np.where(who[:, None], desired, self.desired)
