"""The view of one camera at one instant, on the pixels that a follower looks at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, check_mask
from nuno.errors import ImageError, InvalidInputError
from nuno.tracking.pixel_grid import PixelGrid
from nuno.validation import as_array

FARTHEST = 50.0
"""[m] A cloth that is farther away than this by the median of its depths is most likely given in millimetres."""
NEARER = 0.02
"""Share of an image's known depths that are nearer than `FARTHEST` where it shows a cloth at all, by metres."""


@dataclass(frozen=True, eq=False)
class Observation:
    """One camera's view of the cloth.

    Attributes:
        grid: The pixels.
        cloth: (h, w) bool, where the cloth is seen.
        depth: (h, w) float [m] along the optical axis, NaN where it is not known; None without depth.
        hidden: (h, w) bool, where nothing can be told: what is there may hide the cloth.
    """

    grid: PixelGrid
    cloth: np.ndarray
    depth: np.ndarray | None
    hidden: np.ndarray

    @property
    def is_empty(self) -> bool:
        """Return True if no pixel shows the cloth."""
        return not self.cloth.any()


def is_picture(seen: Any) -> bool:
    """Return True if what was seen has three axes: a colour image, and no mask."""
    return as_array("seen", seen, ImageError).ndim == 3


def observe_picture(grid: PixelGrid, image: Any, depth: Any, hidden: Any) -> Observation:
    """Return what a camera shows in a colour image (height, width, 3) uint8, in which the cloth is not found yet.

    Raises:
        ImageError: as `observe`.
    """
    check_image(image, grid.full, "image")
    found = observe(grid, np.zeros(image.shape[:2], dtype=bool), depth, hidden)
    if found.depth is not None and np.isfinite(found.depth).any():
        nearest = float(np.nanquantile(found.depth, NEARER))
        if nearest > FARTHEST:
            raise ImageError(f"depth is {nearest:.0f} m where it is nearest; it is to be metres, not millimetres")
    return found


def observe(grid: PixelGrid, mask: Any, depth: Any, hidden: Any) -> Observation:
    """Return what a camera shows.

    Args:
        grid: The pixels to look at.
        mask: (height, width), where the cloth is seen.
        depth: (height, width) [m] along the optical axis, or None; NaN, infinite and 0 are not known.
        hidden: (height, width) bool, where nothing can be told, or None.

    Raises:
        ImageError: one does not fit the camera, or depths that are no metres.
    """
    reduced = (grid.camera.height, grid.camera.width)
    cloth = grid.take(check_mask(mask, grid.full, "mask"))
    covered = np.zeros(reduced, dtype=bool)
    if hidden is not None:
        covered = grid.take(check_mask(hidden, grid.full, "hidden"))
    metres = None
    if depth is not None:
        metres = grid.take(check_depth(depth, grid.full)).astype(float)
        metres[~np.isfinite(metres) | (metres <= 0.0)] = np.nan
        known = metres[cloth & np.isfinite(metres)]
        if len(known) and np.median(known) > FARTHEST:
            raise ImageError(f"depth is {np.median(known):.0f} m at the cloth; it is to be metres, not millimetres")
    return Observation(grid, cloth & ~covered, metres, covered)


def check_depth(depth: Any, camera: Camera) -> np.ndarray:
    """Return depths (height, width) as they are, of the camera's size and nowhere negative.

    Raises:
        ImageError: they are not.
    """
    given = as_array("depth", depth.numpy() if hasattr(depth, "numpy") else depth, ImageError)
    if given.shape != (camera.height, camera.width) or given.dtype.kind not in "iuf":
        raise ImageError(
            f"depth must be numbers [m] of shape {(camera.height, camera.width)} to fit its camera, got "
            f"{given.dtype} of shape {given.shape}"
        )
    behind = (given < 0) & np.isfinite(given)
    if behind.any():
        raise ImageError(
            f"depth is negative in {int(behind.sum())} pixels, {float(given[behind].min()):.3g} m at least: it goes "
            "from the camera along its axis, and what is not known is 0, NaN or infinite"
        )
    return given


def checked_cameras(camera: Any) -> tuple[Camera, ...]:
    """Return one camera or several as a tuple.

    Raises:
        InvalidInputError: no cameras.
    """
    cameras = (camera,) if isinstance(camera, Camera) else camera
    if not isinstance(cameras, Sequence) or not cameras or not all(isinstance(each, Camera) for each in cameras):
        raise InvalidInputError(f"camera must be a Camera or a sequence of them, got {camera!r:.100}")
    return tuple(cameras)
