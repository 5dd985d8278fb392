"""The outline that a flat cloth of any shape makes on its plane, and the smallest rectangle around it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.image import check_mask
from nuno.camera.rectangle import ClothRectangle, main_part, rectangle_around
from nuno.errors import ClothNotFoundError, EstimationError
from nuno.mesh.polygon import crosses_itself, perimeter, signed_area

FINER = 4
"""The mask's edge is followed on a grid so many times finer than its pixels."""
SOFT = 1.0
"""[px] Standard deviation of the blur that takes a mask's steps away."""
OFF = 0.7
"""[px] The outline is simplified as long as it is not farther than this from the mask's edge."""
SMALLEST = 24
"""[px] of an outline; a shorter one tells no shape."""
RIM = 5.0
"""[px] within which of the mask's edge colours are not taken: there cloth and table mix."""


@dataclass(frozen=True, eq=False)
class ClothOutline(ClothRectangle):
    """A cloth of any shape, flat on a horizontal plane; what its base class has is the smallest rectangle around it.

    Attributes:
        outline: (n, 3) float, the corners of its outline in the world [m], anticlockwise seen from above.
    """

    outline: np.ndarray = None  # type: ignore[assignment]

    @property
    def polygon(self) -> np.ndarray:
        """(n, 2) float, the outline as positions on the cloth [m]: along the longer and shorter side from C00."""
        return self.fractions(self.outline) * (self.long_m, self.short_m)

    @property
    def area(self) -> float:
        """[m2]."""
        return abs(signed_area(self.outline[:, :2]))

    @property
    def perimeter(self) -> float:
        """[m]."""
        return perimeter(self.outline[:, :2])

    def world_positions(self, uv: ArrayLike) -> np.ndarray:
        """Return points (k, 3) of the world [m] from fractions (k, 2) of the sides."""
        uv = np.asarray(uv, dtype=float)
        along, across = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        return np.asarray(self.corners[0] + uv[:, :1] * along + uv[:, 1:] * across)


def fit_outline(mask: ArrayLike, camera: Camera, plane_height: float) -> ClothOutline:
    """Take the outline of a cloth that lies flat on a horizontal plane.

    The mask's edge is followed to a fraction of a pixel, taken back to the plane, and simplified.

    Args:
        mask: (h, w) bool, the cloth.
        camera: The camera that took it.
        plane_height: z of the cloth's middle surface [m].

    Raises:
        ImageError: the mask does not fit the camera.
        ClothNotFoundError: the mask is empty.
        EstimationError: the region is too small, or is not seen on the plane.
    """
    mask = check_mask(mask, camera)
    if not mask.any():
        raise ClothNotFoundError("the mask is empty, so there is no cloth to measure")
    warnings: list[str] = []
    mask = main_part(mask, warnings)
    if np.concatenate([mask[:2].ravel(), mask[-2:].ravel(), mask[:, :2].ravel(), mask[:, -2:].ravel()]).sum() > 6:
        raise EstimationError(
            "the cloth touches the image's border, so its outline is not known, and it is not a rectangle, whose sides "
            "could be prolonged"
        )
    edge = _edge(mask)
    if len(edge) < SMALLEST:
        raise EstimationError(f"the mask's region has an outline of {len(edge)} points, too small to tell a shape")
    pixels = cv2.approxPolyDP(edge.astype(np.float32)[:, None], OFF, True)[:, 0].astype(float)
    ground = camera.back_project(pixels, plane_height)
    if len(pixels) < 3 or not np.isfinite(ground).all() or crosses_itself(ground[:, :2]):
        raise EstimationError("the region's outline is not one on the plane; is the mask wrong, or the height?")
    if signed_area(ground[:, :2]) < 0.0:
        ground = ground[::-1]
    around = rectangle_around(ground[:, :2], camera, plane_height, warnings)
    return ClothOutline(
        around.corners, around.long_m, around.short_m, around.centre, around.yaw, around.residual, around.warnings,
        outline=np.ascontiguousarray(ground),
    )  # fmt: skip


def _edge(mask: np.ndarray) -> np.ndarray:
    """Return the pixels (n, 2) along the edge of a mask (h, w), where the blurred mask is a half."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = max(int(rows[0]) - 8, 0), max(int(columns[0]) - 8, 0)
    part = mask[top : rows[-1] + 9, left : columns[-1] + 9].astype(np.float32)
    soft = cv2.GaussianBlur(part, (0, 0), SOFT)
    upsampled = cv2.resize(soft, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR) >= 0.5
    contours, _ = cv2.findContours(upsampled.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.zeros((0, 2))
    edge = max(contours, key=len)[:, 0].astype(float)
    # the contour runs through the outermost fine pixels' middles: half a fine pixel further out is the edge
    return (edge + 0.5 * _normals(edge) + 0.5) / FINER - 0.5 + (left, top)


def _normals(edge: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 2) that point out of a closed outline (n, 2) of pixels."""
    along = np.roll(edge, -3, axis=0) - np.roll(edge, 3, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return normal if signed_area(edge) > 0.0 else -normal


def cloth_colours(image: np.ndarray, mask: np.ndarray | None, cloth: ClothRectangle) -> np.ndarray:
    """Return an image (h, w, 3) whose pixels outside of a cloth have the colour of the nearest one on it.

    So a map of the cloth's colours over its smallest rectangle has none of the table in it. That of a rectangle, or
    without a mask (h, w), is the image itself.
    """
    if not isinstance(cloth, ClothOutline) or mask is None:
        return image
    depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)
    inside = np.asarray(depth > min(RIM, 0.5 * float(depth.max())))
    _, nearest = cv2.distanceTransformWithLabels(
        (~inside).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    colours = np.zeros((int(nearest.max()) + 1, 3), dtype=image.dtype)
    colours[nearest[inside]] = image[inside]
    return colours[nearest]
