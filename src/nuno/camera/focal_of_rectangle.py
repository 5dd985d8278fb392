"""The focal length that makes the outline of a flat rectangular cloth a rectangle.

With a wrong focal length, what is a rectangle on the table is none any more once its outline is taken back to the
table: the near and the far side no longer have one length. So a sixth number is fitted to the edge beside the
rectangle's five. A camera whose tilt is wrong distorts a rectangle much alike, and so does a cloth that is not quite
rectangular, while a table of another height leaves it a rectangle, of another size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.rectangle_edges import EdgePoints, measured_edges
from nuno.errors import EstimationError

APART = 8.0
"""Points of an edge, 2 px apart, that err alike: the noise of segmented masks is smooth over some 16 px."""
MINIMUM_NOISE = 0.1
"""[px] Edges are known no better than this."""
STEP = 1e-4
"""Of the logarithm of the focal length, for differences."""
RANGE = 0.3
"""The logarithm of the ratio is not followed farther than this: then it is no focal length that is wrong."""


FOCAL = "the cloth's outline is a rectangle only with a focal length "
"""How a warning begins that tells of another focal length."""
CLEARLY = 4.0
"""Standard deviations from which on it is; at three, two of 52 rough masks with the right focal length told another."""
OTHER_CAUSES = 0.012
"""Standard deviation of the logarithm by what else there is: a cloth's own shape, a camera's tilt."""


@dataclass(frozen=True)
class FocalRatio:
    """A focal length beside the one that was told.

    Attributes:
        log: Logarithm of the ratio.
        std: Its standard deviation by the noise of the edge.
    """

    log: float
    std: float

    @property
    def warning(self) -> str | None:
        """Words of warning, where it is another for all that is known."""
        if abs(self.log) < CLEARLY * float(np.hypot(self.std, OTHER_CAUSES)):
            return None
        share = 100.0 * abs(float(np.expm1(self.log)))
        return (
            f"{FOCAL}{share:.0f} % {'longer' if self.log > 0.0 else 'shorter'} than is told, which is taken: are the "
            "camera's focal length and tilt right, and are the cloth's corners square?"
        )


def focal_of_rectangle(rectangle: ClothRectangle, mask: np.ndarray, camera: Camera, height: float) -> FocalRatio | None:
    """Return the ratio of the focal length with which a cloth's outline is most like a rectangle to the one told.

    The mask's edge is asked, not the image's: that is looked for within 2 px of the rectangle's sides, which a wrong
    focal length puts farther off.

    Args:
        rectangle: As it was fitted with the focal length that is told.
        mask: (h, w) bool, the cloth.
        camera: The camera.
        height: z of the cloth's middle surface [m].

    Returns:
        The ratio; None where the edge does not tell.
    """
    corners = rectangle.corners[:, :2]
    if _turn(corners) < 0.0:
        corners = corners[[0, 3, 2, 1]]
    soft_mask = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    try:
        edges = measured_edges(corners, soft_mask, None, camera, height)
    except EstimationError:
        return None
    return _fitted(edges, corners, camera, height)


def _turn(corners: np.ndarray) -> float:
    """Above 0 where corners (4, 2) go around anticlockwise."""
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    return float(along[0] * across[1] - along[1] * across[0])


def _fitted(edges: EdgePoints, corners: np.ndarray, camera: Camera, height: float) -> FocalRatio | None:
    """Gauss-Newton with Cauchy weights over the rectangle's five numbers and the logarithm of the ratio.

    Each side is a line n . x = c in the plane, of which opposite ones have one direction and neighbours are square to
    each other: so yaw and four offsets are the rectangle's numbers.
    """
    middle = corners.mean(axis=0)
    along = corners[1] - corners[0]
    yaw, log = float(np.arctan2(along[1], along[0])), 0.0
    offsets = np.zeros(4)
    each = np.eye(4)[edges.sides]
    for _ in range(15):
        at, after = (_ground(edges.pixels, camera, height, log + step) - middle for step in (0.0, STEP))
        outward = _ground(edges.pixels + edges.normals, camera, height, log) - middle
        angles = yaw + 0.5 * np.pi * (edges.sides - 1)
        normal = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        turned = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        per_metre = 1.0 / np.maximum(np.abs(((outward - at) * normal).sum(axis=1)), 1e-6)
        away = (at * normal).sum(axis=1)
        if not offsets.any():
            offsets = np.array([np.median(away[edges.sides == side]) for side in range(4)])
        error = per_metre * (away - offsets[edges.sides])
        jacobian = per_metre[:, None] * np.column_stack(
            [(at * turned).sum(axis=1), -each, ((after - at) * normal).sum(axis=1) / STEP]
        )
        noise = max(1.4826 * float(np.median(np.abs(error))), MINIMUM_NOISE)
        robust = 1.0 / (1.0 + (error / (2.0 * noise)) ** 2)
        information = jacobian.T @ (jacobian * robust[:, None])
        try:
            step = np.linalg.solve(information, -jacobian.T @ (robust * error))
        except np.linalg.LinAlgError:
            return None
        yaw, offsets, log = yaw + float(step[0]), offsets + step[1:5], log + float(step[5])
        if not np.isfinite(step).all() or abs(log) > RANGE:
            return None
        if np.abs(step).max() < 1e-6:
            break
    covariance = np.linalg.inv(information) * noise**2 * APART
    return FocalRatio(log, float(np.sqrt(covariance[5, 5])))


def _ground(pixels: np.ndarray, camera: Camera, height: float, log: float) -> np.ndarray:
    """(n, 2) float, pixels (n, 2) on the plane [m], as a camera sees it whose focal length has that ratio."""
    return camera_with(camera, log).back_project(pixels, height)[:, :2]


def camera_with(camera: Camera, log: float) -> Camera:
    """Return a camera with another focal length, by the logarithm of their ratio."""
    return replace(camera, fx=camera.fx * float(np.exp(log)), fy=camera.fy * float(np.exp(log)))
