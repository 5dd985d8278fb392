"""A camera's lens from images of a board, and its pose from one of the board on the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.calibration_board import CalibrationBoard
from nuno.camera.camera import Camera
from nuno.camera.image import check_image
from nuno.camera.image_quality import check_quality
from nuno.errors import BoardNotFoundError, CalibrationError, ImageError, ImageQualityError, InvalidInputError
from nuno.validation import checked, number

FEWEST_VIEWS = 6
"""Good images of the board that a calibration needs; 10 to 20 are better."""
MAX_ERROR = 1.0
"""Root mean square distance of corners from where the camera sees them [px], in an image of 1000 px or less."""
MIN_COVERED = 0.3
"""Share of the image in which corners were seen, all views together."""
MAX_DOUBT = 0.01
"""Standard deviation of the focal length, as a share of it."""
_BOARD_CLIPPED = 0.15  # share of the board in its image that may be clipped: a third of it is white paper
_OUTLIER = 3.0  # a view whose error is so many times the median is left out
_CELLS = (8, 6)


@dataclass(frozen=True, eq=False)
class Calibration:
    """A lens, measured.

    Attributes:
        camera: With `distortion`, at the world's origin.
        error: Root mean square distance of corners from where the camera sees them [px].
        views: How many images were used.
        covered: Share of the image in which corners were seen.
        doubt: Standard deviation of the focal lengths, as a share of them.
        corners: (k, 2) float, all pixels that were used.
        warnings: Images that were left out, and why.
    """

    camera: Camera
    error: float
    views: int
    covered: float
    doubt: float
    corners: np.ndarray
    warnings: tuple[str, ...]


@checked
def calibrate_camera(
    images: Sequence[np.ndarray], board: CalibrationBoard, names: Sequence[str] | None = None
) -> Calibration:
    """Return a camera's focal lengths, principal point and distortion (k1, k2, p1, p2), by OpenCV.

    Images that are blurred, badly exposed or show too little of the board are left out, with a warning, as long as
    enough are left.

    Args:
        images: Each (h, w, 3) uint8 RGB, with the board at another place, tilted another way, some at the border.
        board: The board.
        names: Of the images, for messages.

    Raises:
        ImageError: images of different sizes, or none.
        BoardNotFoundError: no image shows the board.
        ImageQualityError: none that shows it is sharp and well exposed.
        CalibrationError: too few views, views that are too much alike, or corners that fit no camera.
    """
    called = [f"image {k}" for k in range(len(images))] if names is None else [str(name) for name in names]
    if len(called) != len(images):
        raise InvalidInputError(f"names must be one for each of {len(images)} images, got {len(called)}")
    if not len(images):
        raise CalibrationError(f"no images of the board are given, and {FEWEST_VIEWS} are needed: {_HOW}")
    seen: list[tuple[str, np.ndarray, np.ndarray]] = []
    problems: list[ImageError] = []
    size = np.shape(images[0])[1::-1]
    for name, image in zip(called, images, strict=True):
        if np.shape(image)[1::-1] != size:
            raise ImageError(
                f"{name} measures {np.shape(image)[1::-1]} px, the first image {size}: one camera, one size"
            )
        try:
            numbers, pixels = _good_corners(image, board, name)
            seen.append((name, numbers, pixels))
        except (BoardNotFoundError, ImageQualityError) as error:
            problems.append(error)
    if not seen:
        raise problems[0]
    warnings = [str(problem) for problem in problems]
    _check_count(len(seen), len(images), warnings)
    found, errors = _calibrate(seen, board, size)
    good = errors <= max(_OUTLIER * float(np.median(errors)), 0.3)
    if not good.all():
        warnings += [
            f"{seen[k][0]} fits the others badly ({errors[k]:.1f} px) and was left out" for k in np.flatnonzero(~good)
        ]
        seen = [view for view, keep in zip(seen, good, strict=True) if keep]
        _check_count(len(seen), len(images), warnings)
        found, errors = _calibrate(seen, board, size)
    limit = MAX_ERROR * max(1.0, size[0] / 1000.0)
    if found.error > limit:
        raise CalibrationError(
            f"the corners are {found.error:.2f} px from where a camera would see them, {limit:.2f} are the limit: is "
            "the board flat, and are its numbers of squares right? Fisheye lenses are not covered"
        )
    if found.covered < MIN_COVERED:
        raise CalibrationError(
            f"the board was seen in {found.covered:.0%} of the image, {MIN_COVERED:.0%} are needed: {_HOW}"
        )
    if found.doubt > MAX_DOUBT:
        raise CalibrationError(
            f"the focal length is known to {found.doubt:.1%} only, {MAX_DOUBT:.0%} is the limit: tilt the board by 20 "
            "to 45 degrees, in every direction, and hold it close"
        )
    return replace(found, warnings=tuple(warnings))


_HOW = "hold the board near each corner of the image and in its middle, close, and tilted in every direction"


@checked
def camera_above_table(
    image: ArrayLike, camera: Camera, board: CalibrationBoard, *, table_height: float = 0.0,
    board_thickness: float = 0.0, board_at: tuple[float, float] = (0.0, 0.0),
) -> tuple[Camera, float]:  # fmt: skip
    """Return the camera in a world whose z points up from the table, by an image of the board that lies on it.

    The world's x axis runs along the board's longer side, in the direction in which its text is read.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: Its lens; the pose does not count.
        board: The board.
        table_height: z of the table top [m].
        board_thickness: Of what the print is glued to [m].
        board_at: x and y of the board's middle [m].

    Returns:
        The camera, and the root mean square distance of the corners from where it sees them [px].

    Raises:
        ImageError: the image does not fit the camera.
        BoardNotFoundError: it does not show the board.
        ImageQualityError: it is blurred or badly exposed.
        CalibrationError: the corners do not fit the camera: its lens is another one's.
    """
    height = number("table_height", table_height) + number("board_thickness", board_thickness, low=0.0, high=0.1)
    rgb = check_image(image, camera, "the image of the board on the table")
    numbers, pixels = _good_corners(rgb, board, "the image of the board on the table")
    flat = board.corners[numbers]
    distortion = np.zeros(5) if camera.distortion is None else camera.distortion
    turn, shift = _pose(flat, pixels, camera.matrix, distortion)
    pose = np.eye(4)
    pose[:3, :3] = turn.T
    pose[:3, 3] = (board_at[0], board_at[1], height) - turn.T @ shift
    found = replace(camera, camera_to_world=pose)
    error = float(np.sqrt(((found.project(flat + np.array([*board_at, height])) - pixels) ** 2).sum(axis=1).mean()))
    limit = MAX_ERROR * max(1.0, camera.width / 1000.0)
    if not error <= limit:
        raise CalibrationError(
            f"the board on the table is {error:.2f} px from where this camera would see it, {limit:.2f} are the limit: "
            "is the lens that of the other images (focus, zoom, image size), and is the board flat?"
        )
    if pose[2, 3] <= height:
        raise CalibrationError("the camera would be under the table: the board must lie with its print up")
    return found, error


def _pose(
    flat: np.ndarray, pixels: np.ndarray, matrix: np.ndarray, distortion: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rotation and place in the camera of a plane's points (n, 3): the better one of the two there may be."""
    _, turns, shifts, _ = cv2.solvePnPGeneric(flat, pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    best, found = np.inf, None
    for first, second in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(flat, pixels, matrix, distortion, first, second)
        drawn = cv2.projectPoints(flat, turn, shift, matrix, distortion)[0].reshape(-1, 2)
        error = float(((drawn - pixels) ** 2).sum())
        if error < best:
            best, found = error, (cv2.Rodrigues(turn)[0], shift.ravel())
    if found is None:
        raise CalibrationError("the board's corners fit no pose: is the board flat, and its number of squares right?")
    return found


def _good_corners(image: np.ndarray, board: CalibrationBoard, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the board's corners in an image in which it is sharp and well exposed."""
    try:
        numbers, pixels = board.find(image, name)
    except BoardNotFoundError:
        check_quality(np.asarray(image), name, clipped=_BOARD_CLIPPED)  # perhaps this is why
        raise
    region = np.zeros(np.shape(image)[:2], dtype=np.uint8)
    cv2.fillConvexPoly(region, cv2.convexHull(pixels.astype(np.float32)).astype(np.int32), 1)
    if region.any():
        check_quality(np.asarray(image), f"the board in {name}", region.astype(bool), _BOARD_CLIPPED)
    return numbers, pixels


def _check_count(good: int, given: int, warnings: list[str]) -> None:
    if good < FEWEST_VIEWS:
        why = f" ({'; '.join(warnings)})" if warnings else ""
        raise CalibrationError(
            f"{good} of {given} images show the board well enough, and {FEWEST_VIEWS} are needed: {_HOW}{why}"
        )


def _calibrate(
    seen: list[tuple[str, np.ndarray, np.ndarray]], board: CalibrationBoard, size: tuple[int, int]
) -> tuple[Calibration, np.ndarray]:
    """Fit a camera, and return it with each view's error [px]."""
    corners = board.corners.astype(np.float32)
    points = [corners[numbers] for _, numbers, _ in seen]
    pixels = [found.astype(np.float32) for _, _, found in seen]
    try:
        error, matrix, distortion, _, _, doubts, _, errors = cv2.calibrateCameraExtended(
            points,
            pixels,
            size,
            None,
            None,
            flags=cv2.CALIB_FIX_K3,  # type: ignore[call-overload]
        )
    except cv2.error as problem:
        raise CalibrationError(f"the views fit no camera ({problem.err}): {_HOW}") from problem
    if not np.isfinite(matrix).all() or min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise CalibrationError(f"the views fit no camera: {_HOW}")
    camera = Camera(
        int(size[0]), int(size[1]), float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2]),
        distortion=distortion.ravel()[:4],
    )  # fmt: skip
    every = np.concatenate(pixels)
    cells = np.floor(every / size * _CELLS).clip(0, np.array(_CELLS) - 1).astype(int)
    covered = len(np.unique(cells, axis=0)) / float(np.prod(_CELLS))
    doubt = float(max(doubts[0, 0] / camera.fx, doubts[1, 0] / camera.fy))
    return Calibration(camera, float(error), len(seen), covered, doubt, every, ()), np.asarray(errors).ravel()
