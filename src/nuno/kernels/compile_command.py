"""The command ``nuno compile``."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from nuno.errors import InvalidInputError
from nuno.kernels.start_warp import start_warp


def add_compile(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "compile", help="compile kernels ahead of use into Warp's cache: in a container image, on a cluster",
        description="Compile kernels ahead of use into Warp's cache (WARP_CACHE_PATH); what is there stays. "
        "CUDA needs no device for it.",
    )  # fmt: skip
    parser.add_argument("--device", choices=("cpu", "cuda"), help="default: cuda where --arch is given, else cpu")
    parser.add_argument(
        "--arch", metavar="sm_NN", help="CUDA's architecture, such as sm_90 (default: of the devices here)"
    )
    parser.add_argument("--only", nargs="+", metavar="MODULE", help="these modules of kernels (default: all)")
    parser.add_argument("--jobs", type=int, metavar="N", help="compile so many at once (default: one for each core)")
    return parser


def run_compile(options: argparse.Namespace) -> str:
    """Compile kernels into Warp's cache, and return how many there were."""
    from nuno.kernels.kernel_cache import compile_kernels

    if options.jobs is not None and options.jobs < 1:
        raise InvalidInputError(f"--jobs must be at least 1, got {options.jobs}")
    start_warp()
    device = options.device or ("cpu" if options.arch is None else "cuda")
    count = 0

    def report(name: str, seconds: float) -> None:
        nonlocal count
        count += 1
        sys.stderr.write(f"nuno: {name}: {seconds:.1f} s\n")

    where = compile_kernels(device, options.arch, only=options.only, jobs=options.jobs, report=report)
    return f"{count} modules of kernels for {options.arch or device} in {where}\n"
