"""A flat cloth as a rectangle, or where it is none as the outline that it has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.cloth_outline import fit_outline
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.errors import EstimationError

SHAPES = ("auto", "rectangle", "outline")


def fit_cloth(
    mask: np.ndarray, image: np.ndarray | None, camera: Camera, plane_height: float, shape: str
) -> ClothRectangle:
    """Measure a cloth that lies flat on a horizontal plane.

    Args:
        mask: (h, w) bool, the cloth.
        image: (h, w, 3) uint8 RGB, or None.
        camera: The camera that took it.
        plane_height: z of the cloth's middle surface [m].
        shape: "rectangle" takes it as one, "outline" takes any shape as it is, "auto" a rectangle as one and what is
            none as it is, with a warning.

    Raises:
        ImageError: mask or image does not fit the camera.
        ClothNotFoundError: the mask is empty.
        EstimationError: no rectangle where one is asked for; the region has no outline on the plane.
    """
    if shape == "outline":
        return fit_outline(mask, camera, plane_height)
    try:
        return fit_rectangle(mask, image, camera, plane_height)
    except EstimationError as error:
        if shape == "rectangle":
            raise
        try:
            outline = fit_outline(mask, camera, plane_height)
        except EstimationError as other:
            raise EstimationError(f"{error}; nor can it be taken as it is: {other}") from error
        warning = f"the cloth is taken by its outline, for it is no rectangle ({str(error).split(';')[0]})"
        return replace(outline, warnings=(warning, *outline.warnings))
