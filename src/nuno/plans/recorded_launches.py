"""Kernel launches that come again with few other arguments: recorded once, so that Warp packs only what is new.

Where bodies are stepped together each phase of a substep is a launch by itself. On the CPU Warp takes longer to pack
what such a launch is given, structures of arrays, than the launch takes to run.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import warp as wp


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
        key = (kernel, name)
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
        command.launch()
