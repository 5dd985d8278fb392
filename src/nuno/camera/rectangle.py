"""The rectangle that a flat cloth makes on its plane: corners, sides and grid points."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, check_mask
from nuno.camera.rectangle_edges import measured_edges
from nuno.errors import ClothNotFoundError, EstimationError, InvalidInputError

SQUARE = "the sides, "
"""How a warning begins that tells of a square cloth: it names the corners, and makes no number less sure."""
UNEVEN = "the cloth's sides are not straight"
"""The same of one whose outline is rough or wavy."""
MAX_SIDE = 20.0
"""[m] A cloth with a longer side than this is measured in other units than metres."""
_SQUARE = 0.02  # sides this close to each other do not say which one is the longer
_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])  # anticlockwise from above
_OUTWARD = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])  # normal of the side after each corner


@dataclass(frozen=True, eq=False)
class ClothRectangle:
    """A rectangular cloth flat on a horizontal plane.

    Attributes:
        corners: (4, 3) float, in the world [m], in the order C00, CI, opposite, CJ. C00 is the corner whose
            projection is nearest to pixel (0, 0), CI its neighbour along the longer side, CJ along the
            shorter. Sides within 2 % of each other: CI is the neighbour that comes next clockwise in the
            image.
        long_m: Length of the side from C00 to CI [m].
        short_m: Length of the side from C00 to CJ [m].
        centre: (3,) float [m].
        yaw: Angle of CI - C00 about z, from the x axis [rad].
        residual: Root mean square distance of the measured edge from the rectangle's sides [px].
        warnings: What a reader of the numbers should know.
    """

    corners: np.ndarray
    long_m: float
    short_m: float
    centre: np.ndarray
    yaw: float
    residual: float
    warnings: tuple[str, ...] = ()

    def grid_points(self, n: int, m: int) -> np.ndarray:
        """Points of a grid that spans the cloth: n along the longer side, m along the shorter.

        Returns:
            (n, m, 3) float [m], P(i, j) = C00 + i/(n-1) (CI - C00) + j/(m-1) (CJ - C00).

        Raises:
            InvalidInputError: n or m is below 2.
        """
        if n < 2 or m < 2:
            raise InvalidInputError(f"a grid needs at least 2 x 2 points, got {n} x {m}")
        along, across = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        i = np.linspace(0.0, 1.0, n)[:, None, None]
        j = np.linspace(0.0, 1.0, m)[None, :, None]
        return self.corners[0] + i * along + j * across

    def fractions(self, points: ArrayLike) -> np.ndarray:
        """Return points (..., 3) [m] as fractions (..., 2) of the sides, (0, 0) at C00 and (1, 1) opposite."""
        sides = np.stack([self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]])
        offset = np.asarray(points, dtype=float) - self.corners[0]
        return offset @ sides.T / (sides**2).sum(axis=1)


@dataclass
class _Pose:
    """A rectangle on the plane: centre [m], yaw [rad], size along its own x and y [m]."""

    centre: np.ndarray
    yaw: float
    size: np.ndarray

    def axes(self) -> np.ndarray:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, s], [-s, c]])

    def corners(self) -> np.ndarray:
        return self.centre + (_CORNERS * self.size) @ self.axes()


def fit_rectangle(mask: ArrayLike, image: ArrayLike | None, camera: Camera, plane_height: float) -> ClothRectangle:
    """Fit a rectangle to a cloth that lies flat on a horizontal plane.

    A first rectangle spans the mask's outline, taken back to the plane. Then the edge is measured along the
    normals of its sides, first in the mask, then in the image, to a fraction of a pixel, and the rectangle's
    five numbers are fitted to all edge points at once. Distances count in pixels, so the far side, where a
    pixel is more metres, counts for less in metres; far outliers are weighed down.

    Args:
        mask: (h, w) bool, the cloth.
        image: (h, w, 3) uint8 RGB; None where only the mask is known, whose edge then counts.
        camera: The camera that took it.
        plane_height: z of the cloth's middle surface [m]: the table's height and half of the cloth's
            thickness.

    Raises:
        ImageError: mask or image does not fit the camera.
        ClothNotFoundError: the mask is empty.
        EstimationError: the region is no rectangle on the plane, or one of its sides is outside of the image.
        InvalidInputError: it is larger than any cloth, as where camera and table are told in millimetres.
    """
    mask = check_mask(mask, camera)
    rgb = None if image is None else check_image(image, camera)
    if not mask.any():
        raise ClothNotFoundError("the mask is empty, so there is no cloth to measure")
    warnings: list[str] = []
    mask = main_part(mask, warnings)
    pose = _spanning(mask, camera, plane_height)
    soft_mask = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    for _ in range(3):
        pose, residual = _fit_to_edges(pose, soft_mask, None, camera, plane_height)
    cut = _cut_off(mask, pose, camera, plane_height)
    if cut:
        warnings.append(cut)
    _judge_shape(mask, pose, camera, plane_height, warnings)
    if rgb is not None:
        soft_image = cv2.GaussianBlur(rgb.astype(np.float32), (0, 0), 0.6)
        for _ in range(2):
            pose, residual = _fit_to_edges(pose, soft_mask, soft_image, camera, plane_height)
    if residual > 1.5:
        warnings.append(f"{UNEVEN}: {residual:.1f} px off the rectangle on average")
    return _labelled(pose, camera, plane_height, residual, warnings)


def main_part(mask: np.ndarray, warnings: list[str]) -> np.ndarray:
    """Return the largest part of a mask (h, w) that is not empty; a warning is added where others are not tiny."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    areas = stats[1:, cv2.CC_STAT_AREA]
    if areas.max() < 0.95 * areas.sum():
        warnings.append(f"of the mask's {count - 1} parts the largest, {areas.max() / areas.sum():.0%}, was used")
    return labels == 1 + int(areas.argmax())


