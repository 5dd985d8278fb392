"""The command that puts a robot on the wire."""

import re
import signal
import subprocess
import sys

from wire_with import PATIENCE

from interrupts import obey_interrupts
from nuno.__main__ import main
from nuno.robot.wire.client import WireRobot


def test_serve(still_g1):
    """It says where it is, a robot is there, and an interrupt ends it."""
    command = [sys.executable, "-m", "nuno", "serve", "g1", "--port", "0", "--stepped", "--device", "cpu"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=obey_interrupts
    ) as process:
        try:
            said = process.stdout.readline()
            url = re.search(r"g1 at (ws://127\.0\.0\.1:\d+)", said)
            assert url is not None, said + (process.stderr.read() if process.poll() is not None else "")
            with WireRobot(url[1], still_g1, timeout=PATIENCE) as robot:
                robot.angle_vector({"waist_yaw_joint": 0.1}, 0.5)
                robot.wait_interpolation()
                assert abs(robot.angle_vector()[robot.robot.joint_index("waist_yaw_joint")] - 0.1) < 1e-6
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 130
        finally:
            process.kill()


def test_serve_refuses(capsys):
    """A robot that is not known, or a port that is none: bad input, by name."""
    assert main(["serve", "c3po"]) == 2
    assert "no robot named 'c3po'" in capsys.readouterr().err
    assert main(["serve", "g1", "--port", "70000"]) == 2
    assert "port must be a whole number" in capsys.readouterr().err


def test_graphs_of_ros_have_their_own_options(capsys):
    """Time passes by itself there, and a domain is ROS 2's alone: the others are refused before anything is loaded."""
    for graph in ("--ros1", "--ros2"):
        assert main(["serve", "g1", graph, "--stepped"]) == 2
        assert "--stepped needs clients of rosbridge" in capsys.readouterr().err
    assert main(["serve", "g1", "--rosbridge", "--domain", "3"]) == 2
    assert "--domain is of ROS 2" in capsys.readouterr().err
