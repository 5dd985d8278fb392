"""The command ``nuno fold``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from nuno.files.out_folder import check_out_folder
from nuno.kernels.start_warp import begin_to_start_warp, importing_kernels


def add_fold(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "fold", help="how does a cloth lie that hands have folded? from a video and their paths"
    )
    parser.add_argument("case", metavar="CASE_DIR", help="folder with input.json and the images that its frames name")
    parser.add_argument("--out", required=True, metavar="DIR", help="where result.json, masks, pictures and replay go")
    return parser


def run_fold(options: argparse.Namespace) -> str:
    """Replay a fold, write the result, and return what to tell."""
    with importing_kernels():
        import warp  # noqa: F401 (before a thread does)

        starting = begin_to_start_warp()
        from nuno.estimate.fold_case import read_fold_case

    check_out_folder(options.out)
    case = read_fold_case(options.case)
    starting.result()
    result = case.replay(device=options.device, progress=options.progress)
    result.save(options.out, names=case.names)
    agreement = list(result.agreement.values())
    agreed = f"agreement {sum(agreement) / len(agreement):.3f}, " if agreement else ""
    return (
        f"replayed {len(result.times)} frames as {result.material_name}, {agreed}in {result.seconds['total']:.1f} s; "
        f"see {Path(options.out) / 'result.json'}, strip.png, layers.png, hands.png and replay.glb\n"
    )
