"""plan: what to do next, found by imagining it: sampling-based model-predictive control over knots of a motion."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike

from nuno.dynamics.dynamics import ParticleDynamics
from nuno.engines.world_view import attached
from nuno.errors import EstimationError, InvalidInputError, NunoError
from nuno.search.knots import LONGEST
from nuno.search.planned_futures import PlannedFutures
from nuno.validation import checked, count, finite_array, function, number
from nuno.world.impacts import fast_cloths, forget_fast
from nuno.world.world import World

log = logging.getLogger(__name__)

METHODS = ("cem", "mppi")
SMALLEST = 1e-3
"""Share of its first value that a standard deviation keeps at least."""
_warned: WeakSet[World] = WeakSet()
"""Worlds of which was said that their plans are imagined too roughly."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The knots of the best motion that was imagined.

    Attributes:
        knots: (k, d) float, what the caller's ``act`` takes.
        cost: What it cost in imagination.
        history: (iterations,) float, the lowest cost so far after each iteration.
        mean: (k, d) float, of the last distribution.
        spread: (k, d) float, standard deviations likewise.
        failed: How many futures had no finite cost.
    """

    knots: np.ndarray
    cost: float
    history: np.ndarray
    mean: np.ndarray
    spread: np.ndarray
    failed: int


@checked
def plan(
    world: World, act: Callable[[World, np.ndarray], Any], cost: Callable[[World], Any], *, start: ArrayLike,
    spread: ArrayLike, horizon: float, samples: int = 32, iterations: int = 4, method: Literal["cem", "mppi"] = "cem",
    elites: int | None = None, temperature: float = 0.1, bounds: tuple[ArrayLike, ArrayLike] | None = None,
    seed: int = 0, device: str | None = None, thorough: bool = True,
) -> Plan:  # fmt: skip
    """Find what to do next: imagine many motions in one batch, keep to the best, and do so again around them.

    The world itself stays as it is. To act, give the knots to the robot or the grips of the world, run it for a while,
    and plan again from there: with ``start=plan.knots``, a few iterations are enough.

    Args:
        world: A single world.
        act: Sets a batch on its way: ``act(futures, knots)`` with knots (samples, k, d), such as paths for grips
            (``nuno.Path`` takes an axis of worlds) or angles for ``futures.robot``.
        cost: ``cost(futures)`` after the horizon, (samples,); what is not finite counts as failed.
        start: (k, d), the motion to begin with; it is among those that are tried.
        spread: Standard deviations of the first iteration, a number or (k, d) or (d,).
        horizon: How long each motion is imagined [s], up to an hour.
        samples: Futures in an iteration.
        iterations: How many, up to 10,000.
        method: "cem", the cross-entropy method: mean and standard deviation of the best ones (Rubinstein & Kroese,
            2004). Or "mppi", model-predictive path integral control: a mean weighted by exp(-cost / temperature), of
            costs scaled to the range of the iteration (Williams et al., ICRA 2016).
        elites: How many the best ones of "cem" are; None is an eighth of the samples, at least 2.
        temperature: Of "mppi".
        bounds: Lowest and highest knots, each a number, (d,) or (k, d); None is none.
        seed: Of the samples.
        device: Where futures run; None is where the world runs.
        thorough: As of ``World.imagine``; without, fast motions are imagined in less time, and less
            truly: the world itself goes through fast frames twice, and ends elsewhere. Where the best motion has such
            frames, a warning says so, once for a world. Below 25 substeps of a frame of 1/60 s coordinates of cloth are
            floats then, also where the rule chose the substeps: they round differently, and take less time.

    Raises:
        InvalidInputError: an argument out of range, or costs of another shape.
        EstimationError: no future of the first iteration has a finite cost.
    """
    return plan_in(
        PlannedFutures(world), world, act, cost, start=start, spread=spread, horizon=horizon, samples=samples,
        iterations=iterations, method=method, elites=elites, temperature=temperature, bounds=bounds, seed=seed,
        device=device, thorough=thorough,
    )  # fmt: skip


def plan_in(
    batch: PlannedFutures, world: World, act: Callable[[World, np.ndarray], Any], cost: Callable[[World], Any], *,
    start: ArrayLike, spread: ArrayLike, horizon: float, samples: int, iterations: int, method: str, elites: int | None,
    temperature: float, bounds: tuple[ArrayLike, ArrayLike] | None, seed: int, device: str | None, thorough: bool,
) -> Plan:  # fmt: skip
    """Return what ``plan`` does, imagined in futures that a plan before may have made."""
    function("act", act)
    function("cost", cost)
    mean = finite_array("start", start, ("k", "d"))
    shape = mean.shape
    sigma = np.array(np.broadcast_to(finite_array("spread", spread, (), shape[1:], shape), shape))
    if (sigma <= 0.0).any():
        raise InvalidInputError(f"spread must be above 0, got {sigma.min():g}")
    low, high = np.full(shape, -np.inf), np.full(shape, np.inf)
    if bounds is not None:
        if not isinstance(bounds, tuple | list) or len(bounds) != 2:
            raise InvalidInputError(f"bounds must be a pair (lowest, highest) or None, got {bounds!r}")
        low, high = (np.broadcast_to(finite_array("bounds", side, (), shape[1:], shape), shape) for side in bounds)
    if (low > high).any():
        raise InvalidInputError("the lower bounds must not be above the upper ones")
    seconds = number("horizon", horizon, above=0.0, high=LONGEST)
    n, rounds = count("samples", samples), count("iterations", iterations, high=10_000)
    best_of = max(2, n // 8) if elites is None else count("elites", elites)
    if method not in METHODS:
        raise InvalidInputError(f"method must be one of {METHODS}, got {method!r}")
    if n < 2 or best_of > n:
        raise InvalidInputError(f"samples must be at least 2 and as many as the elites, got {n} and {best_of}")
    heat = number("temperature", temperature, above=0.0)
    random, floor = np.random.default_rng(count("seed", seed, low=0)), SMALLEST * sigma
    futures, saved = batch.begin(n, device, thorough, rounds > 1)
    if not thorough:
        _have_floats(futures)
    found, lowest, failed, history = mean, np.inf, 0, []
    hurried: list[str] = []  # what was too fast in the future that is kept
    for k in range(rounds):
        knots = mean + sigma * random.standard_normal((n, *shape))
        knots[0] = mean if k == 0 else found  # the start, and then the best, are always among them
        knots = np.clip(knots, low, high)
        if k and saved is not None:
            futures.restore(saved)
        if not thorough:
            forget_fast(futures.bodies)
        called("act", act, futures, knots)
        futures.run(seconds)
        costs = _checked(called("cost", cost, futures), n)
        finite = np.isfinite(costs)
        failed += int(n - finite.sum())
        if not finite.any():
            if k == 0:
                raise EstimationError("no motion that was imagined has a finite cost; is the start possible at all?")
            history.append(lowest)
            continue
        order = np.argsort(np.where(finite, costs, np.inf), kind="stable")
        if costs[order[0]] < lowest:
            found, lowest = knots[order[0]], float(costs[order[0]])
            fast = {} if thorough else fast_cloths(futures.bodies)
            hurried = [name for name, worlds in fast.items() if worlds[order[0]]]
        if method == "cem":
            chosen = knots[order[: min(best_of, int(finite.sum()))]]
            mean, sigma = chosen.mean(axis=0), np.maximum(chosen.std(axis=0), floor)
        else:
            span = max(float(np.ptp(costs[finite])), 1e-300)
            weights = np.where(finite, np.exp(-(np.where(finite, costs, 0.0) - costs[order[0]]) / span / heat), 0.0)
            mean = np.einsum("n,nkd->kd", weights / weights.sum(), knots)
        history.append(lowest)
        log.debug("plan: iteration %d of %d, cost %g", k + 1, rounds, lowest)
    if hurried and world not in _warned:
        _warned.add(world)
        drivers: list[Any] = [driver for driver in world.drivers if getattr(driver, "is_dynamic", False)]
        held = sorted(driver.robot.name for driver in drivers)
        log.warning(
            "the plan's cost was imagined without going through fast frames of %s a second time, as the world itself "
            "does%s: what is carried out will cost something else; imagine with thorough=True, or plan slower motions",
            " and ".join(map(repr, hurried)), f", which {' and '.join(map(repr, held))} feels, too" if held else "",
        )  # fmt: skip
    return Plan(found.copy(), lowest, np.array(history), mean, sigma, failed)


def _have_floats(world: World) -> None:
    """Let coordinates be floats where they would be if its substeps were given."""
    from nuno.state.double_positions import DOUBLE_RATE

    for dynamics in attached(world):
        if isinstance(dynamics, ParticleDynamics):
            dynamics.solver.doubles.begin_at(DOUBLE_RATE)


def called(name: str, own: Callable[..., Any], *given: Any) -> Any:
    """Return what a function of the caller returns; what it raises comes out with its name before it."""
    try:
        return own(*given)
    except NunoError:
        raise
    except Exception as error:
        raise InvalidInputError(f"{name} failed: {type(error).__name__}: {error}") from error


def _checked(costs: Any, n: int) -> np.ndarray:
    array = np.asarray(costs.numpy() if hasattr(costs, "numpy") else costs, dtype=float)
    if array.shape != (n,):
        raise InvalidInputError(f"cost must return one number for each of {n} futures, got shape {array.shape}")
    return array
