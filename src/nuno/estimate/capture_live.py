"""Taking a case's images one after another with a camera, as a person at the table is told to."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np

from nuno.camera.calibration_board import CalibrationBoard
from nuno.camera.image_quality import check_quality
from nuno.errors import ImageError, InvalidInputError
from nuno.estimate.capture_case import Capture, capture_case
from nuno.files.whole_file import made_folder, write_whole
from nuno.validation import checked, count

VIEWS = 12
"""Images of the board that are taken."""
_TRIES = 5  # for each image


@runtime_checkable
class ImageSource(Protocol):
    """A camera that gives images: `nuno.UsbCamera`, or any with such a method."""

    def take(self) -> np.ndarray:
        """Return an image, (h, w, 3) uint8 RGB."""
        ...


@checked
def take_capture(
    folder: str | os.PathLike[str], source: ImageSource, ask: Callable[[str], Any], *, board: CalibrationBoard | None =
        None,
    views: int = VIEWS, **options: Any,
) -> Capture:  # fmt: skip
    """Take the images of a case with a camera, and make the case of them by `nuno.capture_case`.

    All images are kept in the folder's raw/, so that the case can be made again from files.

    Args:
        folder: Of the case.
        source: The camera.
        ask: Called with what the person at the table is to do next; an image is taken when it returns. Images that are
            blurred, badly exposed or without the board are told of in the next call, and taken again.
        board: The board; None is the one that ``nuno capture --board`` prints.
        views: How many images of the board are taken, unless the lens is given as ``camera``.
        options: Of `nuno.capture_case`, except images.

    Raises:
        InvalidInputError: no camera, or too few views.
        ImageError: five images after one another cannot be used.
        CalibrationError: as ``capture_case``, as all its errors.
    """
    wanted = count("views", views, low=6, high=200)
    own = CalibrationBoard() if board is None else board
    if isinstance(source, np.ndarray) or not callable(getattr(source, "take", None)):
        raise InvalidInputError(f"source must have a method take, as UsbCamera, got {type(source).__name__}")
    raw = made_folder(made_folder(folder) / "raw")

    def take(name: str, what: str, *, with_board: bool) -> np.ndarray:
        trouble = ""
        for _ in range(_TRIES):
            ask(trouble + what)
            image = source.take()
            try:
                if with_board:
                    own.find(image, "the image")
                check_quality(image, "the image", clipped=0.5 if with_board else 0.15)
            except ImageError as error:
                problem, trouble = error, f"{error}. Again: "
                continue
            write_whole(raw / f"{name}.png", cv2.imencode(".png", image[..., ::-1])[1].tobytes())
            return image
        raise problem

    boards = []
    if options.get("camera") is None:
        for k in range(wanted):
            how = (
                "near a corner of the image" if k % 3 == 0 else "tilted by 20 to 45 degrees" if k % 3 == 1 else "close"
            )
            boards.append(take(f"board_{k:02d}", f"view {k + 1} of {wanted}: hold the board {how}", with_board=True))
    table = take(
        "board_on_table", "lay the board flat on the table, print up; from now on the camera stays", with_board=True
    )
    before = take("before", "take the board away and lay the cloth flat on the table", with_board=False)
    after = take("after", "lift the cloth, hold it still, and keep your arm from before it", with_board=False)
    return capture_case(
        folder, before=before, after=after, board_on_table=table, board_images=boards, board=own, **options
    )
