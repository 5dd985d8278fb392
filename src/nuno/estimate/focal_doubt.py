"""A focal length that is told wrongly: the one with which the cloth before is a rectangle is taken instead."""

from __future__ import annotations

from dataclasses import replace

from nuno.camera.cloth_outline import ClothOutline
from nuno.camera.focal_of_rectangle import camera_with, focal_of_rectangle
from nuno.camera.rectangle import ClothRectangle, fit_rectangle, main_part
from nuno.errors import EstimationError
from nuno.estimate.pick_images import PickImages, border_warning
from nuno.estimate.pick_settings import PickSettings


def with_focal_of_rectangle(
    settings: PickSettings, images: PickImages, rectangle: ClothRectangle
) -> tuple[PickSettings, ClothRectangle]:
    """Return settings and rectangle with the focal length that the cloth's outline tells, and a warning of it.

    They stay as they are where the outline does not tell that another is clearly right, where it lies on the table's
    border, so that it is not the cloth's, and where the cloth is taken by its outline.

    Args:
        settings: As they are told.
        images: With the mask before.
        rectangle: As it was measured with the focal length that is told.
    """
    mask = images.mask_before
    if mask is None or isinstance(rectangle, ClothOutline):
        return settings, rectangle
    camera, height = settings.camera, settings.table.height + settings.rest_height
    mask = main_part(mask, [])
    ratio = focal_of_rectangle(rectangle, mask, camera, height)
    if ratio is None or ratio.warning is None or border_warning(mask, camera, settings.table) is not None:
        return settings, rectangle
    camera = camera_with(camera, ratio.log)
    try:
        other = fit_rectangle(mask, images.before, camera, height)
    except EstimationError:
        return settings, rectangle
    return replace(settings, camera=camera), replace(other, warnings=(ratio.warning, *other.warnings))
