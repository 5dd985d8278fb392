"""Minimisation without gradients: CMA-ES, each generation evaluated as one batch."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.errors import EstimationError, InvalidInputError, MissingPackageError, UnknownNameError
from nuno.files.html_table import html_table
from nuno.search.parameters import from_rows
from nuno.search.sampler import check_bounds, scaled, share_of
from nuno.search.sweep import check_trial, outcomes
from nuno.search.trial import Each, Trial, check_importable, name_of
from nuno.search.world_source import Worlds, make_source
from nuno.validation import checked, count, number
from nuno.world.world import World

log = logging.getLogger(__name__)

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Generation:
    """One generation of a minimisation.

    Attributes:
        best: The lowest value in it; NaN where all failed.
        median: The median of those that did not fail; NaN likewise.
        failed: How many failed.
        spread: By name, the standard deviation that the next one is drawn with, as a share of the bounds' range.
    """

    best: float
    median: float
    failed: int
    spread: dict[str, float]


@dataclass(frozen=True, eq=False)
class Minimum:
    """The result of a minimisation.

    Attributes:
        params: The parameters of the lowest value.
        value: The lowest value.
        values: All that the trial returned there, by name.
        history: One entry for each generation.
        tried: All parameters that were tried, (n,) by name.
        tried_values: (n,) float, what they gave; NaN where the trial failed.
        reason: Why it ended.
        errors: What the failed trials raised, each once.
    """

    params: dict[str, float]
    value: float
    values: dict[str, np.ndarray]
    history: tuple[Generation, ...]
    tried: dict[str, np.ndarray]
    tried_values: np.ndarray
    reason: str
    errors: tuple[str, ...]

    def _repr_html_(self) -> str:
        rows = [(name, f"{value:.4g}") for name, value in self.params.items()]
        title = f"Minimum: {self.value:.4g} after {len(self.tried_values)} trials"
        return html_table(title, rows, columns=("parameter", "value"), notes=(self.reason, *self.errors))

    @checked
    def near(self, excess: float) -> dict[str, tuple[float, float]]:
        """Return the range, by name, of the parameters whose value is at most ``excess`` above the lowest."""
        close = self.tried_values <= self.value + excess
        return {name: (float(column[close].min()), float(column[close].max())) for name, column in self.tried.items()}


@checked
def minimise(
    trial: Callable[[Any, Any], Any] | Each,
    bounds: Bounds,
    *,
    value: str = "loss",
    world: World | Callable[[], World] | None = None,
    executor: Executor | None = None,
    batch: bool | int = True,
    log_scale: Sequence[str] = (),
    start: Mapping[str, float] | None = None,
    step: float = 0.25,
    population: int | None = None,
    generations: int = 40,
    enough: float | None = None,
    tolerance: float = 1e-3,
    seed: int = 0,
    repeats: int = 2,
    device: str | None = None,
    progress: bool | None = None,
) -> Minimum:
    """Find the parameters for which a trial's value is lowest, without gradients (CMA-ES, Hansen 2016).

    Each generation of candidates is one batch. Trials that fail, or give NaN, rank below all others.

    Args:
        trial: As for `nuno.sweep`.
        bounds: (low, high) by name; nothing outside is tried.
        value: Name of what the trial returns that shall be low, one number a world.
        world: As for `nuno.sweep`.
        executor: As for `nuno.sweep`.
        batch: As for `nuno.sweep`.
        log_scale: Names whose logarithm is searched over, for what may lie orders of magnitude apart.
        start: Where to begin, by name, and what is tried first; names that are not there begin in the middle.
        step: Standard deviation of the first generation, as a share of the bounds' range.
        population: Candidates a generation; None is 4 + 3 ln(number of parameters).
        generations: At most so many.
        enough: A value at which to stop.
        tolerance: Stop when a generation spreads over less than this share of the bounds' range.
        seed: The same seed finds the same, on the same device.
        repeats: As for `nuno.sweep`.
        device: As for `nuno.sweep`.
        progress: Progress bar; None shows one in a terminal after two seconds.

    Raises:
        MissingPackageError: the package cma is not installed.
        InvalidInputError: an argument that cannot be used, or a trial that returns something else.
        EstimationError: every trial failed.
    """
    try:
        import cma
    except ImportError as missing:
        raise MissingPackageError("cma", "search", "minimise") from missing
    from tqdm import tqdm

    check_bounds(bounds, log_scale)
    names, logs = list(bounds), set(log_scale)
    begin = _start(bounds, start, logs)
    number("step", step, above=0.0, high=1.0)
    number("tolerance", tolerance, above=0.0)
    count("generations", generations)
    target = -np.inf if enough is None else number("enough", enough)
    together = None if batch is True else 1 if batch is False else count("batch", batch)
    check_trial(trial, executor)
    source = make_source(world, device)
    if executor is not None and not isinstance(executor, ThreadPoolExecutor):
        check_importable(trial, "the trial")
        source.check_importable()
    worlds = Worlds(source, world if isinstance(world, World) else None) if executor is None else None
    random = np.random.default_rng(count("seed", seed, low=0))
    # CMA-ES needs two dimensions: where there is one parameter, the other has no effect
    begin += [0.5] * (2 - len(names))
    options: dict[str, Any] = {
        "bounds": [0.0, 1.0], "verbose": -9, "maxiter": generations, "seed": np.nan,
        "randn": lambda *shape: random.standard_normal(shape),
    }  # fmt: skip
    if population is not None:
        options["popsize"] = count("population", population, low=3)
    search = cma.CMAEvolutionStrategy(begin, step, options)
    if start:
        search.inject([begin], force=True)
    tried = _Tried(value, name_of(trial))
    hidden = None if progress is None else not progress
    reason = ""
    with tqdm(
        total=generations, desc="generations", disable=hidden, delay=0.0 if progress else 2.0, leave=bool(progress)
    ) as bar:
        while not reason:
            points = search.ask()
            candidates = [
                {name: scaled(float(x), bounds[name], name in logs) for name, x in zip(names, point, strict=False)}
                for point in points
            ]
            numbers = range(len(candidates))
            running = outcomes(
                trial, source, world, from_rows(candidates), numbers, executor, together, repeats, worlds
            )
            results = {result.index: result for finished in running for result in finished}
            losses = tried.take(candidates, [results[k] for k in numbers])
            search.tell(points, _ranked(losses).tolist())
            spread = dict(zip(names, search.stds.tolist(), strict=False))
            tried.history.append(_generation(losses, spread))
            bar.update(1)
            if tried.lowest <= target:
                reason = "enough"
            elif max(spread.values()) < tolerance:
                reason = "tolerance"
            elif search.stop():
                reason = next(iter(search.stop()))
    found = tried.minimum(reason)
    log.info("lowest %s %g after %d generations (%s)", value, found.value, len(found.history), reason)
    return found


class _Tried:
    """The trials of a minimisation so far.

    Args:
        value: Name of what the trials return that shall be low.
        function: What the trial is called.
    """

    def __init__(self, value: str, function: str) -> None:
        self.value, self.function = value, function
        self.history: list[Generation] = []
        self.lowest = np.inf
        self._best: tuple[dict[str, float], Trial] | None = None
        self._rows: list[dict[str, float]] = []
        self._losses: list[float] = []
        self._errors: dict[str, None] = {}  # each once, in the order in which they came

    def take(self, candidates: list[dict[str, float]], results: list[Trial]) -> np.ndarray:
        """Take a generation in; return its losses (n,), NaN where a trial failed."""
        losses = np.array([_loss(result, self.value, self.function) for result in results])
        for candidate, result, loss in zip(candidates, results, losses.tolist(), strict=True):
            if np.isfinite(loss) and loss < self.lowest:
                self.lowest, self._best = loss, (candidate, result)
            if result.error is not None:
                self._errors[result.error] = None
        self._rows += candidates
        self._losses += losses.tolist()
        return losses

    def minimum(self, reason: str) -> Minimum:
        """Return what was found.

        Raises:
            EstimationError: every trial failed.
        """
        if self._best is None:
            first = next(iter(self._errors), self.value)
            raise EstimationError(f"all {len(self._rows)} trials failed; the first one said: {first}")
        params, trial = self._best
        return Minimum(
            params, self.lowest, trial.values, tuple(self.history),
            {name: np.array([row[name] for row in self._rows]) for name in params}, np.array(self._losses), reason,
            tuple(self._errors),
        )  # fmt: skip


def _generation(losses: np.ndarray, spread: dict[str, float]) -> Generation:
    good = losses[np.isfinite(losses)]
    best, median = (float(good.min()), float(np.median(good))) if len(good) else (np.nan, np.nan)
    return Generation(best, median, len(losses) - len(good), spread)


def _start(bounds: Bounds, start: Any, logs: set[str]) -> list[float]:
    given = dict(start or {})
    for name in given:
        if name not in bounds:
            raise UnknownNameError("bound", name, list(bounds))
    shares = []
    for name, (low, high) in bounds.items():
        if name in given:
            at = number(f"the start of {name!r}", given[name], low=float(low), high=float(high))
            shares.append(share_of(at, (low, high), name in logs))
        else:
            shares.append(0.5)
    return shares


def _loss(trial: Trial, name: str, function: str) -> float:
    """The value of a trial; NaN where it failed."""
    if trial.failed:
        return np.nan
    if name not in trial.values:
        raise InvalidInputError(f"{function} returned {sorted(trial.values)}, but no {name!r}; pass value=")
    found = trial.values[name]
    if found.ndim or found.dtype.kind not in "bif":
        raise InvalidInputError(f"{name!r} must be one number a world, {function} returned {found!r}")
    return float(found)


def _ranked(losses: np.ndarray) -> np.ndarray:
    """Losses for CMA-ES, which looks at their order alone: those that failed come after all others."""
    finite = np.isfinite(losses)
    worst = losses[finite].max() if finite.any() else 0.0
    return np.where(finite, losses, worst + abs(worst) + 1.0)
