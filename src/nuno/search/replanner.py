"""replan: plan, act for a while, and plan again from what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.search.knots import LONGEST, Knots
from nuno.search.planned_futures import PlannedFutures
from nuno.search.planner import Plan, called, plan_in
from nuno.validation import checked, count, finite_array, flag, function, number
from nuno.world.world import World

SOON = 1e-9
"""[s] Rounding of sums of periods."""


@dataclass(frozen=True, eq=False)
class Replanned:
    """The plans of a run, and the motions that were begun.

    Attributes:
        plans: The plan of each period.
        motions: The motion that was begun in each.
        planning_seconds: (periods,) float, what each plan took by the wall clock [s].
        done: Whether ``done`` ended it; False without one.
    """

    plans: tuple[Plan, ...]
    motions: tuple[Knots, ...]
    planning_seconds: np.ndarray
    done: bool


@checked
def replan(
    world: World, act: Callable[[World, Knots], Any], cost: Callable[[World], Any], *, now: Callable[[World], Any],
    start: ArrayLike, spread: ArrayLike, horizon: float, every: float, periods: int, shrink: bool = False,
    execute: Callable[[World, Knots], Any] | None = None, done: Callable[[World], Any] | None = None,
    samples: int = 32, iterations: int = 2, method: Literal["cem", "mppi"] = "cem", elites: int | None = None,
    temperature: float = 0.1, bounds: tuple[ArrayLike, ArrayLike] | None = None, seed: int = 0,
    device: str | None = None, thorough: bool = True,
) -> Replanned:  # fmt: skip
    """Plan in imagination, act for a while, look, and plan again: model-predictive control over knots.

    Each period plans with ``nuno.plan`` from the world as it is then, and starts from what is left of the motion of the
    period before (warm start). So few iterations a period are enough.

    Args:
        world: A single world.
        act: Sets the world or a batch of copies on its way, ``act(world, motion)``: ``motion.path`` makes paths for
            grips and bodies, ``motion.at`` numbers such as joint angles. In a batch the motion has an axis of worlds.
        cost: ``cost(futures)`` after the horizon, (samples,), as of ``plan``.
        now: ``now(world)``, (d,): where the numbers that the knots move are at present.
        start: (k, d), knots of the first motion.
        spread: As of ``plan``, anew in each period; with ``shrink`` in proportion to the time that is left, so that
            motions become no faster.
        horizon: How long a motion takes [s].
        every: How long the world goes on between two plans [s].
        periods: How many plans at most, up to 10,000.
        shrink: All plans end ``horizon`` after the first began, as for a task that has an end; the last one is then
            carried out to its end. Else each looks ``horizon`` ahead.
        execute: ``execute(world, motion)`` begins the motion in the world itself, through a robot's driver for
            instance; None is ``act``. The world then runs for ``every``.
        done: ``done(world)``, before each period and at the end, ends it where it is True.
        samples: As of ``plan``, and so are the others.
        iterations: Of each period.
        method: "cem" or "mppi".
        elites: Of "cem".
        temperature: Of "mppi".
        bounds: Lowest and highest knots.
        seed: Of the samples; each period has its own.
        device: Where futures run.
        thorough: As of ``plan``. Without, all plans imagine in one batch, which goes back to the world as it is then
            and keeps its memory until the last.

    Raises:
        InvalidInputError: an argument out of range, or a function of the caller's fails.
        EstimationError: no future of a period has a finite cost.
    """
    for name, own in (("act", act), ("cost", cost), ("now", now)):
        function(name, own)
    for name, other in (("execute", execute), ("done", done)):
        if other is not None:
            function(name, other)
    knots = finite_array("start", start, ("k", "d"))
    deviations = finite_array("spread", spread, (), knots.shape[1:], knots.shape)
    span = whole = number("horizon", horizon, above=0.0, high=LONGEST)
    pause = number("every", every, above=0.0, high=span)
    rounds = count("periods", periods, high=10_000)
    shrinks, first = flag("shrink", shrink), count("seed", seed, low=0)
    batch = PlannedFutures(world)
    plans: list[Plan] = []
    motions: list[Knots] = []
    took: list[float] = []
    for k in range(rounds):
        if done is not None and _is_done(done, world):
            return Replanned(tuple(plans), tuple(motions), np.array(took), True)
        here = finite_array("what now returns", called("now", now, world), (knots.shape[1],))

        def imagined(futures: World, values: np.ndarray, here: np.ndarray = here, span: float = span) -> None:
            act(futures, Knots(here, values, span))

        begin = time.perf_counter()
        found = plan_in(
            batch, world, imagined, cost, start=knots, spread=deviations * (span / whole), horizon=span,
            samples=samples, iterations=iterations, method=method, elites=elites, temperature=temperature,
            bounds=bounds, seed=first + k, device=device, thorough=thorough,
        )  # fmt: skip
        took.append(time.perf_counter() - begin)
        motion = Knots(here, found.knots, span)
        plans.append(found)
        motions.append(motion)
        called("act" if execute is None else "execute", execute or act, world, motion)
        is_last = shrinks and (k == rounds - 1 or span - pause <= SOON)
        world.run(span if is_last else pause)
        if is_last:
            break
        left = motion.later(pause, shrink=shrinks)
        knots, span = left.values, left.seconds
    return Replanned(tuple(plans), tuple(motions), np.array(took), done is not None and _is_done(done, world))


def _is_done(done: Callable[[World], Any], world: World) -> bool:
    """Return what the caller's function says, if it is True or False."""
    said = called("done", done, world)
    if not isinstance(said, bool | np.bool_):
        raise InvalidInputError(f"done must return True or False, got {type(said).__name__}")
    return bool(said)
