"""A case of one's own camera: calibrated, checked, and written as `nuno.read_case` reads it."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.calibration import Calibration, calibrate_camera, camera_above_table
from nuno.camera.calibration_board import CalibrationBoard
from nuno.camera.camera import Camera
from nuno.camera.image import check_any_size, check_image, read_image
from nuno.camera.image_quality import check_quality
from nuno.camera.marker_pose import find_marker
from nuno.errors import InvalidInputError
from nuno.estimate.capture_preview import preview
from nuno.estimate.case_file import THICKNESS
from nuno.files.whole_file import file_path, made_folder, write_whole
from nuno.validation import checked, finite_array, number

TABLE_HEIGHT = 0.72
"""[m] Of a table that is not measured: an ordinary one; it only says where the floor is."""
_MOVED = 1.5
"""[px] (of 1000) A camera that moved more between two images is told of."""

_PAPER = 0.04  # [m] about the board that is its paper
_FEWEST = 10  # corners in the room that tell whether it moved

Images = Sequence[str | os.PathLike[str] | np.ndarray]


@dataclass(frozen=True, eq=False)
class Capture:
    """A case that was made.

    Attributes:
        folder: Where input.json and the images are; `nuno.read_case` reads it.
        camera: The camera, in the table's world.
        hand: (3,) [m].
        table_height: [m].
        board_error: Root mean square distance of the board's corners on the table from where the camera sees them [px].
        calibration: Of the lens; None where it was given.
        warnings: What a user should know.
        preview: (h, w, 3) uint8 RGB, as preview.png: look at it.
    """

    folder: FilePath
    camera: Camera
    hand: np.ndarray
    table_height: float
    board_error: float
    calibration: Calibration | None
    warnings: tuple[str, ...]
    preview: np.ndarray = field(repr=False)


@checked
def capture_case(
    folder: str | os.PathLike[str], *, before: str | os.PathLike[str] | np.ndarray,
    after: str | os.PathLike[str] | np.ndarray, board_on_table: str | os.PathLike[str] | np.ndarray,
    board_images: Images = (), camera: Camera | None = None, board: CalibrationBoard | None = None,
    hand: ArrayLike | None = None, marker: int | None = None, marker_size: float | None = None,
    hand_offset: ArrayLike = (0.0, 0.0, 0.0), table_height: float = TABLE_HEIGHT, board_thickness: float = 0.0,
    table_size: tuple[float, float] | None = None, board_at: tuple[float, float] = (0.0, 0.0),
) -> Capture:  # fmt: skip
    """Make a case's folder from images of one camera: the lens, the table, the hand, and the two images of a pick.

    The camera must not move, nor focus anew, from the image of the board on the table to the last one.

    Args:
        folder: Where input.json, before.png, after.png, camera.json and preview.png go.
        before: RGB image (h, w, 3) uint8, or its path, of the cloth flat on the table.
        after: The same, of the cloth in the hand.
        board_on_table: The same, of the board that lies on the table with its print up.
        board_images: Images or paths, of the board held in many ways; none where ``camera`` is given.
        camera: The lens, where it is known (``Camera.from_dict`` of an earlier camera.json); its pose does not count.
        board: The board; None is the one that ``nuno capture --board`` prints.
        hand: (3,) the point of the cloth in the hand [m]: from the table's middle along x and y, z above the floor.
        marker: Instead: the number of an ArUco marker (dictionary 4X4_50) on the hand, in the image after.
        marker_size: Side of its black square [m].
        hand_offset: (3,) of the held point from the marker's middle [m]: to its right, up its page, and out of it.
        table_height: z of the table top [m].
        board_thickness: Of what the print is glued to [m].
        table_size: Sides of the table [m] along the board's longer side and across it; None is not known.
        board_at: x and y of the board's middle from the table's middle [m].

    Raises:
        InvalidInputError: no or two ways to the hand, to the lens; a value out of range; a hand out of the image or
            under the table.
        ImageError: an image that cannot be read, or of another size; BoardNotFoundError and ImageQualityError are such.
        CalibrationError: no camera follows from the images of the board.
        FileWriteError: the folder cannot be written.
    """
    own = CalibrationBoard() if board is None else board
    is_stack = isinstance(board_images, np.ndarray) and board_images.ndim == 4
    if not is_stack and (isinstance(board_images, str | bytes) or not isinstance(board_images, Sequence)):
        raise InvalidInputError(f"board_images must be a sequence of images, got {type(board_images).__name__}")
    if (camera is None) == (len(board_images) == 0):
        raise InvalidInputError("the lens comes from board_images, or from camera: give one of the two")
    if (hand is None) == (marker is None) or (marker is None) != (marker_size is None):
        raise InvalidInputError("the hand's place comes from hand, or from marker and marker_size: give one of the two")
    height = number("table_height", table_height)
    half = None
    if table_size is not None:
        sides = finite_array("table_size", table_size, (2,))
        if (sides <= 0).any():
            raise InvalidInputError(f"table_size must be two positive lengths [m], got {sides.tolist()}")
        half = (0.5 * sides).tolist()
    given = None if hand is None else finite_array("hand", hand, (3,))
    offset = finite_array("hand_offset", hand_offset, (3,))
    shown = {name: _read(image, name) for name, image in (("before", before), ("after", after))}
    on_table = _read(board_on_table, "of the board on the table")
    calibration, lens = None, camera
    if lens is None:
        names = [os.fspath(image) if not isinstance(image, np.ndarray) else f"board image {k}"
                 for k, image in enumerate(board_images)]  # fmt: skip
        calibration = calibrate_camera([_read(image, "of the board") for image in board_images], own, names)
        lens = calibration.camera
    seen, board_error = camera_above_table(
        on_table, lens, own, table_height=height, board_thickness=board_thickness, board_at=board_at
    )
    away = _without_board(seen, own, board_at, height)
    warnings = list(calibration.warnings) if calibration is not None else []
    for name, image in shown.items():
        check_quality(check_image(image, seen, f"the image {name}"), f"the image {name}")
        moved = _moved(on_table, image, away)
        if moved > _MOVED * max(1.0, seen.width / 1000.0):
            warnings.append(
                f"the camera seems to have moved by {moved:.1f} px before the image {name}: fix it, and take the image "
                "of the board on the table anew"
            )
    if given is None:
        assert marker is not None and marker_size is not None
        given, _, marker_error = find_marker(shown["after"], seen, marker, marker_size, offset=offset)
        if marker_error > 1.0:
            warnings.append(
                f"the marker's corners are {marker_error:.1f} px from those of a square: is it bent or half hidden?"
            )
    place = np.asarray(given, dtype=float)
    _check_hand(place, seen, height)
    goal = made_folder(folder)
    picture = preview(shown["before"], shown["after"], seen, height, half, place, calibration)
    for name, image in (*shown.items(), ("preview", picture)):
        write_whole(goal / f"{name}.png", cv2.imencode(".png", image[..., ::-1])[1].tobytes())
    lens_entry = _entry(lens)
    write_whole(goal / "camera.json", json.dumps(lens_entry, indent=1))
    entry = {
        "camera": _entry(seen), "image_before": "before.png", "image_after": "after.png", "table_height_m": height,
        "table_half_extents_xy_m": half, "table_centre_xy_m": None if half is None else [0.0, 0.0],
        "table_thickness_m": THICKNESS, "hand_position_m": place.tolist(),
        "board_error_px": board_error, "calibration_error_px": None if calibration is None else calibration.error,
        "warnings": warnings,
    }  # fmt: skip
    write_whole(goal / "input.json", json.dumps(entry, indent=1))
    return Capture(goal, seen, place, height, board_error, calibration, tuple(warnings), picture)


def _read(image: str | os.PathLike[str] | np.ndarray, name: str) -> np.ndarray:
    if not isinstance(image, np.ndarray):
        return read_image(file_path(image, name))
    return check_any_size(image, f"the image {name}", grey=False)


def _check_hand(hand: np.ndarray, camera: Camera, height: float) -> None:
    """Raise an error where `nuno.estimate_pick` would refuse the hand."""
    pixel = camera.project(hand)
    if not (
        np.isfinite(pixel).all() and (pixel > -0.5).all() and (pixel < (camera.width - 0.5, camera.height - 0.5)).all()
    ):
        raise InvalidInputError(
            f"the hand at {np.round(hand, 3).tolist()} m would not be in the image after: x and y are measured from "
            "the table's middle, as board_at is, and z from the floor"
        )
    if hand[2] <= height:
        raise InvalidInputError(f"the hand at {np.round(hand, 3).tolist()} m is not above the table, z = {height:g} m")


def _without_board(camera: Camera, board: CalibrationBoard, at: tuple[float, float], height: float) -> np.ndarray:
    """(h, w) uint8, 0 where the board lies, with its paper's rim."""
    half = 0.5 * np.array(board.size) + _PAPER
    rim = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half + at
    pixels = camera.project(np.column_stack([rim, np.full(4, height)]))
    free = np.ones((camera.height, camera.width), dtype=np.uint8)
    if np.isfinite(pixels).all():
        cv2.fillConvexPoly(free, np.round(np.clip(pixels, -1e4, 1e4)).astype(np.int32), 0)
    return free


