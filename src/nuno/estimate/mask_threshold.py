"""Masks of real numbers, such as probabilities: refused, or cut at a threshold."""
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, valid-type"

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import number

wp.set_module_options({"enable_backward": False})

_REAL = (wp.float16, wp.float32, wp.float64)


@wp.kernel
def _above(values: wp.array3d[Any], threshold: wp.float64, masks_out: wp.array3d[wp.bool]):
    """A thread cuts one pixel."""
    world, row, column = wp.tid()
    masks_out[world, row, column] = wp.float64(values[world, row, column]) > threshold


for _kind in _REAL:
    wp.overload(_above, {"values": wp.array3d[_kind]})


def is_real(masks: Any) -> bool:
    """Return True if a NumPy or Warp array holds real numbers."""
    return masks.dtype in _REAL if isinstance(masks, wp.array) else masks.dtype.kind == "f"


def cut(masks: Any, threshold: float | None, name: str) -> Any:
    """Return masks of real numbers as bool, true above the threshold; others as they are.

    Args:
        masks: A NumPy or Warp array, (h, w) or (worlds, h, w).
        threshold: None where real numbers are refused.
        name: The masks' name in errors.

    Raises:
        InvalidInputError: real numbers without a threshold, or some that are not finite.
    """
    if not is_real(masks):
        return masks
    on_device = isinstance(masks, wp.array)
    if threshold is None:
        kind = masks.dtype.__name__ if on_device else str(masks.dtype)
        raise InvalidInputError(
            f"{name} of {kind} do not say what is inside; pass bool, or threshold=0.5 to take what is above it"
        )
    level = number("threshold", threshold)
    if not on_device:
        if not np.isfinite(masks).all():
            raise InvalidInputError(f"{name} must be finite")
        return masks > level
    batch = masks if masks.ndim == 3 else masks.reshape((1, *masks.shape))
    found: Any = wp.empty(batch.shape, dtype=wp.bool, device=masks.device)
    wp.launch(_above, dim=batch.shape, inputs=[batch, wp.float64(level), found], device=masks.device)
    return found.reshape(masks.shape)


def images_of(masks: ArrayLike, name: str) -> np.ndarray:
    """Return masks as an array of images.

    Raises:
        InvalidInputError: something else.
    """
    try:
        array = np.asarray(masks)
    except ValueError as error:
        raise InvalidInputError(f"{name} must be an image of bool or whole numbers: {error}") from error
    if array.dtype.kind not in "biuf" or array.ndim < 2:
        raise InvalidInputError(
            f"{name} must be images (h, w) of bool, or of whole numbers of which the non-zero ones are the mask, got "
            f"{array.dtype} {array.shape}"
        )
    return array
