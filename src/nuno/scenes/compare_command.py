"""The command ``nuno compare``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from nuno.files.out_folder import check_out_folder
from nuno.kernels.start_warp import start_warp


def add_compare(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "compare", help="run a saved world on several engines: a film of them side by side, and how far they come apart"
    )
    parser.add_argument("scene", metavar="SCENE", help="the file that World.save wrote (.npz)")
    parser.add_argument(
        "--engines", nargs="+", metavar="ENGINE", default=["nuno", "mujoco", "newton"],
        help="two or more; the first is what the others are compared with (default: nuno mujoco newton)",
    )  # fmt: skip
    parser.add_argument("--seconds", type=float, default=2.0, help="how long it runs (default 2)")
    parser.add_argument("--out", required=True, metavar="DIR", help="where film.html and differences.json go")
    parser.add_argument("--device", default="cpu", help="cpu (default), cuda, cuda:1 ...; mujoco has the CPU only")
    return parser


def run_compare(options: argparse.Namespace) -> str:
    """Run a saved world on several engines, write film and differences, and return what to tell."""
    from nuno.viewer.compare_engines import compare_engines

    check_out_folder(options.out)
    start_warp()
    found = compare_engines(
        options.scene, options.engines, options.seconds, device=options.device, progress=options.progress
    )
    found.save(options.out)
    return f"{found.table()}\nsee {Path(options.out) / 'film.html'} and differences.json\n"