def _moved(first: np.ndarray, second: np.ndarray, where: np.ndarray) -> float:
    """By how much the camera seems to have moved between two images [px]: what most corners of the first have done."""
    greys = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (first, second)]
    corners = cv2.goodFeaturesToTrack(greys[0], 400, 0.01, 8, mask=where)
    if corners is None or len(corners) < _FEWEST:
        return 0.0
    there, good, _ = cv2.calcOpticalFlowPyrLK(greys[0], greys[1], corners, None)  # type: ignore[call-overload]
    back, again, _ = cv2.calcOpticalFlowPyrLK(greys[1], greys[0], there, None)  # type: ignore[call-overload]
    sure = (good.ravel() == 1) & (again.ravel() == 1) & (np.linalg.norm((back - corners).reshape(-1, 2), axis=1) < 0.5)
    if sure.sum() < _FEWEST:
        return 0.0
    way = np.linalg.norm((there - corners).reshape(-1, 2)[sure], axis=1)
    return float(np.quantile(way, 0.25))  # the cloth has moved, what is around it has not


def _entry(camera: Camera) -> dict[str, object]:
    names = ("width", "height", "fx", "fy", "cx", "cy")
    distortion = None if camera.distortion is None else camera.distortion.tolist()
    pose = {"camera_to_world": camera.camera_to_world.tolist(), "distortion": distortion}
    return {**{name: getattr(camera, name) for name in names}, **pose}
