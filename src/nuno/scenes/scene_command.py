"""The command ``nuno scene``."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from typing import Any

from nuno.files.out_folder import check_out_folder
from nuno.kernels.start_warp import start_warp
from nuno.validation import number


def add_scene(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "scene", help="what is in a scene file (MJCF, URDF, USD), and what of it a world of Nuno cannot have?"
    )
    parser.add_argument("file", metavar="FILE", help="ends with .xml, .urdf, .usd, .usda or .usdc")
    parser.add_argument("--keyframe", metavar="NAME", help="the key frame of an MJCF file to begin in")
    parser.add_argument("--free-base", action="store_true", help="let the root link of a URDF file move")
    parser.add_argument(
        "--packages", nargs="+", default=(), metavar="DIR", help="folders for package:// in a URDF file"
    )
    parser.add_argument("--seconds", type=float, default=0.0, metavar="S", help="let it run so long (default 0)")
    parser.add_argument("--out", metavar="DIR", help="where scene.png goes, and with --seconds film.html")
    parser.add_argument("--save", metavar="FILE", help="write it, as it is then, as MJCF (.xml) or USD (.usda, .usdc)")
    return parser


def run_scene(options: argparse.Namespace) -> str:
    """Load a scene file, show and save it as asked for, and return its report."""
    from nuno.scenes.load_scene import load_scene
    from nuno.scenes.save_scene import save_scene
    from nuno.scenes.show_scene import film_scene, picture_of
    from nuno.world.world import World

    number("--seconds", options.seconds, low=0.0)
    if options.out is not None:
        check_out_folder(options.out)
    start_warp()
    logging.getLogger("nuno.scenes").setLevel(logging.ERROR)  # the report says all
    scene = load_scene(
        options.file, World(device=options.device), keyframe=options.keyframe, fixed_base=not options.free_base,
        package_dirs=options.packages,
    )  # fmt: skip
    report = f"{scene.report}\n"
    if options.out is not None:
        folder = Path(options.out)
        folder.mkdir(parents=True, exist_ok=True)
        picture_of(scene.world).save(folder / "scene.png")
        if options.seconds:
            film_scene(scene.world, options.seconds).save(folder / "film.html")
    elif options.seconds:
        scene.world.run(options.seconds)
    if options.save is not None:
        report += f"{save_scene(scene.world, options.save)}\n"
    return report
