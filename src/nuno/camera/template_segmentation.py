"""A cloth of known outline in an image: by colours where they show that outline, else by the outline itself."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.find_shape import FOUND, FoundShape, find_shape
from nuno.camera.table import Table
from nuno.errors import ClothNotFoundError

AGREE = 0.85
"""IoU from which colours and outline have found the same; then the colours' mask counts, which is finer."""
STRAYS = 0.03
"""Of the root of the shape's area, how far the colours' mask may lie beside it: a cloth is not quite flat,"""
LUMP = 0.01
"""and share of the area that lies farther from which on something else of its colour touches it."""
_INSTANCES = 4  # among which a hint chooses
log = logging.getLogger(__name__)


def segment_by_template(
    image: np.ndarray, camera: Camera, table: Table, template: ArrayLike, hint: np.ndarray | None,
    by_colours: Callable[[], np.ndarray],
) -> np.ndarray:  # fmt: skip
    """Return the mask (h, w) bool of a cloth of known outline.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: The camera.
        table: The table.
        template: (n, 2) float, the cloth's outline [m].
        hint: (2,) a pixel on the cloth, (4,) a box around it, or None.
        by_colours: Finds the cloth without its outline.

    Raises:
        ClothNotFoundError: neither colours nor outline find it.
        InvalidInputError: an outline that cannot be one.
    """
    found = find_shape(image, template, camera=camera, table=table, max_count=1 if hint is None else _INSTANCES)
    chosen = next((each for each in found if hint is None or _fits(each, hint)), None)
    try:
        mask = by_colours()
    except ClothNotFoundError as error:
        if chosen is None:
            raise ClothNotFoundError(f"{error}; nor is its outline found: no place has a score of {FOUND:g}") from error
        return chosen.mask
    if chosen is None:
        log.warning(
            "the cloth's outline is not found (no place has a score of %g): the mask is that of colours alone", FOUND
        )
        return mask
    same = float((mask & chosen.mask).sum()) >= AGREE * float((mask | chosen.mask).sum())
    return _without_lumps(mask, chosen.mask) if same else chosen.mask


def _without_lumps(mask: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return the colours' mask (h, w) bool without what sticks out of the shape: things of its colour."""
    import cv2

    area = float(shape.sum())
    reach = max(2, round(STRAYS * area**0.5))
    near = cv2.dilate(shape.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)).astype(bool)
    return mask & near if (mask & ~near).sum() > LUMP * area else mask


def _fits(found: FoundShape, hint: np.ndarray) -> bool:
    """A shape lies where a hint says."""
    if len(hint) == 2:
        u, v = np.clip(np.round(hint).astype(int), 0, np.array(found.mask.shape[::-1]) - 1)
        return bool(found.mask[v, u])
    u0, v0, u1, v1 = hint
    u, v = found.polygon.mean(axis=0)
    return bool(u0 <= u <= u1 and v0 <= v <= v1)
