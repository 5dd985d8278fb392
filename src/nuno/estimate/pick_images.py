"""The images of an estimate of a pick: read, checked, and the cloth found in the one before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.flat import first_look
from nuno.camera.image import check_image, check_mask, read_image
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.camera.regions import grow
from nuno.camera.segmentation import segment_before
from nuno.camera.table import Table
from nuno.errors import ClothNotFoundError, EstimationError, InvalidInputError
from nuno.estimate.outline_or_rectangle import fit_cloth
from nuno.estimate.pick_settings import PickSettings

RIM = 0.006
"""Distance from the table's border [m] within which a cloth's outline lies on it."""
RIM_SHARE = 0.05
"""Share of a cloth's outline on the table's border from which the cloth is taken to hang over it."""
ALIKE = 0.3
"""Share of one region's pixels of another's from which both may be the cloth."""


@dataclass(frozen=True, eq=False)
class PickImages:
    """Images (h, w, 3) uint8 and masks (h, w) bool before and after a pick; None is what was not given.

    Attributes:
        before: The cloth on the table.
        after: The cloth in the hand.
        mask_before: The cloth before.
        mask_after: The cloth after.
        hidden: What the image after shows before the cloth.
    """

    before: np.ndarray | None
    after: np.ndarray | None
    mask_before: np.ndarray | None
    mask_after: np.ndarray | None
    hidden: np.ndarray | None


def read_images(
    before: Any, after: Any, mask_before: ArrayLike | None, mask_after: ArrayLike | None, hidden: ArrayLike | None,
    camera: Camera,
) -> PickImages:  # fmt: skip
    """Read and check images, given as arrays or paths, and masks.

    Raises:
        ImageError: an image that cannot be read, or one that is not of the camera's size.
        InvalidInputError: two images that are the same.
    """

    def mask(name: str, value: ArrayLike | None) -> np.ndarray | None:
        return None if value is None else check_mask(value, camera, name)

    images = PickImages(
        _image(before, camera, "before"), _image(after, camera, "after"), mask("before_mask", mask_before),
        mask("after_mask", mask_after), mask("hidden", hidden),
    )  # fmt: skip
    if images.before is not None and images.after is not None and np.array_equal(images.before, images.after):
        raise InvalidInputError("the image after is the image before: nothing was picked up between them")
    return images


def find_cloth_before(
    images: PickImages,
    rectangle: ClothRectangle | None,
    hint: ArrayLike | None,
    settings: PickSettings,
    shape: str = "auto",
    template: ArrayLike | None = None,
) -> tuple[PickImages, ClothRectangle]:
    """Find the cloth's mask and rectangle, or outline, in the image before, as far as they are needed and not given.

    Raises:
        InvalidInputError: too little is given to find the cloth before or after.
        ClothNotFoundError: no cloth in the image.
    """
    images, doubt = _with_mask_before(images, rectangle, hint, settings, template)
    if rectangle is None:
        rectangle = _fitted(images, settings, shape)
        if doubt is not None:
            rectangle = replace(rectangle, warnings=(*rectangle.warnings, doubt))
    if images.mask_after is None and any(image is None for image in (images.before, images.after, images.mask_before)):
        raise InvalidInputError("both images are needed to find the cloth after, or after_mask")
    return images, rectangle


def _with_mask_before(
    images: PickImages, rectangle: ClothRectangle | None, hint: ArrayLike | None, settings: PickSettings,
    template: ArrayLike | None,
) -> tuple[PickImages, str | None]:  # fmt: skip
    """Segment the image before unless its mask is given or nothing needs it; and warn of another possible cloth."""
    if images.mask_before is not None or (rectangle is not None and images.mask_after is not None):
        return images, None
    if images.before is None:
        raise InvalidInputError("the image before is needed, or before_mask, or rectangle and after_mask")
    found = segment_before(images.before, settings.camera, settings.table, hint=hint, template=template)
    is_named = hint is not None or template is not None or rectangle is not None
    doubt = None if is_named else other_cloth(images.before, found, settings.camera, settings.table)
    return replace(images, mask_before=found), doubt


def _fitted(images: PickImages, settings: PickSettings, shape: str) -> ClothRectangle:
    """Fit a rectangle or an outline to the mask before, with warnings of what the mask may not show."""
    assert images.mask_before is not None
    over = border_warning(images.mask_before, settings.camera, settings.table)
    height = settings.table.height + settings.rest_height
    try:
        fitted = fit_cloth(images.mask_before, images.before, settings.camera, height, shape)
    except EstimationError as error:
        raise EstimationError(f"{error}; {over or why_no_rectangle(images.mask_before)}") from None
    if over is not None:
        return replace(fitted, warnings=(*fitted.warnings, over))
    if shape == "auto" and isinstance(fitted, ClothOutline):
        taken, *others = fitted.warnings
        taken = f"{taken}; if it is one, {why_no_rectangle(images.mask_before)}"
        return replace(fitted, warnings=(taken, *others))
    return fitted


def border_warning(mask: np.ndarray, camera: Camera, table: Table) -> str | None:
    """Return a warning where the outline of a mask (h, w) runs along the table's border: the cloth goes on there."""
    if table.half_extents is None or not mask.any():
        return None
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = np.concatenate(outlines)[:, 0].astype(float)
    offset = np.abs(camera.back_project(outline, table.height)[:, :2] - np.asarray(table.centre or (0.0, 0.0)))
    beyond = (offset - np.asarray(table.half_extents)).max(axis=1)
    share = float((beyond > -RIM).mean())
    if share < RIM_SHARE:
        return None
    return (
        f"{100.0 * share:.0f} % of the cloth's outline lies on the table's border: what hangs over it is not seen, so "
        "the cloth may be larger and its points elsewhere; rectangle= takes its true corners"
    )


