"""The CUDA plan for bodies that take the whole device: all its blocks go through a frame together, in one launch.

Each world has a block group, which takes more worlds in turn where there are many. Blocks wait for each other
inside of the launch (`nuno.numbers.block_group`), which takes half as long as beginning another. Where the device has
no room for all blocks at once, each world has a single block, which waits for nobody.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import warp as wp

from nuno.numbers.block_group import ARRIVALS, COUNT, RESIDENCY, counts_of
from nuno.state.cloth_state import ALL_PARTS

log = logging.getLogger(__name__)

CALLS = 64
"""Launches of parts of substeps between two looks at whether all blocks found room."""


class GridPlan:
    """A launch a frame of as many blocks as there are multiprocessors.

    Args:
        kernels: For coordinates as floats, and as doubles.
        state: The state of all worlds, coordinates as floats.
        before: What the kernels take between states and settings.
        after: Gives, for the number of blocks in a group, what they take behind these; then come the launch's counts,
            its number, substeps, block groups, and the blocks and threads of each.
        device: "cuda:0" ..., or "cpu", where one thread does everything.
        worlds: How many there are.
        block_groups: How many of them are gone through at once, each by a block group.
        blocks: Of a block group.
        threads: Of a block.
        parts: Does parts of a substep where the kernels cannot. It takes the settings, the substeps and the state with
            doubles, or None.
    """

    def __init__(
        self, kernels: tuple[Any, Any], state: Any, before: Sequence[Any], after: Callable[[int], Sequence[Any]],
        device: str, worlds: int, block_groups: int, blocks: int, threads: int,
        parts: Callable[[Any, int, Any], None] | None = None,
    ) -> None:  # fmt: skip
        self._kernels, self._state, self._before, self._after = kernels, state, before, after
        self._device, self._worlds, self._block_groups, self._blocks = device, worlds, block_groups, blocks
        self._threads = threads if device.startswith("cuda") else 1
        self._parts = parts
        # counts of the launches that did parts of substeps and were not looked at yet, and how many these are
        self._counts: wp.array | None = None
        self._calls = 0
        self._left_out = False

    def run(self, run: Any, substeps: int, doubles: Any = None) -> None:
        """Advance by ``substeps`` substeps under the settings ``run``, with doubles if ``doubles`` is given."""
        if run.parts != ALL_PARTS:
            (self._parts or self._run_parts)(run, substeps, doubles)
            return
        frames = range(0, substeps, run.frame)
        counts = self._new_counts(len(frames))
        for call, first in enumerate(frames):
            self._launch(run, min(run.frame, substeps - first), doubles, counts, call)
        if self._blocks > 1:
            done = self._find_done(counts, len(frames))
            if done < len(frames):
                self._give_up_block_groups()
                run.first = done * run.frame
                self._launch(run, substeps - run.first, doubles, counts, 0)

    def left_out(self) -> bool:
        """Return True if parts of substeps since this was asked last were not done, as blocks found no room.

        All that came after them is then to be gone through again.
        """
        self._look_back()
        left_out, self._left_out = self._left_out, False
        return left_out

    def _run_parts(self, run: Any, substeps: int, doubles: Any) -> None:
        """Launch without a look at whether all blocks found room: see `left_out`."""
        if self._calls == CALLS:
            self._look_back()
        if self._counts is None:
            self._counts = self._new_counts(CALLS)
        self._launch(run, substeps, doubles, self._counts, self._calls)
        self._calls += 1

    def _look_back(self) -> None:
        if self._calls and self._blocks > 1 and self._find_done(self._counts, self._calls) < self._calls:
            self._give_up_block_groups()
            self._left_out = True
        self._counts, self._calls = None, 0

    def _new_counts(self, calls: int) -> wp.array:
        return wp.zeros(calls * counts_of(self._block_groups), dtype=int, device=self._device)

    def _find_done(self, counts: Any, calls: int) -> int:
        """Return the first of the launches whose blocks were not all there, or ``calls``."""
        residency = counts.numpy().reshape(-1, ARRIVALS + self._block_groups, COUNT)[:calls, RESIDENCY, 0]
        return int((residency == 1).sum())  # after one that failed all do

    def _give_up_block_groups(self) -> None:
        log.warning("a CUDA device is too busy for a launch of %d blocks: each world has one from now on", self._blocks)
        self._block_groups, self._blocks = self._worlds, 1  # which wait for nobody, and give the same bits

    def _launch(self, run: Any, substeps: int, doubles: Any, counts: Any, call: int) -> None:
        states = [self._state] if doubles is None else [doubles, self._state]
        inputs = [*states, *self._before, run, *self._after(self._blocks), counts, call, substeps]
        inputs += [self._block_groups, self._blocks, self._threads]
        dim = self._block_groups * self._blocks * self._threads
        kernel = self._kernels[doubles is not None]
        wp.launch(kernel, dim=dim, inputs=inputs, device=self._device, block_dim=self._threads)


def block_groups_of(worlds: int, cores: int, shared: float) -> tuple[int, int]:
    """Return how many worlds are gone through at once, and the blocks of each: so many multiprocessors, shared out.

    Where worlds are more than can be at once, block groups take several in turn; it may be quicker to do so earlier.

    Args:
        worlds: How many there are.
        cores: The device's multiprocessors.
        shared: What is shared out among the blocks of a block group, beside waits and what a single thread does: a
            substep by b blocks takes as long as 1 + shared / b.
    """

    def cost(block_groups: int) -> float:
        return -(-worlds // block_groups) * (1.0 + shared / (cores // block_groups))

    block_groups = min(range(1, min(worlds, cores) + 1), key=cost)
    return block_groups, cores // block_groups


def cores_of(device: str) -> int:
    """Return a device's multiprocessors; 1 on the CPU."""
    return int(wp.get_device(device).sm_count) if device.startswith("cuda") else 1
