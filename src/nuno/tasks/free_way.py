"""A way of a robot's joints to a goal that is free of what is in the way: straight, or by one stop."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from nuno.errors import ReachError

TURN = 0.04
"""[rad] Largest turn of a joint between two configurations that are looked at."""
STOPS = 200
"""Stops that are tried on the way, where the straight line is not free."""

Problem = Callable[[np.ndarray], str]
"""Returns what is wrong with joint angles (n,), "" where nothing is."""


def check_lines(angles: np.ndarray, problem: Problem, where: str) -> None:
    """Check what lies between joint angles, each to the next on a straight line; the first ones are not looked at.

    Args:
        angles: (k, n) [rad].
        problem: What is wrong with angles.
        where: What a refusal begins with.

    Raises:
        ReachError: something is in the way.
    """
    for a, b in itertools.pairwise(angles):
        steps = max(1, math.ceil(float(np.abs(b - a).max()) / TURN))
        for k in range(1, steps + 1):
            if reason := problem(a + (b - a) * k / steps):
                raise ReachError(f"{where}: {reason}")


def free_way(
    begin: np.ndarray, end: np.ndarray, columns: Sequence[int], limits: tuple[np.ndarray, np.ndarray], problem: Problem,
    where: str,
) -> np.ndarray:  # fmt: skip
    """Return joint angles (a, n) [rad] to go through one after the other, each on a straight line; the last is the end.

    Args:
        begin: (n,) [rad], not among those returned.
        end: (n,) [rad].
        columns: Of the joints that move.
        limits: Lower and upper (n,) [rad].
        problem: What is wrong with angles.
        where: What a refusal begins with.

    Raises:
        ReachError: neither the straight line nor a way by one stop is free.
    """
    try:
        check_lines(np.stack([begin, end]), problem, where)
        return end[None]
    except ReachError as error:
        failure = error
    random, own = np.random.default_rng(0), list(columns)  # the same stop for the same way
    lower, upper = (limit[own] for limit in limits)
    for _ in range(STOPS):
        stop = end.copy()
        extent = np.abs(end - begin)[own] + 0.3
        middle = 0.5 * (end + begin)[own]
        stop[own] = np.clip(random.normal(middle, 0.5 * extent), lower, upper)
        try:
            check_lines(np.stack([begin, stop, end]), problem, where)
            return np.stack([stop, end])
        except ReachError:
            continue
    raise failure
