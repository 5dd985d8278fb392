"""The command ``nuno serve``."""

from __future__ import annotations

import argparse
import gc
import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from nuno.errors import ConnectionLostError, InvalidInputError
from nuno.kernels.start_warp import start_warp

if TYPE_CHECKING:
    from nuno.robot.simulated_robot import SimulatedRobot


def add_serve(commands: Any) -> argparse.ArgumentParser:
    """Add the command to those of argparse, and return its parser."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "serve", help="put a simulated robot on the wire, for programs that speak to it as to a real one"
    )
    parser.add_argument("robot", nargs="?", default="talos", help="talos (default), g1, or the path of a URDF file")
    graph = parser.add_mutually_exclusive_group()
    graph.add_argument("--rosbridge", action="store_true", help="for clients of the rosbridge protocol (default)")
    graph.add_argument("--ros1", action="store_true", help="in a ROS 1 graph too, by the system's rospy")
    graph.add_argument("--ros2", action="store_true", help="in a ROS 2 graph, over CycloneDDS")
    parser.add_argument("--domain", type=int, metavar="N", help="ROS 2's domain (default: ROS_DOMAIN_ID, else 0)")
    parser.add_argument(
        "--ros1-python", metavar="FILE", default="/usr/bin/python3", help="the Python with rospy (default %(default)s)"
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen at (default: this machine only)")
    parser.add_argument("--port", type=int, default=9090, help="0 takes a free one (default 9090)")
    parser.add_argument(
        "--origins", nargs="+", default=(), metavar="ORIGIN",
        help="web pages that may connect, as browsers name them: http://localhost:8080 (default: none)",
    )  # fmt: skip
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument(
        "--factor", type=float, default=1.0, help="simulated over real time (default 1; inf: at full speed)"
    )
    pace.add_argument("--stepped", action="store_true", help="let time pass only while a client waits for it")
    return parser


def run_serve(options: argparse.Namespace) -> str:
    """Serve a robot until it is ended; nothing is left to tell then."""
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.ros1.ros1_driver import Ros1Driver
    from nuno.robot.simulated_robot import SimulatedRobot
    from nuno.robot.wire.server import RobotServer
    from nuno.world.world import World

    if (options.ros1 or options.ros2) and options.stepped:
        raise InvalidInputError("--stepped needs clients of rosbridge, which ask for time; ROS takes --factor")
    if options.domain is not None and not options.ros2:
        raise InvalidInputError("--domain is of ROS 2: it needs --ros2")
    start_warp()
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
    return ""


def _serve_ros2(robot: SimulatedRobot, options: argparse.Namespace) -> str:
    from nuno.robot.ros2.ros2_server import Ros2Server

    with Ros2Server(robot, options.domain, real_time_factor=options.factor) as server:
        gc.freeze()
        sys.stdout.write(f"{robot.robot.name} in the ROS 2 domain {server.domain}; Ctrl-C ends it\n")
        sys.stdout.flush()
        while not server.join(1.0):
            pass
    return ""
