"""The command ``nuno pick``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from nuno.errors import InvalidInputError
from nuno.estimate.lift_prior import HAND_STD, SIDEWAYS
from nuno.files.out_folder import check_out_folder
from nuno.kernels.command_device import device_of_command
from nuno.kernels.start_warp import begin_to_start_warp, importing_kernels

KERNELS = "nuno.plans.run_blocks_shared"
"""Of a batch of picks on CUDA, compiled for about a minute."""
CPU_KERNELS = "nuno.plans.run_lanes"
"""The same for the CPU, compiled for most of the wait for a first answer."""


def add_pick(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "pick", help="at which point was a cloth picked up? from two images"
    )
    parser.add_argument("case", metavar="CASE_DIR", help="folder with input.json and the two images that it names")
    parser.add_argument("--out", required=True, metavar="DIR", help="where result.json and result.png go")
    parser.add_argument(
        "--candidates", default="6x6", metavar="NxM", help="grid: N along the longer side (default 6x6)"
    )
    parser.add_argument(
        "--sideways", metavar="SHARE", default=str(SIDEWAYS),
        help=f"how far sideways hands go that lift a cloth, as a share of how high; none: any way (default {SIDEWAYS})",
    )  # fmt: skip
    parser.add_argument(
        "--shape", choices=("auto", "rectangle", "outline"), default="auto",
        help="auto (default) takes a rectangular cloth as a rectangle, any other by its outline; outline: any as it is",
    )  # fmt: skip
    parser.add_argument(
        "--spacing", type=float, metavar="M", help="of candidates on an outline [m] (default: about 40)"
    )
    parser.add_argument(
        "--hand-std", metavar="M", type=float, default=HAND_STD,
        help="[m] standard deviation of where the hand is, along each axis (default %(default)s)",
    )  # fmt: skip
    parser.add_argument("--engine", default="nuno", help="what moves the imagined cloths: nuno (default), mujoco ...")
    return parser


def run_pick(options: argparse.Namespace) -> str:
    """Estimate where a cloth was picked, write the result, and return what to tell."""
    with importing_kernels():
        import warp  # noqa: F401 (before a thread does)

        starting = begin_to_start_warp(CPU_KERNELS if options.engine == "nuno" else None)
        from nuno.estimate.case import read_case

    parts = options.candidates.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts):
        raise InvalidInputError(f"--candidates must be two numbers such as 6x6, got {options.candidates!r}")
    try:
        sideways = None if options.sideways.lower() == "none" else float(options.sideways)
    except ValueError:
        raise InvalidInputError(f"--sideways must be a number or none, got {options.sideways!r}") from None
    check_out_folder(options.out)
    case = read_case(options.case)
    starting.result()
    grid = (int(parts[0]), int(parts[1]))
    device = device_of_command(options.device, KERNELS) if options.engine == "nuno" else options.device
    result = case.estimate(
        candidates=grid, sideways=sideways, hand_std=options.hand_std, shape=options.shape, spacing=options.spacing,
        device=device, engine=options.engine, progress=options.progress,
    )  # fmt: skip
    result.save(options.out)
    a, b = result.best
    place = f"({100.0 * a:.1f}, {100.0 * b:.1f}) cm from C00" if result.by_position else f"({a}, {b})"
    return (
        f"picked at {place}, confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s; "
        f"see {Path(options.out) / 'result.json'} and result.png\n"
    )
