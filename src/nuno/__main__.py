"""The command line: ``nuno pick CASE_DIR --out DIR``, and what else ``nuno --help`` lists."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence

from nuno import __version__
from nuno.errors import EstimationError, NunoError, SimulationDiverged
from nuno.estimate.capture_command import add_capture, run_capture
from nuno.estimate.fold_command import add_fold, run_fold
from nuno.estimate.pick_command import add_pick, run_pick
from nuno.kernels.compile_command import add_compile, run_compile
from nuno.robot.describe_command import add_describe_robot, run_describe_robot
from nuno.robot.serve_command import add_serve, run_serve
from nuno.scenes.compare_command import add_compare, run_compare
from nuno.scenes.scene_command import add_scene, run_scene

ANSWERED, FAILED, BAD_INPUT = 0, 1, 2
COMMANDS = {
    "pick": run_pick, "fold": run_fold, "capture": run_capture, "serve": run_serve, "scene": run_scene,
    "compare": run_compare, "compile": run_compile, "describe-robot": run_describe_robot,
}  # fmt: skip
"""Each is given its options, and returns what to write."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns 0 with an answer, 2 for bad input, 1 where valid input fails."""
    options = _parser().parse_args(arguments)
    logging.basicConfig(format="nuno: %(message)s", level=logging.WARNING)
    try:
        sys.stdout.write(COMMANDS[options.command](options))
        return ANSWERED
    except (EstimationError, SimulationDiverged) as error:
        return _failed(error, FAILED)
    except (NunoError, OSError) as error:
        return _failed(error, BAD_INPUT)
    except KeyboardInterrupt:
        sys.stderr.write("nuno: interrupted\n")
        return 130
    except Exception as error:
        logging.getLogger(__name__).debug("unexpected", exc_info=True)
        return _failed(error, FAILED)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="nuno", description="A simulator of deformable objects for robots.")
    parser.add_argument("--version", action="version", version=f"nuno {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    pick, fold = add_pick(commands), add_fold(commands)
    add_capture(commands)
    serve = add_serve(commands)
    add_describe_robot(commands)
    compared, scene = add_compare(commands), add_scene(commands)
    add_compile(commands)
    for command in (pick, fold, serve, scene):
        command.add_argument("--device", default="auto", help="auto (default), cpu, cuda, cuda:1 ...")
    for command in (pick, fold, compared):
        command.add_argument(
            "--progress", action=argparse.BooleanOptionalAction, default=None,
            help="progress bar (default: on a terminal)",
        )  # fmt: skip
    return parser


def _failed(error: BaseException, status: int) -> int:
    sys.stderr.write(f"nuno: {type(error).__name__}: {error}\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