def _spanning(mask: np.ndarray, camera: Camera, height: float) -> _Pose:
    """The smallest rectangle on the plane around the mask."""
    # smoothed first: the spikes of a rough mask would hold the rectangle off its sides
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 3.0) >= 0.5
    mask = smooth if smooth.any() else mask
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=len)[:, 0].astype(float)
    if len(outline) < 12:
        raise EstimationError(f"the mask's region has an outline of {len(outline)} pixels, too small for a rectangle")
    ground = camera.back_project(outline, height)[:, :2]
    middle = ground.mean(axis=0)
    centre, size, angle = cv2.minAreaRect((ground - middle).astype(np.float32))
    return _Pose(middle + centre, float(np.deg2rad(angle)), np.array(size, dtype=float))


def _fit_to_edges(
    pose: _Pose, mask: np.ndarray, image: np.ndarray | None, camera: Camera, height: float
) -> tuple[_Pose, float]:
    """Measure the edge along the sides, in a soft mask (h, w) or also in the image, and fit to it."""
    edges = measured_edges(pose.corners(), mask, image, camera, height)
    points = camera.back_project(edges.pixels, height)[:, :2]
    further = camera.back_project(edges.pixels + edges.normals, height)[:, :2]
    metres = np.abs(((further - points) * (_OUTWARD[edges.sides] @ pose.axes())).sum(axis=1))
    return _least_squares(pose, points, edges.sides, 1.0 / np.maximum(metres, 1e-6))


def _least_squares(pose: _Pose, points: np.ndarray, sides: np.ndarray, weights: np.ndarray) -> tuple[_Pose, float]:
    """Gauss-Newton with Cauchy weights over points (k, 2) [m] of sides (k,), weights (k,) [px/m]."""
    centre, yaw, size = pose.centre.copy(), pose.yaw, pose.size.copy()
    for _ in range(12):
        now = _Pose(centre, yaw, size)
        axes = now.axes()
        normal = _OUTWARD[sides] @ axes
        turned = _OUTWARD[sides] @ np.array([axes[1], -axes[0]])
        offset = points - centre
        half = 0.5 * np.abs(_OUTWARD[sides])
        distance = (normal * offset).sum(axis=1) - half @ size
        jacobian = np.column_stack([-normal, (turned * offset).sum(axis=1), -half])
        error = weights * distance
        scale = max(2.0 * float(np.median(np.abs(error))), 0.3)
        robust = weights**2 / (1.0 + (error / scale) ** 2)
        normal_matrix = jacobian.T @ (jacobian * robust[:, None]) + 1e-12 * np.eye(5)
        step = np.linalg.solve(normal_matrix, -jacobian.T @ (robust * distance))
        centre, yaw, size = centre + step[:2], yaw + float(step[2]), size + step[3:]
        if np.abs(step).max() < 1e-7:
            break
    if not (np.isfinite(size).all() and (size > 1e-3).all()):
        raise EstimationError("the region is not a rectangle on the plane: its sides have no sensible length")
    good = np.abs(error) < max(3 * scale, 1.0)
    return _Pose(centre, yaw, size), float(np.sqrt((error[good] ** 2).mean()))


