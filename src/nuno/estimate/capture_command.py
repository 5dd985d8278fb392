"""The command ``nuno capture``."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import suppress
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from nuno.errors import FileFormatError, InvalidInputError
from nuno.files.out_folder import check_out_folder

if TYPE_CHECKING:
    from nuno.camera.camera import Camera


def add_capture(commands: Any) -> None:
    """Add the command to those of argparse."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "capture", help="make a case of one's own camera for pick, by a printed board and two images",
        description="Make a case folder for nuno pick of one's own camera: print the board (--board), then give a USB "
        "camera (--usb) or image files. docs/capture.md goes through it.",
    )  # fmt: skip
    parser.add_argument("--board", metavar="FILE", help="write the board to print, .pdf or .png, and end")
    parser.add_argument("--paper", choices=("A4", "letter", "A3"), default="A4", help="to print on (default A4)")
    parser.add_argument("--out", metavar="CASE_DIR", help="where the case goes")
    parser.add_argument("--usb", type=int, metavar="N", help="take the images with USB camera N, one after another")
    parser.add_argument("--views", type=int, default=12, help="images of the board that --usb takes (default 12)")
    parser.add_argument("--board-images", nargs="+", default=(), metavar="FILE", help="of the board held in many ways")
    parser.add_argument("--camera", metavar="FILE", help="instead: the camera.json of an earlier case of this lens")
    parser.add_argument("--board-on-table", metavar="FILE", help="image of the board that lies on the table")
    parser.add_argument("--before", metavar="FILE", help="image of the cloth flat on the table")
    parser.add_argument("--after", metavar="FILE", help="image of the cloth in the hand")
    parser.add_argument(
        "--hand", nargs=3, type=float, metavar=("X", "Y", "Z"), help="the held point [m], z from the floor"
    )
    parser.add_argument("--marker", type=int, metavar="ID", help="instead: an ArUco marker (4X4_50) on the hand")
    parser.add_argument("--marker-size", type=float, metavar="M", help="side of its black square [m]")
    parser.add_argument(
        "--hand-offset", nargs=3, type=float, default=(0.0, 0.0, 0.0), metavar=("RIGHT", "UP", "OUT"),
        help="of the held point from the marker's middle [m]",
    )  # fmt: skip
    parser.add_argument("--table-height", type=float, default=0.72, metavar="M", help="of the top above the floor")
    parser.add_argument(
        "--table-size", nargs=2, type=float, metavar=("X", "Y"), help="of the top, along the board first [m]"
    )
    parser.add_argument(
        "--board-at", nargs=2, type=float, default=(0.0, 0.0), metavar=("X", "Y"),
        help="the board's middle from the table's middle [m]",
    )  # fmt: skip
    parser.add_argument("--board-thickness", type=float, default=0.0, metavar="M", help="of what it is glued to [m]")
    parser.add_argument("--squares", nargs=2, type=int, default=(7, 5), metavar=("N", "M"), help="of the board (7 5)")
    parser.add_argument("--square", type=float, default=0.035, metavar="M", help="side of a square as printed (0.035)")


def run_capture(options: argparse.Namespace) -> str:
    """Print the board or make a case, and return what to tell.

    Args:
        options: As `add_capture` reads them.

    Raises:
        InvalidInputError: options that are missing or do not go together.
        NunoError: as `nuno.capture_case`.
    """
    from nuno.camera.calibration_board import CalibrationBoard
    from nuno.estimate.capture_case import capture_case

    if options.out is not None:
        check_out_folder(options.out)
    board = CalibrationBoard(options.squares[0], options.squares[1], options.square)
    if options.board is not None:
        with suppress(OSError):  # a folder that cannot be made is told by what writes into it
            FilePath(options.board).parent.mkdir(parents=True, exist_ok=True)
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
    from nuno.camera.camera import Camera

    try:
        data = json.loads(FilePath(path).read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise InvalidInputError(f"--camera: there is no file {path}") from error
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"{path} is not JSON: {error}") from error
    return Camera.from_dict(data)
