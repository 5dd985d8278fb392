"""Running some trials in this process: in a batch, and by themselves where one of them fails."""

from __future__ import annotations

import gc
import logging
from collections.abc import Sequence
from typing import Any

import numpy as np

from nuno.search.trial import Each, Trial, name_of
from nuno.search.values import rows_of, single_row
from nuno.search.world_source import Worlds

log = logging.getLogger(__name__)


def run_rows(trial: Any, worlds: Worlds, indices: Sequence[int], columns: dict[str, np.ndarray]) -> list[Trial]:
    """Run trials: all in one batch, or one by one where the trial takes single worlds.

    A world gives in any batch what it gives alone, to the bit. So where an error names the worlds that it comes from
    (``worlds``, as `SimulationDiverged` does), these have failed and the others are run again without them; where it
    does not, or memory runs out, both halves are run by themselves, down to the trials that fail alone.

    Args:
        trial: The trial.
        worlds: Where its worlds come from.
        indices: The trials' numbers.
        columns: Their parameters, one row each.

    Raises:
        InvalidInputError: what the trial returns cannot be used.
    """
    if isinstance(trial, Each):
        return [_run_single(trial, worlds, k, columns, row) for row, k in enumerate(indices)]
    done: dict[int, Trial] = {}
    waiting = [list(range(len(indices)))]
    while waiting:
        rows = waiting.pop()
        found, problem = _run_batch(trial, worlds, rows, columns)
        if problem is None:
            for row, values in zip(rows, found, strict=True):
                done[row] = Trial(indices[row], values)
            continue
        kind, message, named = problem
        failed = sorted({rows[w] if len(rows) > 1 else rows[0] for w in named if 0 <= w < max(len(rows), 2)})
        if len(rows) == 1 or failed:
            for row in failed or rows:
                done[row] = _failure(indices[row], kind, message)
            others = [row for row in rows if row not in done]
            waiting += [others] if others else []
        else:
            if "alloc" in message or kind == "MemoryError":
                gc.collect()  # what the batch held on a device, before more is asked of it
            log.info("a batch of %d trials raised %s: %s; its halves are run again", len(rows), kind, message)
            waiting += [rows[len(rows) // 2 :], rows[: len(rows) // 2]]
    return [done[row] for row in range(len(indices))]


def _run_batch(
    trial: Any, worlds: Worlds, rows: list[int], columns: dict[str, np.ndarray]
) -> tuple[list[dict[str, np.ndarray]], tuple[str, str, tuple[int, ...]] | None]:
    """Return the values of every row, or what was raised: its kind, message and the worlds that it names."""
    # a trial of batches never gets a single world, whose arrays have no axis of worlds: one row is run twice
    padded = rows if len(rows) > 1 else [*rows, *rows]
    given = {name: column[padded] for name, column in columns.items()}
    batch = worlds.copies(len(padded))
    try:
        returned = trial(batch, given)
    except Exception as error:
        log.debug("a batch of %d trials failed", len(rows), exc_info=True)
        named = getattr(error, "worlds", ())
        return [], (type(error).__name__, str(error), tuple(named) if isinstance(named, tuple | list) else ())
    return rows_of(returned, len(padded), name_of(trial))[: len(rows)], None


def _run_single(trial: Each, worlds: Worlds, index: int, columns: dict[str, np.ndarray], row: int) -> Trial:
    world = worlds.copies(1)
    try:
        returned = trial.function(world, {name: column[row].tolist() for name, column in columns.items()})
    except Exception as error:
        log.debug("trial %d failed", index, exc_info=True)
        return _failure(index, type(error).__name__, str(error))
    return Trial(index, single_row(returned, name_of(trial)))


def _failure(index: int, kind: str, message: str) -> Trial:
    log.warning("trial %d failed: %s: %s", index, kind, message)
    return Trial(index, {}, f"{kind}: {message}")
