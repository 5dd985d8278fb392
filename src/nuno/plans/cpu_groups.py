"""Groups of lanes on the cores of the CPU."""

from __future__ import annotations

from queue import Empty, SimpleQueue
from typing import Any

import warp as wp

from nuno.plans.cpu_threads import work_together
from nuno.plans.recorded_launches import RecordedLaunches
from nuno.state.cloth_state import Settings

PIECES = 12
"""Launches of a group of lanes in a run, between which threads may change groups."""


def launch_groups(
    launches: RecordedLaunches, kernel: Any, before: list[Any], shapes: Any, groups: int, run: Settings, substeps: int
) -> None:
    """Run a kernel over every group of lanes, a thread per core.

    Runs that are short are recorded launches: bodies that go together launch them at every substep. Several groups go
    through a longer run piece by piece, so that three groups on two cores take one and a half times as long as one, not
    twice. Warp's CPU launches release the GIL.

    Args:
        launches: Where it is recorded.
        kernel: Which; its arguments are ``before``, settings, ``shapes``, a group and a number of substeps.
        before: Its first arguments.
        shapes: What the bodies may touch.
        groups: How many there are.
        run: Settings of the run.
        substeps: Its length.
    """
    if groups == 1 or substeps < 2 * PIECES:
        launches.launch_parts(kernel, 1, [*before, run, shapes], range(groups), [substeps])
        return
    wp.load_module(kernel.module, device="cpu")  # here, for every thread would compile it for itself
    pieces = [_from(run, k * substeps // PIECES) for k in range(PIECES)]
    ends = [piece.first - run.first for piece in pieces[1:]] + [substeps]
    waiting: SimpleQueue[tuple[int, int]] = SimpleQueue()
    for group in range(groups):
        waiting.put((group, 0))

    def work() -> None:
        while True:
            try:
                group, k = waiting.get_nowait()
            except Empty:
                return
            inputs = [*before, pieces[k], shapes, group, ends[k] - (pieces[k].first - run.first)]
            wp.launch(kernel, dim=1, inputs=inputs, device="cpu")
            if k + 1 < len(pieces):
                waiting.put((group, k + 1))

    work_together(work, groups)


def _from(run: Settings, start: int) -> Settings:
    """The same settings from a later substep on."""
    later = Settings()
    for name in run._cls.vars:  # type: ignore[attr-defined]
        setattr(later, name, getattr(run, name))
    later.first = run.first + start
    return later
