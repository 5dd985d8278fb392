"""The work of ``nuno capture``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path as FilePath
from typing import Any

from nuno.camera.calibration_board import CalibrationBoard
from nuno.camera.camera import Camera
from nuno.errors import FileFormatError, InvalidInputError
from nuno.estimate.capture_case import capture_case


def run_capture(options: argparse.Namespace) -> str:
    """Print the board or make a case, and return what to tell.

    Args:
        options: As ``nuno.estimate.capture_options`` reads them.

    Raises:
        InvalidInputError: options that are missing or do not go together.
        NunoError: as `nuno.capture_case`.
    """
    board = CalibrationBoard(options.squares[0], options.squares[1], options.square)
    if options.board is not None:
        board.save(options.board, options.paper)
        return (
            f"see {options.board}: print it at 100 %, glue it onto something flat, and measure a square, which should "
            f"be {1e3 * board.square:g} mm; if it is not, give what it is as --square\n"
        )
    if options.out is None:
        raise InvalidInputError("--out is needed, the folder of the case; or --board, to print the board")
    given: dict[str, Any] = {
        "board": board, "camera": None if options.camera is None else _camera(options.camera), "hand": options.hand,
        "marker": options.marker, "marker_size": options.marker_size, "hand_offset": tuple(options.hand_offset),
        "table_height": options.table_height, "board_thickness": options.board_thickness,
        "table_size": None if options.table_size is None else tuple(options.table_size), "board_at":
        tuple(options.board_at),
    }  # fmt: skip
    if (options.hand is None) == (options.marker is None):
        raise InvalidInputError("the hand's place is needed: --hand X Y Z, or --marker ID with --marker-size")
    if options.usb is not None:
        from nuno.camera.usb_camera import UsbCamera
        from nuno.estimate.capture_live import take_capture

        with UsbCamera(options.usb) as source:
            made = take_capture(options.out, source, _ask, views=options.views, **given)
    else:
        needed = {"--board-on-table": options.board_on_table, "--before": options.before, "--after": options.after}
        missing = [name for name, value in needed.items() if value is None]
        if missing:
            raise InvalidInputError(f"{', '.join(missing)} are needed, or --usb N to take the images with a camera")
        made = capture_case(
            options.out, before=options.before, after=options.after, board_on_table=options.board_on_table,
            board_images=list(options.board_images), **given,
        )  # fmt: skip
    for warning in made.warnings:
        sys.stderr.write(f"nuno: {warning}\n")
    lens = made.calibration
    report = (
        "" if lens is None else f"lens {lens.error:.2f} px over {lens.views} views ({lens.covered:.0%} of the image), "
    )
    return (
        f"{report}board on the table {made.board_error:.2f} px; look at {made.folder / 'preview.png'}: the grid must "
        f"lie on the table and the cross on the hand. Then: nuno pick {made.folder} --out out\n"
    )


def _ask(what: str) -> None:
    sys.stderr.write(f"nuno: {what}; then press Enter ")
    sys.stderr.flush()
    if not sys.stdin.readline():
        raise InvalidInputError("--usb needs somebody at a terminal, who presses Enter for each image")


def _camera(path: str) -> Camera:
    try:
        data = json.loads(FilePath(path).read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InvalidInputError(f"--camera: there is no file {path}") from error
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path} is not JSON: {error}") from error
    return Camera.from_dict(data)
