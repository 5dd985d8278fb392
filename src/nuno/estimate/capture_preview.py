"""A picture of a case that was captured, by which one sees whether camera, table and hand are right."""

from __future__ import annotations

import cv2
import numpy as np

from nuno.camera.calibration import Calibration
from nuno.camera.camera import Camera

_GRID = 0.1  # [m]
_REACH = 0.6  # [m] of the grid, where the table's extents are not known
_LINE, _HAND, _AXES = (255, 255, 255), (255, 60, 60), ((230, 50, 50), (50, 200, 60), (70, 110, 255))
_BAND = 26  # [px] for text


def preview(
    before: np.ndarray, after: np.ndarray, camera: Camera, table_height: float, half: list[float] | None, hand:
        np.ndarray,
    calibration: Calibration | None,
) -> np.ndarray:  # fmt: skip
    """Draw both images with a grid of 10 cm on the table, the world's axes and the hand.

    Args:
        before: (h, w, 3) uint8 RGB.
        after: (h, w, 3) uint8 RGB.
        camera: The camera.
        table_height: [m].
        half: Half of the table's sides [m], or None.
        hand: (3,) [m].
        calibration: Whose corners are drawn small; None draws none.

    Returns:
        (h + 26, 2 w, 3) uint8 RGB.
    """
    reach = (_REACH, _REACH) if half is None else (half[0], half[1])
    pictures = []
    for image, text in (
        (before, "before: grid of 10 cm on the table, x red, y green, z blue"),
        (after, "after: the hand"),
    ):
        drawn = image.copy()
        for axis in range(2):
            steps = np.arange(-np.floor(reach[axis] / _GRID), np.floor(reach[axis] / _GRID) + 1) * _GRID
            for at in steps:
                ends = np.full((33, 3), table_height)
                ends[:, axis], ends[:, 1 - axis] = at, np.linspace(-reach[1 - axis], reach[1 - axis], 33)
                _line(drawn, camera, ends, _LINE, 1)
        for axis, colour in enumerate(_AXES):
            _line(
                drawn,
                camera,
                np.array([0.0, 0.0, table_height]) + np.linspace(0, 0.15, 9)[:, None] * np.eye(3)[axis],
                colour,
                3,
            )
        if text.startswith("after"):
            foot = np.array([hand[0], hand[1], table_height])
            _line(drawn, camera, np.linspace(foot, hand, 17), _HAND, 1)
            cv2.drawMarker(drawn, _pixel(camera.project(hand)), _HAND, cv2.MARKER_TILTED_CROSS, 22, 3)
        elif calibration is not None:
            for corner in calibration.corners:
                cv2.circle(drawn, _pixel(corner), 1, (255, 210, 0), -1)
            text += f"; yellow: {calibration.views} views of the board, {calibration.error:.2f} px"
        band = np.zeros((_BAND, image.shape[1], 3), dtype=np.uint8)
        cv2.putText(band, text, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _LINE, 1, cv2.LINE_AA)
        pictures.append(np.vstack([band, drawn]))
    return np.hstack(pictures)


def _pixel(point: np.ndarray) -> tuple[int, int]:
    """Return a point (2,) as OpenCV draws it, no farther out than it can count."""
    x, y = np.round(np.clip(np.nan_to_num(point, nan=-1e4), -1e4, 1e5)).astype(int)
    return int(x), int(y)


def _line(image: np.ndarray, camera: Camera, points: np.ndarray, colour: tuple[int, int, int], width: int) -> None:
    """Draw the image of a line (n, 3) [m], as far as it is before the camera and near the image."""
    pixels = camera.project(points)
    size = np.array([camera.width, camera.height])
    good = np.isfinite(pixels).all(axis=1) & (np.abs(pixels - 0.5 * size) < size).all(axis=1)
    for k in np.flatnonzero(good[:-1] & good[1:]):
        cv2.line(image, _pixel(pixels[k]), _pixel(pixels[k + 1]), colour, width, cv2.LINE_AA)
