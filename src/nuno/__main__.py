"""The command line: ``python -m nuno pick CASE_DIR --out DIR``."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from nuno.errors import EstimationError, NunoError, SimulationDiverged

ANSWERED, FAILED, BAD_INPUT = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns 0 with an answer, 2 for bad input, 1 where valid input fails."""
    parser = argparse.ArgumentParser(prog="nuno", description="A simulator of deformable objects for robots.")
    commands = parser.add_subparsers(dest="command", required=True)
    pick = commands.add_parser("pick", help="at which point was a cloth picked up? from two images")
    pick.add_argument("case", metavar="CASE_DIR", help="folder with input.json and the two images that it names")
    pick.add_argument("--out", required=True, metavar="DIR", help="where result.json and result.png go")
    pick.add_argument("--device", default="auto", help="auto (default), cpu, cuda, cuda:1 ...")
    pick.add_argument("--candidates", default="6x6", metavar="NxM", help="grid: N along the longer side (default 6x6)")
    pick.add_argument(
        "--progress", action=argparse.BooleanOptionalAction, default=None, help="progress bar (default: on a terminal)"
    )
    options = parser.parse_args(arguments)
    logging.basicConfig(format="nuno: %(message)s", level=logging.WARNING)
    _quiet_warp()
    try:
        return _pick(options)
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


def _pick(options: argparse.Namespace) -> int:
    from nuno.errors import InvalidInputError

    parts = options.candidates.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts):
        raise InvalidInputError(f"--candidates must be two numbers such as 6x6, got {options.candidates!r}")
    out = Path(options.out)
    if out.exists() and not out.is_dir():  # now, and not when the work is done
        raise InvalidInputError(f"--out must be a folder, or the name of one to make; {out} is a file")
    from nuno.estimate.case import read_case

    case = read_case(options.case)
    grid = (int(parts[0]), int(parts[1]))
    result = case.estimate(candidates=grid, device=options.device, progress=options.progress)
    result.save(options.out)
    i, j = result.best
    sys.stdout.write(
        f"picked at ({i}, {j}), confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s; "
        f"see {options.out}/result.json and result.png\n"
    )
    return ANSWERED


def _quiet_warp() -> None:
    """Let Warp say nothing but errors: a command's output is its answer."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR


def _failed(error: BaseException, status: int) -> int:
    sys.stderr.write(f"nuno: {type(error).__name__}: {error}\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
