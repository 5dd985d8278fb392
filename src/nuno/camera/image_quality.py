"""Sharpness and exposure of images, and limits to measure in them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.image import check_any_size
from nuno.errors import ImageError, ImageQualityError
from nuno.validation import as_array, checked

MAX_BLUR = 2.0
"""Standard deviation of an edge's blur [px] of an image of 1000 px or less; of wider ones 0.2 % of the width."""
MAX_CLIPPED = 0.15
"""Share of an image's pixels that may be as bright as can be told."""
MIN_BRIGHT = 40
"""Level of 255 that the brightest tenth of an image reaches."""
_CLIPPED = 252  # cameras and JPEG put what is clipped a little below 255
_SMOOTHING = 0.8  # [px]
_OWN = _SMOOTHING**2 + 1.0 / 3.0  # [px^2] what the smoothing and central differences add to an edge's variance
_NEAR = 15  # [px] about an edge in which its contrast is measured
_CONTRAST = 24.0  # levels from which it counts as one


@dataclass(frozen=True)
class ImageQuality:
    """Sharpness and exposure of an image.

    Attributes:
        blur: Standard deviation of its edges' blur [px], by the quarter of them that is sharpest: an edge of contrast c
            that a Gaussian blurs has the slope c / (sqrt(2 pi) blur). inf where it has no edges.
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
    array = check_any_size(image, "an image")
    where = (
        np.ones(array.shape[:2], dtype=bool) if region is None else as_array("region", region, ImageError).astype(bool)
    )
    if where.shape != array.shape[:2] or not where.any():
        raise ImageError(f"region must be bool of shape {array.shape[:2]}, with something in it, got {where.shape}")
    brightest = array.max(axis=-1) if array.ndim == 3 else array
    grey = (cv2.cvtColor(array, cv2.COLOR_RGB2GRAY) if array.ndim == 3 else array).astype(np.float32)
    smooth = cv2.GaussianBlur(grey, (0, 0), _SMOOTHING)  # else noise is taken for sharpness
    slope = np.hypot(*(cv2.Sobel(smooth, cv2.CV_32F, *way, scale=0.125) for way in ((1, 0), (0, 1))))
    near = np.ones((_NEAR, _NEAR), np.uint8)
    contrast = cv2.dilate(smooth, near) - cv2.erode(smooth, near)
    steepest = (slope >= cv2.dilate(slope, np.ones((5, 5), np.uint8))) & (contrast > _CONTRAST) & where
    blur = np.inf
    if steepest.sum() >= 20:
        widths = contrast[steepest] / (np.sqrt(2.0 * np.pi) * np.maximum(slope[steepest], 1e-6))
        blur = float(np.sqrt(max(float(np.quantile(widths, 0.25)) ** 2 - _OWN, 0.0)))
    return ImageQuality(blur, float((brightest[where] >= _CLIPPED).mean()), float(np.quantile(brightest[where], 0.9)))


def check_quality(
    image: np.ndarray, name: str, region: np.ndarray | None = None, clipped: float = MAX_CLIPPED
) -> ImageQuality:
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
    limit = MAX_BLUR * max(1.0, image.shape[1] / 1000.0)
    if found.bright < MIN_BRIGHT:
        raise ImageQualityError(
            f"{name} is too dark: its brightest tenth begins at level {found.bright:.0f} of 255, {MIN_BRIGHT} are "
            "needed; more light, or a longer exposure"
        )
    if found.clipped > clipped:
        raise ImageQualityError(
            f"{name} is overexposed: {found.clipped:.0%} is as bright as can be told, {clipped:.0%} are the limit; "
            "less light, a shorter exposure, or no glare"
        )
    if found.blur > limit:
        how = "shows no edges" if not np.isfinite(found.blur) else f"is blurred by {found.blur:.1f} px"
        raise ImageQualityError(
            f"{name} {how}, {limit:.1f} px are the limit: focus, hold board and camera still, and give more light"
        )
    return found
