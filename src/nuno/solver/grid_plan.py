"""The CUDA plan for bodies that take the whole device: all its blocks go through a frame together, in one launch.

Each world has a team of blocks, which takes more worlds in turn where there are many. Blocks wait for each other inside
of the launch (`nuno.solver.team`), which takes half as long as beginning another. Where the device has no room for all
blocks at once, other launches take over.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import warp as wp

from nuno.solver.state import ALL_PARTS
from nuno.solver.team import ARRIVED, COUNT, VERDICT, counts_of

log = logging.getLogger(__name__)


class GridPlan:
    """A launch a frame of as many blocks as there are multiprocessors.

    Args:
        kernels: For coordinates as floats, and as doubles.
        state: The state of all worlds, coordinates as floats.
        before: What the kernels take between states and settings.
        after: What they take behind these; then come the launch's counts, its number, substeps, teams, and the blocks
            and threads of each.
        device: "cuda:0" ..., or "cpu", where one thread does everything.
        teams: How many worlds are gone through at once, each by a team of blocks.
        blocks: Of a team.
        threads: Of a block.
        otherwise: Does what a launch of this plan cannot: parts of a substep, and all where not all blocks find room on
            the device. It takes the settings, the substeps and the state with doubles, or None.
    """

    def __init__(
        self, kernels: tuple[Any, Any], state: Any, before: Sequence[Any], after: Sequence[Any], device: str,
        teams: int, blocks: int, threads: int, otherwise: Callable[[Any, int, Any], None],
    ) -> None:  # fmt: skip
        self._kernels, self._state, self._before, self._after = kernels, state, before, after
        self._device, self._teams, self._blocks = device, teams, blocks
        self._threads = threads if device.startswith("cuda") else 1
        self._otherwise = otherwise
        self._crowded = False

    def run(self, run: Any, substeps: int, fine: Any = None) -> None:
        """Advance by ``substeps`` substeps under the settings ``run``, coordinates as doubles if there is ``fine``."""
        if run.parts != ALL_PARTS or self._crowded:
            self._otherwise(run, substeps, fine)
            return
        frames = range(0, substeps, run.frame)
        gate = wp.zeros(len(frames) * counts_of(self._teams), dtype=int, device=self._device)
        states = [self._state] if fine is None else [fine, self._state]
        kernel = self._kernels[fine is not None]
        for call, first in enumerate(frames):
            inputs = [*states, *self._before, run, *self._after, gate, call, min(run.frame, substeps - first)]
            inputs += [self._teams, self._blocks, self._threads]
            dim = self._teams * self._blocks * self._threads
            wp.launch(kernel, dim=dim, inputs=inputs, device=self._device, block_dim=self._threads)
        verdicts = gate.numpy().reshape(len(frames), ARRIVED + self._teams, COUNT)[:, VERDICT, 0]
        if (verdicts != 1).any():
            self._crowded = True
            log.warning("a CUDA device is too busy for a launch of %d blocks: smaller ones go on", self._blocks)
            run.first = int((verdicts == 1).sum()) * run.frame
            self._otherwise(run, substeps - run.first, fine)


def teams_of(worlds: int, cores: int, shared: float) -> tuple[int, int]:
    """Return how many worlds are gone through at once, and the blocks of each: so many multiprocessors, shared out.

    Where worlds are more than can be at once, teams take several in turn; it may be quicker to do so earlier.

    Args:
        worlds: How many there are.
        cores: The device's multiprocessors.
        shared: What is shared out among the blocks of a team, beside waits and what a single thread does: a substep by
            b blocks takes as long as 1 + shared / b.
    """

    def cost(teams: int) -> float:
        return -(-worlds // teams) * (1.0 + shared / (cores // teams))

    teams = min(range(1, min(worlds, cores) + 1), key=cost)
    return teams, cores // teams


def cores_of(device: str) -> int:
    """Return a device's multiprocessors; 1 on the CPU."""
    return int(wp.get_device(device).sm_count) if device.startswith("cuda") else 1