def why_no_rectangle(mask: np.ndarray) -> str:
    """Return what may be the matter with a cloth whose mask (h, w) is no rectangle, and what helps."""
    rim = np.concatenate([mask[:2].ravel(), mask[-2:].ravel(), mask[:, :2].ravel(), mask[:, -2:].ravel()])
    if rim.any():
        return "it goes on beyond the image's border: rectangle= takes its true corners"
    return "it may be folded, or lie behind a thing on the table: rectangle= takes the corners of the cloth laid flat"


def other_cloth(before: np.ndarray, mask: np.ndarray, camera: Camera, table: Table) -> str | None:
    """Return a warning where another thing on the table might be the cloth, of a similar size and a rectangle, too.

    Args:
        before: (h, w, 3) uint8, the image before.
        mask: (h, w) bool, the cloth that was found.
        camera: The camera.
        table: The table.
    """
    if table.half_extents is None:
        return None
    hidden, ring = grow(mask, 6), grow(mask, 14) & ~grow(mask, 8)
    if not ring.any():
        return None
    bare = before.copy()
    bare[hidden] = np.random.default_rng(0).choice(before[ring], int(hidden.sum()))  # the table as it is beside it
    try:
        found, _ = first_look(bare, camera, table, None)
    except ClothNotFoundError:
        return None
    whole = cv2.resize(found.astype(np.uint8), (camera.width, camera.height), interpolation=cv2.INTER_NEAREST) > 0
    if (whole & hidden).any() or not ALIKE < whole.sum() / mask.sum() < 1.0 / ALIKE:
        return None
    try:
        second = fit_rectangle(whole, None, camera, table.height)
    except EstimationError:
        return None
    x, y = second.centre[:2]
    return (
        f"another thing on the table, {second.long_m:.2f} x {second.short_m:.2f} m at ({x:.2f}, {y:.2f}) m, may be the "
        "cloth that is meant: hint= takes a point of it or a box around it"
    )


def _image(image: Any, camera: Camera, name: str) -> np.ndarray | None:
    if image is None:
        return None
    if isinstance(image, str | FilePath):
        image = read_image(image)
    return check_image(image, camera, f"the image {name}")