def _cut_off(mask: np.ndarray, pose: _Pose, camera: Camera, height: float) -> str | None:
    rim = np.concatenate(
        [mask[:2].any(axis=0), mask[-2:].any(axis=0), mask[:, :2].any(axis=1), mask[:, -2:].any(axis=1)]
    )
    pixels = camera.project(np.column_stack([pose.corners(), np.full(4, height)]))
    size = np.array([camera.width, camera.height])
    outside = int((~((pixels > -0.5) & (pixels < size - 0.5)).all(axis=1)).sum())
    if outside:
        return f"the image's border cuts the cloth off: {outside} corners are where sides would meet outside"
    return "the cloth touches the image's border: it may go on outside" if rim.sum() > 3 else None


def _judge_shape(mask: np.ndarray, pose: _Pose, camera: Camera, height: float, warnings: list[str]) -> None:
    """Compare the mask with the rectangle's own image."""
    outline = camera.project(np.column_stack([pose.corners(), np.full(4, height)]))
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    cv2.fillConvexPoly(drawn, np.round(outline * 16).astype(np.int32), 1, lineType=cv2.LINE_8, shift=4)
    inside = drawn.astype(bool)
    overlap = float((mask & inside).sum() / max((mask | inside).sum(), 1))
    if overlap < 0.83:  # a disc and its best square share 0.80
        raise EstimationError(
            f"the region is not a rectangle on the plane z = {height:.4f} m: it shares "
            f"{overlap:.0%} with the best one; is the cloth folded, the mask wrong, or the height?"
        )
    if overlap < 0.95:
        warnings.append(f"the cloth is not quite a rectangle: it shares {overlap:.0%} with the best one")


def rectangle_around(points: np.ndarray, camera: Camera, height: float, warnings: list[str]) -> ClothRectangle:
    """Return the smallest rectangle around points (n, 2) [m] of a horizontal plane, its corners by the label rule.

    Args:
        points: x and y in the world [m].
        camera: The camera whose image the corners are named by.
        height: z of the plane [m].
        warnings: What there is to tell already.

    Raises:
        EstimationError: a corner behind the camera.
        InvalidInputError: as `fit_rectangle`.
    """
    middle = points.mean(axis=0)
    centre, size, angle = cv2.minAreaRect((points - middle).astype(np.float32))
    pose = _Pose(middle + centre, float(np.deg2rad(angle)), np.array(size, dtype=float))
    return _labelled(pose, camera, height, 0.0, warnings)


def _labelled(pose: _Pose, camera: Camera, height: float, residual: float, warnings: list[str]) -> ClothRectangle:
    """Name the corners by the label rule."""
    corners = np.column_stack([pose.corners(), np.full(4, height)])
    pixels = camera.project(corners)
    if not np.isfinite(pixels).all():
        raise EstimationError("a corner of the rectangle lies behind the camera")
    first = int(np.linalg.norm(pixels, axis=1).argmin())
    order = [first, (first + 1) % 4, (first + 2) % 4, (first + 3) % 4]
    ahead, behind = (float(np.linalg.norm(corners[order[k]] - corners[first])) for k in (1, 3))
    if abs(ahead - behind) <= _SQUARE * max(ahead, behind):
        # y points down in an image, so a positive turn from one neighbour to the other is clockwise to the
        # eye.
        a, b = pixels[order[1]] - pixels[first], pixels[order[2]] - pixels[first]
        swap = a[0] * b[1] - a[1] * b[0] < 0
        warnings.append(
            f"{SQUARE}{ahead:.3f} and {behind:.3f} m, are within 2 %: i runs to the next corner clockwise in the image"
        )
    else:
        swap = behind > ahead
    if swap:
        order = [order[0], order[3], order[2], order[1]]
    if max(ahead, behind) > MAX_SIDE:
        raise InvalidInputError(
            f"the cloth would be {max(ahead, behind):.0f} x {min(ahead, behind):.0f} m: are the camera's place and the "
            "table in metres?"
        )
    corners = corners[order]
    along, across = corners[1] - corners[0], corners[3] - corners[0]
    return ClothRectangle(
        corners=corners,
        long_m=float(np.linalg.norm(along)),
        short_m=float(np.linalg.norm(across)),
        centre=corners.mean(axis=0),
        yaw=float(np.arctan2(along[1], along[0])),
        residual=residual,
        warnings=tuple(warnings),
    )
