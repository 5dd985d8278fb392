"""Whether an image is sharp and well exposed enough to measure in."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import ImageError, ImageQualityError
from nuno.validation import as_array, checked

MOST_BLUR = 2.0
"""Standard deviation of an edge's blur [px] of an image of 1000 px or less; of wider ones 0.2 % of the width."""
MOST_CLIPPED = 0.15
"""Share of an image's pixels that may be as bright as can be told."""
LEAST_BRIGHT = 40
"""Level of 255 that the brightest tenth of an image reaches."""
_CLIPPED = 252  # cameras and JPEG put what is clipped a little below 255
_EDGE = 8.0  # gradients of so many times the median count as edges


@dataclass(frozen=True)
class ImageQuality:
    """How sharp and how exposed an image is.

    Attributes:
        blur: Standard deviation of its edges' blur [px], by the variance of its Laplacian relative to that of its
            gradient: 1 / (2 blur^2) across an edge that a Gaussian blurs. inf where it has no edges.
        clipped: Share of pixels as bright as can be told.
        bright: The level of 255 that its brightest tenth reaches.
    """

    blur: float
    clipped: float
    bright: float


@checked
def image_quality(image: ArrayLike, region: ArrayLike | None = None) -> ImageQuality:
    """Measure an image.

    Args:
        image: (h, w, 3) uint8 RGB, or (h, w) uint8.
        region: (h, w) bool, where; None is all of it.

    Raises:
        ImageError: no such image, or a region of another size.
    """
    array = as_array("image", image, ImageError)
    if array.dtype != np.uint8 or array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] != 3) or not array.size:
        raise ImageError(f"an image must be uint8 (h, w, 3) or (h, w), got {array.dtype} of shape {array.shape}")
    where = np.ones(array.shape[:2], dtype=bool) if region is None else as_array("region", region, ImageError).astype(bool)
    if where.shape != array.shape[:2] or not where.any():
        raise ImageError(f"region must be bool of shape {array.shape[:2]}, with something in it, got {where.shape}")
    brightest = array.max(axis=-1) if array.ndim == 3 else array
    grey = (cv2.cvtColor(array, cv2.COLOR_RGB2GRAY) if array.ndim == 3 else array).astype(np.float32)
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)  # else noise is taken for sharpness
    x, y = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125)
    slope = np.hypot(x, y)
    edges = (slope > max(_EDGE * float(np.median(slope[where])), 2.0)) & where
    blur = np.inf
    if edges.sum() >= 50:
        strong = slope > np.quantile(slope[edges], 0.5)
        near = cv2.dilate((edges & strong).astype(np.uint8), np.ones((9, 9), np.uint8)).astype(bool) & where
        # of a narrow stencil each: the Laplacian by central differences
        bend = cv2.Laplacian(smooth, cv2.CV_32F, ksize=1)
        ratio = float((bend[near] ** 2).sum() / max(float((slope[near] ** 2).sum()), 1e-9))
        blur = float(np.sqrt(max(0.5 / ratio - 1.0, 0.0))) if ratio > 0 else np.inf
    return ImageQuality(blur, float((brightest[where] >= _CLIPPED).mean()), float(np.quantile(brightest[where], 0.9)))


def check_quality(image: np.ndarray, name: str, region: np.ndarray | None = None, clipped: float = MOST_CLIPPED) -> ImageQuality:
    """Return an image's quality where it is good enough.

    Args:
        image: (h, w, 3) uint8 RGB.
        name: What to call it in a message.
        region: (h, w) bool, where to look, or None.
        clipped: Share of it that may be as bright as can be told.

    Raises:
        ImageQualityError: blurred, too bright or too dark.
    """
    found = image_quality(image, region)
    limit = MOST_BLUR * max(1.0, image.shape[1] / 1000.0)
    if found.bright < LEAST_BRIGHT:
        raise ImageQualityError(
            f"{name} is too dark: its brightest tenth begins at level {found.bright:.0f} of 255, {LEAST_BRIGHT} are needed; "
            "more light, or a longer exposure"
        )
    if found.clipped > clipped:
        raise ImageQualityError(
            f"{name} is overexposed: {found.clipped:.0%} is as bright as can be told, {clipped:.0%} are the limit; less "
            "light, a shorter exposure, or no glare"
        )
    if found.blur > limit:
        how = "shows no edges" if not np.isfinite(found.blur) else f"is blurred by {found.blur:.1f} px"
        raise ImageQualityError(
            f"{name} {how}, {limit:.1f} px are the limit: focus, hold board and camera still, and give more light"
        )
    return found
