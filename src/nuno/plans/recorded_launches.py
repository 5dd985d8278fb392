"""Kernel launches that come again with few other arguments: recorded once, so that Warp packs only what is new.

Where bodies are stepped together each phase of a substep is a launch by itself. On the CPU Warp takes longer to pack
what such a launch is given, structures of arrays, than the launch takes to run.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from nuno.plans.cpu_threads import core_count, run_together

PARTS, FEWEST = 3, 4
"""Parts that worlds are cut into for each core, as some take longer than others; and worlds of a part, at least."""


class RecordedLaunches:
    """Launches on a device, recorded by kernel.

    Args:
        device: Where they run.
        block_dim: Threads of a CUDA block.
    """

    def __init__(self, device: str, block_dim: int) -> None:
        self._device, self._block_dim = device, block_dim
        self._recorded: dict[Hashable, tuple[Any, list[Any], Any]] = {}

    def launch(self, kernel: Any, dim: int | tuple[int, ...], inputs: Sequence[Any], name: Hashable = None) -> None:
        """Launch a kernel as ``wp.launch`` does.

        What is the same object as in the launch before is not packed again. Fields of structures may change meanwhile:
        Warp reads them when it launches.

        Args:
            kernel: Which.
            dim: Threads.
            inputs: Its arguments.
            name: Tells launches of one kernel apart that take turns with different structures.
        """
        self._recording(kernel, dim, inputs, (kernel, name)).launch()

    def launch_worlds(self, kernel: Any, worlds: int, threads: int, inputs: Sequence[Any]) -> None:
        """Launch a kernel over worlds: on the CPU a part of them on each core.

        Args:
            kernel: Which; its last argument is the first world of a launch.
            worlds: How many there are; none must touch what another's launch does.
            threads: Of a world.
            inputs: Its other arguments.
        """
        run_together([
            self.launch_of_part(kernel, part, threads, inputs)
            for part in (parts_of(worlds) if self._device == "cpu" else ((0, worlds),))
        ])  # fmt: skip

    def launch_of_part(
        self, kernel: Any, part: tuple[int, int], threads: int, inputs: Sequence[Any], name: Hashable = None
    ) -> Callable[[], Any]:
        """Return the launch of a kernel in a part of the worlds, from the first up to another, to be called.

        Args:
            kernel: See `launch_worlds`.
            part: The first world, and the first after the part.
            threads: See `launch_worlds`.
            inputs: Likewise.
            name: Tells launches of one kernel apart that take turns with different arguments.
        """
        first, end = part
        launch: Callable[[], Any]
        launch = self._recording(kernel, threads * (end - first), [*inputs, first], (kernel, first, name)).launch
        return launch

    def launch_parts(
        self, kernel: Any, dim: int, inputs: Sequence[Any], parts: Sequence[int], last: Sequence[Any]
    ) -> None:  # fmt: skip
        """Launch a kernel once for each of some parts, on all cores of the CPU.

        Args:
            kernel: Which.
            dim: Threads of a launch.
            inputs: Its arguments before the one that says which part it is.
            parts: Which there are; none must touch what another's launch does.
            last: Its arguments after that.
        """
        run_together(
            [self._recording(kernel, dim, [*inputs, part, *last], (kernel, part)).launch for part in parts]
        )  # fmt: skip

    def _recording(self, kernel: Any, dim: int | tuple[int, ...], inputs: Sequence[Any], key: Hashable) -> Any:
        """Return the launch that is recorded by a key, with these arguments."""
        if key not in self._recorded:
            command = wp.launch(
                kernel, dim=dim, inputs=list(inputs), device=self._device, block_dim=self._block_dim, record_cmd=True
            )
        else:
            command, before, dim_before = self._recorded[key]
            if dim != dim_before:
                command.set_dim(dim)
            for k, (value, old) in enumerate(zip(inputs, before, strict=True)):
                if value is not old:
                    command.set_param_at_index(k, value)
        self._recorded[key] = command, list(inputs), dim
        return command


@lru_cache(maxsize=64)
def parts_of(worlds: int) -> tuple[tuple[int, int], ...]:
    """Return the parts that worlds are cut into on the CPU: of each the first world, and the first after it."""
    parts = max(1, min(PARTS * core_count(), worlds // FEWEST))
    return tuple(pairwise(np.linspace(0, worlds, parts + 1).astype(int).tolist()))
