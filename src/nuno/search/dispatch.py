"""Running trials over an executor: tasks that are handed out a few at a time, and again where a worker dies."""

from __future__ import annotations

import logging
import multiprocessing
import os
import threading
import uuid
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError, WorkerLostError
from nuno.search.parameters import Parameters
from nuno.search.rows import run_rows
from nuno.search.trial import Trial, find, named_of
from nuno.search.world_source import WorldSource, worlds_in_worker

log = logging.getLogger(__name__)

MAX_IN_FLIGHT = 256
"""Tasks in flight where an executor does not say how many workers it has."""


@dataclass(frozen=True, eq=False)
class Task:
    """A task as a worker gets it.

    Attributes:
        trial: The trial.
        source: Where its worlds come from.
        indices: Which trials.
        columns: Their parameters.
        search: The search that it belongs to: its world is made once in a worker.
        home: Process that hands it out.
        lost: How often its worker died.
        name: Another one at each attempt, as some schedulers do not run equal tasks twice.
    """

    trial: Any
    source: WorldSource
    indices: tuple[int, ...]
    columns: dict[str, np.ndarray]
    search: str
    home: int
    lost: int = 0
    name: str = field(default_factory=lambda: uuid.uuid4().hex)

    def again(self) -> Task:
        """Return the task for another attempt."""
        return replace(self, lost=self.lost + 1, name=uuid.uuid4().hex)

    def singles(self) -> list[Task]:
        """Return a task for each of its trials, to be run once more by itself."""
        return [
            replace(
                self, indices=(index,), columns={name: column[[k]] for name, column in self.columns.items()},
                lost=self.lost + 1, name=uuid.uuid4().hex,
            )
            for k, index in enumerate(self.indices)
        ]  # fmt: skip


_lock = threading.Lock()
_watching: set[int] = set()


def run_task(task: Task) -> list[Trial]:
    """Run a task in a worker; trials that fail are returned as such. Threads of one process take turns."""
    if os.getpid() != task.home:
        _end_with_parent()
    with _lock:
        return run_rows(task.trial, worlds_in_worker(task.source, task.search), task.indices, task.columns)


def run_on_executor(
    trial: Any, source: WorldSource, parameters: Parameters, indices: Sequence[int], executor: Executor, *,
    together: int, repeats: int,
) -> Iterator[list[Trial]]:  # fmt: skip
    """Run trials over an executor, and yield those that finish, as they do.

    Where a worker dies, the tasks that were in flight are run again, one at a time, so that the one that kills its
    worker is known; it fails when it has done so ``repeats`` times, once at least. A process pool that broke is made
    anew.

    Args:
        trial: The trial.
        source: Where its worlds come from.
        parameters: Of all trials.
        indices: The trials to run.
        executor: Where.
        together: How many trials a task holds.
        repeats: How often a trial is run again whose worker died.

    Raises:
        InvalidInputError: the trial or the world's function cannot be used, or workers do not find it.
        WorkerLostError: the executor is broken, and is none that can be made anew.
    """
    check_pool(executor, trial, source)
    search = uuid.uuid4().hex
    parts = [tuple(indices[k : k + together]) for k in range(0, len(indices), together)]
    waiting = deque(Task(trial, source, part, parameters.rows(part), search, os.getpid()) for part in parts)
    suspects: deque[Task] = deque()
    flying: dict[Future[list[Trial]], Task] = {}
    own: Executor | None = None  # a pool made here, in place of one that broke
    try:
        while waiting or suspects or flying:
            current = own or executor
            broken = _hand_out(current, suspects or waiting, flying, 1 if suspects else _in_flight_limit(current))
            lost: list[tuple[Task, BaseException]] = []
            while flying and (broken or not lost):
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    task = flying.pop(future)
                    error = _error_of(future)
                    if error is None:
                        yield future.result()
                    elif isinstance(error, InvalidInputError) or not isinstance(error, Exception):
                        raise error
                    else:
                        broken = broken or isinstance(error, BrokenExecutor)
                        lost.append((task, error))
                if not broken:
                    break
            for task, error in lost:
                log.warning("%d trials lost their worker: %s", len(task.indices), error or type(error).__name__)
                if task.lost < repeats or (task.lost == 0 and len(parts) > 1):  # others may have killed it
                    suspects.append(task.again())
                elif len(task.indices) > 1:
                    suspects.extend(task.singles())
                else:
                    reason = f"WorkerLostError: its worker was lost {task.lost + 1} times; last {type(error).__name__}"
                    yield [Trial(task.indices[0], {}, f"{reason}: {error}")]
            if broken:
                own = _renewed(current)
    finally:
        for future in flying:
            future.cancel()
        if own is not None:
            own.shutdown(wait=False, cancel_futures=True)


def check_pool(executor: Executor, *needed: Any) -> None:
    """Check that a process pool's workers find what is defined in the program itself, before anything is handed out.

    They do not where they were started before it was defined, or where the program is a notebook, a prompt or standard
    input and workers are not forked.

    Args:
        executor: The executor; only process pools are asked.
        needed: The trial, and the source of its worlds.

    Raises:
        InvalidInputError: they do not.
    """
    functions = [part.function if isinstance(part, WorldSource) else part for part in needed]
    own = [named_of(each) for each in functions if each is not None and named_of(each).__module__ == "__main__"]
    if not isinstance(executor, ProcessPoolExecutor) or not own:
        return
    for each in own:
        try:
            asked = executor.submit(is_found, each.__module__, each.__qualname__)
        except BrokenExecutor:
            return  # as it came; it is made anew
        try:
            there = asked.result()
        except BrokenExecutor:
            there = False
        if not there:
            raise InvalidInputError(
                f"{each.__qualname__} is defined in __main__, where the pool's workers do not find it; define it in a "
                "module of its own and import it, or, in a script, put what makes the pool after it and under "
                "if __name__ == '__main__':"
            )


def is_found(module: str, name: str) -> bool:
    """Return True if this process has something by that name."""
    return find(module, name) is not None


def _hand_out(executor: Executor, queue: deque[Task], flying: dict[Future[list[Trial]], Task], room: int) -> bool:
    """Submit tasks while there is room; return whether the executor turned out to be broken."""
    while queue and len(flying) < room:
        try:
            future = executor.submit(run_task, queue[0])
        except BrokenExecutor:
            return True
        flying[future] = queue.popleft()
    return False


def _in_flight_limit(executor: Executor) -> int:
    # one more than there are workers, so that none waits; not many, as all of them are suspects where one dies
    workers = getattr(executor, "_max_workers", None)
    return workers + 1 if isinstance(workers, int) else MAX_IN_FLIGHT


def _error_of(future: Future[list[Trial]]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _renewed(broken: Executor) -> Executor:
    """Return a process pool like one that broke."""
    if not isinstance(broken, ProcessPoolExecutor):
        raise WorkerLostError(
            f"the {type(broken).__name__} is broken and cannot be made anew; what has finished is recorded, so that "
            "the sweep goes on with another executor and the same results file"
        )
    log.warning("the process pool broke and is made anew")
    broken.shutdown(wait=False)
    settings: Any = broken  # a pool does not tell its settings in public
    return ProcessPoolExecutor(
        settings._max_workers, settings._mp_context, settings._initializer, settings._initargs
    )  # fmt: skip


def _end_with_parent() -> None:
    """Let a worker process end with the process that started it, which may be killed: nobody else would end it."""
    parent = multiprocessing.parent_process()
    if parent is None or os.getpid() in _watching:
        return
    _watching.add(os.getpid())

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="nuno-parent-watch", daemon=True).start()
