"""The command ``nuno describe-robot``."""

from __future__ import annotations

import argparse
from typing import Any


def add_describe_robot(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "describe-robot", help="guess from a URDF the table of hands, feet, cameras and groups of a robot, to be edited"
    )
    parser.add_argument("urdf", metavar="URDF", help="the robot's file")
    parser.add_argument("--srdf", metavar="FILE", help="pairs of links that may overlap, postures, groups")
    parser.add_argument("--packages", nargs="+", metavar="DIR", help="folders that package:// is looked up in")
    parser.add_argument("--name", help="what the robot is to be called (default: the file's name)")
    parser.add_argument("--out", metavar="FILE", help="where the table goes (default: to the terminal)")
    return parser


def run_describe_robot(options: argparse.Namespace) -> str:
    """Guess a robot's table, write it, and return it or what to tell."""
    from nuno.robot.describe_robot import describe_robot

    text = describe_robot(
        options.urdf, options.out, srdf=options.srdf, package_dirs=options.packages, name=options.name
    )  # fmt: skip
    return text if options.out is None else f"see {options.out}, and correct what says CHECK\n"
