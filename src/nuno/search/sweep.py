"""Sweeps: the same trial for many parameters, in batches, over processes or a cluster, recorded as they finish."""

from __future__ import annotations

import csv
import logging
import os
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from nuno.errors import FileFormatError, InvalidInputError, UnknownNameError
from nuno.files.html_table import html_table
from nuno.files.whole_file import replacing
from nuno.search.chunk_size import LANES, ChunkSize
from nuno.search.dispatch import run_on_executor
from nuno.search.parameters import Parameters, from_rows, make_parameters
from nuno.search.results_file import ResultsFile, make_header, read_entries, read_header
from nuno.search.rows import run_rows
from nuno.search.trial import Each, Trial, check_importable, name_of
from nuno.search.world_source import Worlds, WorldSource, make_source
from nuno.validation import checked, count
from nuno.world.world import World

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The result of a sweep.

    Attributes:
        params: Parameters by name, (n, ...), one row for each trial; of a file that is read, for each in the file.
        trials: (n,) the finished trials by index; None for those that were not run.
        stopped: Whether the sweep was stopped early.
        planned: How many trials the sweep has, where that is more than ``trials`` holds: those of a file that is read
            before its sweep has ended. None: as many as ``trials``.
    """

    params: dict[str, np.ndarray]
    trials: list[Trial | None]
    stopped: bool = False
    planned: int | None = None

    def __repr__(self) -> str:
        finished = sum(trial is not None for trial in self.trials)
        finished_text = f"{finished} of {self.planned or len(self)} trials, {len(self.failures)} failed"
        return f"<SweepResult: {finished_text}; {', '.join(self.params)} -> {', '.join(self.names) or 'nothing'}>"

    def _repr_html_(self) -> str:
        names = [name for name in self.names if np.ndim(self._first(name)) == 0]
        done = [(k, trial) for k, trial in enumerate(self.trials) if trial is not None]
        rows = [
            [k, *(_short(value) for value in self.row(k).values()),
             *(_short(trial.values[name].item()) if name in trial.values else trial.error or "" for name in names)]
            for k, trial in done
        ]  # fmt: skip
        failed = f"{len(self.failures)} failed" if self.failures else "none failed"
        title = f"SweepResult: {len(done)} of {len(self)} trials, {failed}"
        return html_table(title, rows, columns=("trial", *self.params, *names) if rows else ())

    def _first(self, name: str) -> np.ndarray:
        return next(trial.values[name] for trial in self.trials if trial is not None and name in trial.values)

    def __len__(self) -> int:
        return len(self.trials)

    @property
    def is_complete(self) -> bool:
        """Return True if every trial has finished, or failed."""
        return (self.planned or len(self)) == len(self) and all(trial is not None for trial in self.trials)

    @property
    def failures(self) -> dict[int, str]:
        """Return why trials failed, by index."""
        return {trial.index: trial.error for trial in self.trials if trial is not None and trial.error is not None}

    @property
    def names(self) -> list[str]:
        """The names of what trials returned."""
        return sorted({name for trial in self.trials if trial is not None for name in trial.values})

    @checked
    def values(self, name: str) -> np.ndarray:
        """Return one value of all trials, (n, ...).

        Where a trial failed or was not run, numbers are NaN (whole numbers and bools become floats then), and strings
        empty.

        Raises:
            UnknownNameError: no trial returned such a value.
            InvalidInputError: its shape differs between trials.
        """
        rows = [None if trial is None else trial.values.get(name) for trial in self.trials]
        there = [row for row in rows if row is not None]
        if not there:
            raise UnknownNameError("value", name, self.names)
        if len({row.shape for row in there}) > 1:
            raise InvalidInputError(f"{name!r} has shapes {sorted({row.shape for row in there})}; see trials")
        first = there[0]
        missing: Any = np.full(first.shape, "" if first.dtype.kind == "U" else np.nan)
        return np.array([missing if row is None else row for row in rows])

    @checked
    def best(self, name: str, *, highest: bool = False) -> int:
        """Return the index of the trial whose value is lowest, or highest; failed ones do not count.

        Raises:
            UnknownNameError: no trial returned such a value.
            InvalidInputError: it is no single number, or NaN for all trials.
        """
        values = self.values(name)
        if values.ndim != 1 or values.dtype.kind not in "bif" or np.isnan(values.astype(float)).all():
            raise InvalidInputError(f"{name!r} is no single number for each trial, so none is best")
        return int(np.nanargmax(values) if highest else np.nanargmin(values))

    @checked
    def row(self, index: int) -> dict[str, Any]:
        """Return the parameters of one trial, as numbers, strings and lists."""
        return {name: column[index].tolist() for name, column in self.params.items()}

    @checked
    def save_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a table: a line for each finished trial, with its parameters, its single values, and its error.

        Raises:
            FileWriteError: the file cannot be written.
        """
        done = [trial for trial in self.trials if trial is not None]
        single = [name for name in self.names if all(t.values[name].ndim == 0 for t in done if name in t.values)]
        with replacing(path) as partial, open(partial, "w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(["trial", *self.params, *single, "error"])
            for trial in done:
                values = [trial.values[name].item() if name in trial.values else "" for name in single]
                table.writerow([trial.index, *self.row(trial.index).values(), *values, trial.error or ""])


@checked
def sweep(
    trial: Callable[[Any, Any], Any] | Each,
    params: Any,
    *,
    world: World | Callable[[], World] | None = None,
    executor: Executor | None = None,
    results: str | os.PathLike[str] | None = None,
    batch: bool | int = True,
    samples: int | None = None,
    seed: int = 0,
    stop: Callable[[Trial], bool] | None = None,
    repeats: int = 2,
    device: str | None = None,
    progress: bool | None = None,
) -> SweepResult:
    """Run a trial for many parameters, record each as it finishes, and go on where a killed run of it left off.

    Without an executor, trials run as batches on the device, in chunks that fit its memory. With one they run in its
    workers, a few at a time. The results are the same to the bit, on one kind of device and version of Warp.

    Args:
        trial: ``trial(world, params) -> dict``: ``world`` is a batch of n >= 2 copies of ``world``, ``params`` holds
            arrays (n, ...) by name, and so does what is returned (numbers, bools or strings). A lone trial is run
            twice, so that it gets a batch too. Or ``each(function)``, for one world at a time, over an executor only.
            For an executor other than threads it must be a function that others can import.
        params: A grid, a list or a sampler (see `nuno.search.parameters.make_parameters`).
        world: The world that trials start from, or an importable function that makes it, which every worker process
            calls once; None where trials make their own.
        executor: Any ``concurrent.futures.Executor``: a process pool, or a Dask client's ``get_executor()``.
        results: Results file (JSON lines). Trials that it holds already are not run again.
        batch: How many trials at once: True lets the device decide (16 for each task of an executor), a number is the
            most, False is one.
        samples: How many trials a sampler gives.
        seed: Of the sampler.
        stop: Is told every finished trial, those in the results file included; where it returns True, no more are
            started. Those of the same batch are still recorded.
        repeats: How often a trial is run again whose worker died; once in any case where others ran beside it.
        device: Where batches run; None is the world's device. Of several CUDA devices each worker takes its own.
        progress: Progress bar; None shows one in a terminal after two seconds.

    Raises:
        InvalidInputError: an argument that cannot be used, or a trial that returns something else.
        ResultsInUseError: another sweep writes to the results file.
        ResultsMismatchError: the results file is of another trial or of other parameters.
        FileFormatError: the results file is none, or damaged.
        FileWriteError: it cannot be written: a read-only folder, a full disk. What it holds stays whole.
        WorkerLostError: the executor is broken for good.
    """
    parameters = make_parameters(params, samples, seed)
    together = _checked_batch(batch)
    count("repeats", repeats, low=0)
    check_trial(trial, executor)
    source = make_source(world, device)
    if executor is not None and not isinstance(executor, ThreadPoolExecutor):
        check_importable(trial, "the trial")
        source.check_importable()
    if results is None:
        return _run(trial, parameters, source, world, executor, None, together, stop, repeats, progress)
    with ResultsFile(results, make_header(name_of(trial), source.name, parameters)) as file:
        return _run(trial, parameters, source, world, executor, file, together, stop, repeats, progress)


@checked
def read_sweep(path: str | os.PathLike[str]) -> SweepResult:
    """Read a results file, also one that a sweep is writing to: the trials that it holds, in their order.

    A torn last line is left out. Where trials are missing, the others have other places than in the sweep; how many
    the sweep has is ``planned``.

    Args:
        path: Of the file that ``sweep`` was given as ``results``.

    Raises:
        FileFormatError: it is no results file, or damaged.
    """
    file = FilePath(path)
    try:
        data = file.read_bytes()
    except (OSError, ValueError) as problem:
        raise FileFormatError(f"{file} cannot be read: {problem}") from problem
    data = data[: data.rfind(b"\n") + 1]
    planned = read_header(data, file).get("trials")
    if not isinstance(planned, int) or planned < 0:
        raise FileFormatError(f"{file} is damaged: its header says that the sweep has {planned!r} trials")
    entries = sorted(read_entries(data, file), key=lambda entry: entry[0].index)
    if not entries:
        return SweepResult({}, [], planned=planned)
    if not 0 <= entries[0][0].index <= entries[-1][0].index < planned:
        found = f"{entries[0][0].index} to {entries[-1][0].index}"
        raise FileFormatError(f"{file} holds trials {found}, and its sweep has {planned}, from 0 on")
    trials: list[Trial | None] = [Trial(k, trial.values, trial.error) for k, (trial, _) in enumerate(entries)]
    return SweepResult(from_rows([row for _, row in entries]).columns, trials, planned=planned)


def check_trial(trial: Any, executor: Executor | None) -> None:
    """Check that a trial can be run here, or over the executor.

    Raises:
        InvalidInputError: it cannot.
    """
    if not callable(trial) and not isinstance(trial, Each):
        raise InvalidInputError(f"the trial must be a function trial(world, params), got {type(trial).__name__}")
    if executor is not None and not isinstance(executor, Executor):
        raise InvalidInputError(
            f"executor must be a concurrent.futures.Executor (of a Dask client: client.get_executor()), got "
            f"{type(executor).__name__}"
        )
    if isinstance(trial, Each) and executor is None:
        raise InvalidInputError("each(trial) takes one world at a time and runs over an executor; pass executor=")


def outcomes(
    trial: Any, source: WorldSource, given: Any, parameters: Parameters, indices: Sequence[int],
    executor: Executor | None, together: int | None, repeats: int, worlds: Worlds | None = None,
) -> Generator[list[Trial], None, None]:  # fmt: skip
    """Run trials here in chunks, or over an executor; yield those that finish, as they do."""
    if executor is not None:
        if isinstance(trial, Each):
            together = 1  # they would run one after another in a task too, but be recorded later
        yield from run_on_executor(
            trial, source, parameters, indices, executor, together=together or LANES, repeats=repeats
        )
        return
    if not indices:
        return
    worlds = worlds or Worlds(source, given if isinstance(given, World) else None)
    size = ChunkSize(worlds.device, together)
    left = list(indices)
    while left:
        chunk = left[: size.begin()]
        clock = time.perf_counter()
        yield run_rows(trial, worlds, chunk, parameters.rows(chunk))
        size.end(len(chunk), time.perf_counter() - clock)
        left = left[len(chunk) :]


def _run(
    trial: Any, parameters: Parameters, source: WorldSource, given: Any, executor: Executor | None,
    file: ResultsFile | None, together: int | None, stop: Callable[[Trial], bool] | None, repeats: int,
    progress: bool | None,
) -> SweepResult:  # fmt: skip
    from tqdm import tqdm

    trials: list[Trial | None] = [None] * parameters.trial_count
    stopped = False
    for old in file.finished if file is not None else ():
        if not 0 <= old.index < len(trials):
            raise FileFormatError(f"the results file holds trial {old.index}; there are {len(trials)}")
        trials[old.index] = old
        stopped = stopped or (stop is not None and bool(stop(old)))
    left = [k for k, trial in enumerate(trials) if trial is None]
    if len(left) < len(trials):
        log.info("%d of %d trials are in the results file", len(trials) - len(left), len(trials))
    hidden = None if progress is None else not progress
    with tqdm(
        total=len(trials), initial=len(trials) - len(left), desc="trials", disable=hidden,
        delay=0.0 if progress else 2.0, leave=bool(progress),
    ) as bar:  # fmt: skip
        running = outcomes(trial, source, given, parameters, left, executor, together, repeats)
        try:
            for finished in () if stopped else running:
                if file is not None:
                    file.append(finished, parameters)
                for each in finished:
                    trials[each.index] = each
                bar.update(len(finished))
                if stop is not None and any([stop(each) for each in finished]):
                    stopped = True
                    break
        finally:
            running.close()  # what is still waiting in an executor is cancelled, also where Ctrl-C ends the sweep
    return SweepResult(parameters.columns, trials, stopped)


def _checked_batch(batch: Any) -> int | None:
    if isinstance(batch, bool | np.bool_):
        return None if batch else 1
    return count("batch", batch)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
