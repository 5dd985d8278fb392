"""Masks of many worlds counted and looked up where they are, so that a number of each world leaves a GPU, and no image.

The kernels are CUDA's; on the CPU NumPy looks at the same memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp


@wp.kernel(enable_backward=False)
def count_fields(masks: wp.array3d(dtype=wp.bool), counts_out: wp.array(dtype=int)):
    """Add up the pixels of each mask that are set, a thread a row."""
    world, row = wp.tid()
    found = int(0)  # noqa: UP018, RUF046  (a variable of Warp, not a constant)
    for column in range(masks.shape[2]):
        if masks[world, row, column]:
            found += 1
    if found > 0:
        wp.atomic_add(counts_out, world, found)


@wp.kernel(enable_backward=False)
def read_fields(
    masks: wp.array3d(dtype=wp.bool), fields: wp.array2d(dtype=wp.vec2i), found_out: wp.array2d(dtype=wp.bool)
):
    """Read each mask at its own rows and columns."""
    world, k = wp.tid()
    field = fields[world, k]
    found_out[world, k] = masks[world, field[0], field[1]]


def count_covered(masks: Any) -> np.ndarray:
    """Return how many pixels of each mask (worlds, h, w) bool are set, (worlds,) int."""
    if masks.device.is_cpu:
        return np.asarray(np.count_nonzero(masks.numpy().reshape(len(masks), -1), axis=1))
    counts: Any = wp.zeros(masks.shape[0], dtype=int, device=masks.device)
    wp.launch(count_fields, dim=masks.shape[:2], inputs=[masks, counts], device=masks.device)
    return np.asarray(counts.numpy())


def look_up_covered(masks: Any, fields: np.ndarray) -> np.ndarray:
    """Return the values of masks (worlds, h, w) bool at rows and columns (worlds, k, 2) int: (worlds, k) bool."""
    if masks.device.is_cpu:
        return np.asarray(masks.numpy()[np.arange(len(fields))[:, None], fields[..., 0], fields[..., 1]])
    given: Any = wp.array(fields.astype(np.int32), dtype=wp.vec2i, device=masks.device)
    found: Any = wp.empty(fields.shape[:2], dtype=wp.bool, device=masks.device)
    wp.launch(read_fields, dim=fields.shape[:2], inputs=[masks, given, found], device=masks.device)
    return np.asarray(found.numpy())
