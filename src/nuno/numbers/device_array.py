"""The type of arrays on a device that programs are given: Warp arrays, with NumPy's types for type checkers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import warp as wp

    class DeviceArray(wp.array[Any, Any]):
        """A Warp array, on the CPU or a CUDA device.

        NumPy, PyTorch and JAX take it without a copy (``from_dlpack``); ``numpy()`` copies it from a GPU.
        """

        def numpy(self) -> np.ndarray:  # type: ignore[override]
            """Return it as a NumPy array, without a copy on the CPU."""

else:
    DeviceArray = Any
