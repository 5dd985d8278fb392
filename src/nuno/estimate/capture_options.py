"""The options of ``nuno capture``."""

from __future__ import annotations

import argparse
from typing import Any


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
