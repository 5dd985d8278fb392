"""The place of a cloth in a colour image, by the colours that it had in the first one."""

from __future__ import annotations

import numpy as np

from nuno.errors import ClothNotFoundError

BINS = (8, 24, 24)
"""Of lightness, which shadows change most, and of the two axes of colour, in CIE Lab."""
SMOOTH = 1.0
"""Pixels that every bin has beforehand, of cloth and of all else."""
MIN_PIXELS = 30
"""Pixels of cloth, and of all else, of which colours can be learnt."""


class ClothColours:
    """The colours of a cloth beside those of all else: two histograms, and Bayes' rule.

    Args:
        image: (h, w, 3) uint8 RGB.
        cloth: (h, w) bool, where the cloth is in it.
        other: (h, w) bool, where it surely is not.

    Raises:
        ClothNotFoundError: too few pixels of either.
    """

    def __init__(self, image: np.ndarray, cloth: np.ndarray, other: np.ndarray) -> None:
        if min(int(cloth.sum()), int(other.sum())) < MIN_PIXELS:
            raise ClothNotFoundError(
                f"the first image has {int(cloth.sum())} pixels where the world has the cloth, and {int(other.sum())} "
                f"of all else; {MIN_PIXELS} of both are needed to learn colours: give masks, or look at the cloth"
            )
        index = self._index(image)
        counts = [np.bincount(index[where], minlength=int(np.prod(BINS))) + SMOOTH for where in (cloth, other)]
        self._is_cloth = counts[0] / counts[0].sum() > counts[1] / counts[1].sum()

    def mask(self, image: np.ndarray) -> np.ndarray:
        """Return (h, w) bool, where an image (h, w, 3) uint8 RGB is more likely cloth than anything else."""
        import cv2

        found = self._is_cloth[self._index(image)].astype(np.uint8)
        return cv2.medianBlur(found, 3).astype(bool)  # single pixels are noise

    @staticmethod
    def _index(image: np.ndarray) -> np.ndarray:
        import cv2

        lab = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2LAB).astype(np.int32)
        bins = [lab[..., k] * count // 256 for k, count in enumerate(BINS)]
        return np.asarray((bins[0] * BINS[1] + bins[1]) * BINS[2] + bins[2])
