"""The command line: ``nuno pick CASE_DIR --out DIR``, and what else ``nuno --help`` lists."""

from __future__ import annotations

import argparse
import gc
import logging
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from nuno import __version__
from nuno.errors import EstimationError, NunoError, SimulationDiverged
from nuno.estimate.capture_options import add_capture
from nuno.estimate.lift_prior import HAND_STD, SIDEWAYS

if TYPE_CHECKING:
    from nuno.robot.simulated_robot import SimulatedRobot

ANSWERED, FAILED, BAD_INPUT = 0, 1, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns 0 with an answer, 2 for bad input, 1 where valid input fails."""
    parser = argparse.ArgumentParser(prog="nuno", description="A simulator of deformable objects for robots.")
    parser.add_argument("--version", action="version", version=f"nuno {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    pick = commands.add_parser("pick", help="at which point was a cloth picked up? from two images")
    pick.add_argument("case", metavar="CASE_DIR", help="folder with input.json and the two images that it names")
    pick.add_argument("--out", required=True, metavar="DIR", help="where result.json and result.png go")
    pick.add_argument("--candidates", default="6x6", metavar="NxM", help="grid: N along the longer side (default 6x6)")
    pick.add_argument(
        "--sideways", metavar="SHARE", default=str(SIDEWAYS),
        help=f"how far sideways hands go that lift a cloth, as a share of how high; none: any way (default {SIDEWAYS})",
    )  # fmt: skip
    pick.add_argument(
        "--shape", choices=("auto", "rectangle", "outline"), default="auto",
        help="auto (default) takes a rectangular cloth as a rectangle, any other by its outline; outline: any as it is",
    )  # fmt: skip
    pick.add_argument("--spacing", type=float, metavar="M", help="of candidates on an outline [m] (default: about 40)")
    pick.add_argument(
        "--hand-std", metavar="M", type=float, default=HAND_STD,
        help="[m] standard deviation of where the hand is, along each axis (default %(default)s)",
    )  # fmt: skip
    fold = commands.add_parser("fold", help="how does a cloth lie that hands have folded? from a video and their paths")
    fold.add_argument("case", metavar="CASE_DIR", help="folder with input.json and the images that its frames name")
    fold.add_argument("--out", required=True, metavar="DIR", help="where result.json, masks, pictures and replay go")
    add_capture(commands)
    serve = commands.add_parser(
        "serve", help="put a simulated robot on the wire, for programs that speak to it as to a real one"
    )
    serve.add_argument("robot", nargs="?", default="talos", help="talos (default), g1, or the path of a URDF file")
    graph = serve.add_mutually_exclusive_group()
    graph.add_argument("--rosbridge", action="store_true", help="for clients of the rosbridge protocol (default)")
    graph.add_argument("--ros1", action="store_true", help="in a ROS 1 graph too, by the system's rospy")
    graph.add_argument("--ros2", action="store_true", help="in a ROS 2 graph, over CycloneDDS")
    serve.add_argument("--domain", type=int, metavar="N", help="ROS 2's domain (default: ROS_DOMAIN_ID, else 0)")
    serve.add_argument(
        "--ros1-python", metavar="FILE", default="/usr/bin/python3", help="the Python with rospy (default %(default)s)"
    )
    serve.add_argument("--host", default="127.0.0.1", help="address to listen at (default: this machine only)")
    serve.add_argument("--port", type=int, default=9090, help="0 takes a free one (default 9090)")
    serve.add_argument(
        "--origins", nargs="+", default=(), metavar="ORIGIN",
        help="web pages that may connect, as browsers name them: http://localhost:8080 (default: none)",
    )  # fmt: skip
    pace = serve.add_mutually_exclusive_group()
    pace.add_argument(
        "--factor", type=float, default=1.0, help="simulated over real time (default 1; inf: at full speed)"
    )
    pace.add_argument("--stepped", action="store_true", help="let time pass only while a client waits for it")
    describe = commands.add_parser(
        "describe-robot", help="guess from a URDF the table of hands, feet, cameras and groups of a robot, to be edited"
    )
    describe.add_argument("urdf", metavar="URDF", help="the robot's file")
    describe.add_argument("--srdf", metavar="FILE", help="pairs of links that may overlap, postures, groups")
    describe.add_argument("--packages", nargs="+", metavar="DIR", help="folders that package:// is looked up in")
    describe.add_argument("--name", help="what the robot is to be called (default: the file's name)")
    describe.add_argument("--out", metavar="FILE", help="where the table goes (default: to the terminal)")
    compared = commands.add_parser(
        "compare", help="run a saved world on several engines: a film of them side by side, and how far they come apart"
    )
    compared.add_argument("scene", metavar="SCENE", help="the file that World.save wrote (.npz)")
    compared.add_argument(
        "--engines", nargs="+", metavar="ENGINE", default=["nuno", "mujoco", "newton"],
        help="two or more; the first is what the others are compared with (default: nuno mujoco newton)",
    )  # fmt: skip
    compared.add_argument("--seconds", type=float, default=2.0, help="how long it runs (default 2)")
    compared.add_argument("--out", required=True, metavar="DIR", help="where film.html and differences.json go")
    scene = commands.add_parser(
        "scene", help="what is in a scene file (MJCF, URDF, USD), and what of it a world of Nuno cannot have?"
    )
    scene.add_argument("file", metavar="FILE", help="ends with .xml, .urdf, .usd, .usda or .usdc")
    scene.add_argument("--keyframe", metavar="NAME", help="the key frame of an MJCF file to begin in")
    scene.add_argument("--free-base", action="store_true", help="let the root link of a URDF file move")
    scene.add_argument("--packages", nargs="+", default=(), metavar="DIR", help="folders for package:// in a URDF file")
    scene.add_argument("--seconds", type=float, default=0.0, metavar="S", help="let it run so long (default 0)")
    scene.add_argument("--out", metavar="DIR", help="where scene.png goes, and with --seconds film.html")
    scene.add_argument("--save", metavar="FILE", help="write it, as it is then, as MJCF (.xml) or USD (.usda, .usdc)")
    ahead = commands.add_parser(
        "compile", help="compile kernels ahead of use into Warp's cache: in a container image, on a cluster",
        description="Compile kernels ahead of use into Warp's cache (WARP_CACHE_PATH); what is there stays. "
        "CUDA needs no device for it.",
    )  # fmt: skip
    ahead.add_argument("--device", choices=("cpu", "cuda"), help="default: cuda where --arch is given, else cpu")
    ahead.add_argument(
        "--arch", metavar="sm_NN", help="CUDA's architecture, such as sm_90 (default: of the devices here)"
    )
    ahead.add_argument("--only", nargs="+", metavar="MODULE", help="these modules of kernels (default: all)")
    ahead.add_argument("--jobs", type=int, metavar="N", help="compile so many at once (default: one for each core)")
    compared.add_argument("--device", default="cpu", help="cpu (default), cuda, cuda:1 ...; mujoco has the CPU only")
    for command in (pick, fold, serve, scene):
        command.add_argument("--device", default="auto", help="auto (default), cpu, cuda, cuda:1 ...")
    pick.add_argument("--engine", default="nuno", help="what moves the imagined cloths: nuno (default), mujoco ...")
    for command in (pick, fold, compared):
        command.add_argument(
            "--progress", action=argparse.BooleanOptionalAction, default=None,
            help="progress bar (default: on a terminal)",
        )  # fmt: skip
    options = parser.parse_args(arguments)
    logging.basicConfig(format="nuno: %(message)s", level=logging.WARNING)
    try:
        commands_of = {
            "pick": _pick, "fold": _fold, "capture": _capture, "serve": _serve, "scene": _scene, "compare": _compare,
            "compile": _compile, "describe-robot": _describe_robot,
        }  # fmt: skip
        return commands_of[options.command](options)
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
    try:
        sideways = None if options.sideways.lower() == "none" else float(options.sideways)
    except ValueError:
        raise InvalidInputError(f"--sideways must be a number or none, got {options.sideways!r}") from None
    _check_out(options.out)
    from nuno.estimate.case import read_case

    case = read_case(options.case)
    _start_warp()
    grid = (int(parts[0]), int(parts[1]))
    result = case.estimate(
        candidates=grid, sideways=sideways, hand_std=options.hand_std, shape=options.shape, spacing=options.spacing,
        device=options.device, engine=options.engine, progress=options.progress,
    )  # fmt: skip
    result.save(options.out)
    a, b = result.best
    place = f"({100.0 * a:.1f}, {100.0 * b:.1f}) cm from C00" if result.by_position else f"({a}, {b})"
    sys.stdout.write(
        f"picked at {place}, confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s; "
        f"see {Path(options.out) / 'result.json'} and result.png\n"
    )
    return ANSWERED


def _compare(options: argparse.Namespace) -> int:
    _check_out(options.out)
    from nuno.viewer.compare_engines import compare_engines

    _start_warp()
    found = compare_engines(
        options.scene, options.engines, options.seconds, device=options.device, progress=options.progress
    )
    found.save(options.out)
    sys.stdout.write(f"{found.table()}\nsee {Path(options.out) / 'film.html'} and differences.json\n")
    return ANSWERED


def _fold(options: argparse.Namespace) -> int:
    _check_out(options.out)
    from nuno.estimate.fold_case import read_fold_case

    case = read_fold_case(options.case)
    _start_warp()
    result = case.replay(device=options.device, progress=options.progress)
    result.save(options.out, names=case.names)
    agreement = list(result.agreement.values())
    agreed = f"agreement {sum(agreement) / len(agreement):.3f}, " if agreement else ""
    sys.stdout.write(
        f"replayed {len(result.times)} frames as {result.material_name}, {agreed}in {result.seconds['total']:.1f} s; "
        f"see {Path(options.out) / 'result.json'}, strip.png, layers.png, hands.png and replay.glb\n"
    )
    return ANSWERED


def _capture(options: argparse.Namespace) -> int:
    from nuno.estimate.capture_command import run_capture

    if options.out is not None:
        _check_out(options.out)
    sys.stdout.write(run_capture(options))
    return ANSWERED


def _serve(options: argparse.Namespace) -> int:
    from nuno.errors import ConnectionLostError, InvalidInputError
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.ros1.ros1_driver import Ros1Driver
    from nuno.robot.simulated_robot import SimulatedRobot
    from nuno.robot.wire.server import RobotServer
    from nuno.world.world import World

    if (options.ros1 or options.ros2) and options.stepped:
        raise InvalidInputError("--stepped needs clients of rosbridge, which ask for time; ROS takes --factor")
    if options.domain is not None and not options.ros2:
        raise InvalidInputError("--domain is of ROS 2: it needs --ros2")
    _start_warp()
    robot = SimulatedRobot(Humanoid(options.robot), World(device=options.device))
    if options.ros2:
        return _serve_ros2(robot, options)
    factor = None if options.stepped else options.factor
    origins = tuple(options.origins)
    with RobotServer(robot, options.host, options.port, real_time_factor=factor, origins=origins) as server:
        gc.freeze()  # else one message in many thousands waits until all that was loaded is looked through for garbage
        with Ros1Driver(server.url, options.ros1_python) if options.ros1 else nullcontext() as driver:
            where = f"{server.url} and in the ROS 1 graph" if options.ros1 else server.url
            sys.stdout.write(f"{robot.robot.name} at {where}; Ctrl-C ends it\n")
            sys.stdout.flush()
            while not server.join(1.0):
                if driver is not None and not driver.alive:
                    raise ConnectionLostError("the ROS 1 node has ended; its messages above say why")
    return ANSWERED


def _serve_ros2(robot: SimulatedRobot, options: argparse.Namespace) -> int:
    from nuno.robot.ros2.ros2_server import Ros2Server

    with Ros2Server(robot, options.domain, real_time_factor=options.factor) as server:
        gc.freeze()
        sys.stdout.write(f"{robot.robot.name} in the ROS 2 domain {server.domain}; Ctrl-C ends it\n")
        sys.stdout.flush()
        while not server.join(1.0):
            pass
    return ANSWERED


def _describe_robot(options: argparse.Namespace) -> int:
    from nuno.robot.describe_robot import describe_robot

    text = describe_robot(
        options.urdf, options.out, srdf=options.srdf, package_dirs=options.packages, name=options.name
    )  # fmt: skip
    sys.stdout.write(text if options.out is None else f"see {options.out}, and correct what says CHECK\n")
    return ANSWERED


def _scene(options: argparse.Namespace) -> int:
    from nuno.scenes.load_scene import load_scene
    from nuno.scenes.save_scene import save_scene
    from nuno.scenes.show_scene import film_scene, picture_of
    from nuno.validation import number
    from nuno.world.world import World

    number("--seconds", options.seconds, low=0.0)
    if options.out is not None:
        _check_out(options.out)
    _start_warp()
    logging.getLogger("nuno.scenes").setLevel(logging.ERROR)  # the report says all
    scene = load_scene(
        options.file, World(device=options.device), keyframe=options.keyframe, fixed_base=not options.free_base,
        package_dirs=options.packages,
    )  # fmt: skip
    sys.stdout.write(f"{scene.report}\n")
    if options.out is not None:
        folder = Path(options.out)
        folder.mkdir(parents=True, exist_ok=True)
        picture_of(scene.world).save(folder / "scene.png")
        if options.seconds:
            film_scene(scene.world, options.seconds).save(folder / "film.html")
    elif options.seconds:
        scene.world.run(options.seconds)
    if options.save is not None:
        sys.stdout.write(f"{save_scene(scene.world, options.save)}\n")
    return ANSWERED


def _compile(options: argparse.Namespace) -> int:
    from nuno.errors import InvalidInputError
    from nuno.kernels.kernel_cache import compile_kernels

    if options.jobs is not None and options.jobs < 1:
        raise InvalidInputError(f"--jobs must be at least 1, got {options.jobs}")
    _start_warp()
    device = options.device or ("cpu" if options.arch is None else "cuda")
    count = 0

    def report(name: str, seconds: float) -> None:
        nonlocal count
        count += 1
        sys.stderr.write(f"nuno: {name}: {seconds:.1f} s\n")

    where = compile_kernels(device, options.arch, only=options.only, jobs=options.jobs, report=report)
    sys.stdout.write(f"{count} modules of kernels for {options.arch or device} in {where}\n")
    return ANSWERED


def _check_out(name: str) -> None:
    from nuno.errors import InvalidInputError

    if not name or "\0" in name:
        raise InvalidInputError(f"--out must be the name of a folder, got {name!r}")
    # now, and not when the work is done
    there = Path(name).absolute()
    while not os.path.lexists(there):
        there = there.parent
    if not there.is_dir():
        raise InvalidInputError(f"--out must be a folder, or the name of one to make; {there} is a file")
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InvalidInputError(f"--out must be a folder to write to; {there} is none: {error.strerror}") from error


def _start_warp() -> None:
    """Let Warp say nothing but errors: a command's output is its answer."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with _without_lines(b"Warp CUDA warning: Could not find or load"):  # most machines have no such driver
        wp.init()


@contextmanager
def _without_lines(beginning: bytes) -> Iterator[None]:
    """Leave out lines of standard error that begin so, also where a library's own code writes them."""
    sys.stderr.flush()
    try:
        terminal = os.dup(2)
    except OSError:  # there is no standard error
        yield
        return
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            said.seek(0)
            for line in said:
                if not line.startswith(beginning):
                    os.write(terminal, line)
            os.close(terminal)


def _failed(error: BaseException, status: int) -> int:
    sys.stderr.write(f"nuno: {type(error).__name__}: {error}\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
