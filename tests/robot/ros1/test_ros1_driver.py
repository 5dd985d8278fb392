"""ROS 1's own programs: a master, rospy, actionlib and scikit-robot's interface, all as they come."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import nuno
from interrupts import obey_interrupts
from nuno.errors import NotConnectedError
from nuno.robot.readings import ImageReading
from nuno.robot.ros1.ros1_driver import CHECK, PYTHON, Ros1Driver
from nuno.robot.wire.server import RobotServer

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent / "wire"))
FOLDER = str(Path(nuno.__file__).parent / "robot")
PATIENCE = 300.0


def has_ros1(python):
    """Whether a Python has rospy and what it needs here."""
    try:
        return subprocess.run([python, "-c", CHECK], capture_output=True).returncode == 0
    except OSError:
        return False


needs_ros1 = pytest.mark.skipif(
    shutil.which("rosmaster") is None or not has_ros1(PYTHON), reason="no ROS 1 here: Debian's python3-rospy and others"
)


@pytest.fixture
def master(tmp_path, monkeypatch):
    """A ROS master of its own to each test, and the environment that names it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
    monkeypatch.setenv("ROS_HOSTNAME", "127.0.0.1")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    with subprocess.Popen(
        ["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        for _ in range(1000):
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    break
        yield port
        process.kill()


@pytest.fixture
def plain(still_g1, monkeypatch):
    """A plain robot that sees a picture."""
    from plain_robot import PlainRobot

    robot = PlainRobot(still_g1)
    image = np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    camera = robot.robot.camera("head")
    monkeypatch.setattr(PlainRobot, "shown_cameras", property(lambda _: ("head",)))
    robot.read_image = lambda name: ImageReading(robot.now(), camera, image)
    robot.picture, robot.focal = image, camera.fx
    return robot


def run(python, script, plain):
    """Run a program of ROS 1, and return what it says it has seen."""
    joints = plain.controller_param_table["larm_controller"][0]["joint_names"]
    done = subprocess.run(
        [python, str(HERE / script), FOLDER, json.dumps(joints)], capture_output=True, text=True, timeout=PATIENCE
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.strip().splitlines()[-1])


@needs_ros1
def test_rospy_and_actionlib(master, plain):
    """States, tf, images and parameters come; goals succeed, are cancelled, refused; commands and Twists are taken."""
    with RobotServer(plain, port=0) as server, Ros1Driver(server.url):
        seen = run(PYTHON, "rospy_client.py", plain)
    assert seen["names"] == list(plain.robot.joint_names)
    assert abs(seen["now"] - seen["stamp"]) < 5.0  # of one clock, the simulation's, that began a few seconds ago
    assert seen["pelvis_in"] == "odom"
    assert "<robot" in seen["urdf"]
    assert seen["image"] == [48, 64, "rgb8", int(plain.picture.sum())]
    assert seen["focal"] == plain.focal
    assert seen["server"]
    assert seen["feedback"]
    assert (seen["status"], seen["code"]) == (3, 0)  # actionlib_msgs/GoalStatus: succeeded
    assert seen["cancelled"] == 2  # preempted
    assert (seen["refused"], seen["refused_code"]) == (5, -2)  # rejected: other joints than the controller's
    assert seen["walked"]
    assert seen["back"] < 1e-6


@needs_ros1
@pytest.mark.skipif(
    f"{sys.version_info.major}.{sys.version_info.minor}" != "3.11", reason="rospy's Python is another than this one"
)
@pytest.mark.long
def test_scikit_robot_unmodified(master, plain):
    """Promise: scikit-robot's own ROSRobotInterfaceBase drives a robot of Nuno's as a real one."""
    pytest.importorskip("skrobot")
    with RobotServer(plain, port=0) as server, Ros1Driver(server.url):
        seen = run(sys.executable, "skrobot_client.py", plain)
    assert seen["controllers"] == 1
    assert seen["wait"] == [False]
    assert seen["there"] == pytest.approx(0.2, abs=1e-6)
    assert seen["sequence"] == pytest.approx(0.3, abs=1e-6)
    assert seen["moving"]
    assert seen["cancelled"]


@needs_ros1
def test_it_ends_with_the_server(master, plain):
    """And the node leaves the master."""
    server = RobotServer(plain, port=0)
    driver = Ros1Driver(server.url)
    assert driver.alive
    server.close()
    driver._process.wait(PATIENCE)
    driver.close()
    assert not driver.alive


@needs_ros1
def test_no_master_is_named(plain, monkeypatch):
    """Before anything waits for one."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    with RobotServer(plain, port=0) as server, pytest.raises(NotConnectedError, match="no ROS master"):
        Ros1Driver(server.url)


def test_a_python_without_ros_is_named(tmp_path):
    """With what to install."""
    other = tmp_path / "python"
    other.write_text('#!/bin/sh\necho "ModuleNotFoundError: No module named rospy" >&2\nexit 1\n')
    os.chmod(other, 0o755)
    with pytest.raises(NotConnectedError, match=r"has no ROS 1 \(ModuleNotFoundError.*apt install python3-rospy"):
        Ros1Driver("ws://127.0.0.1:1", str(other))
    with pytest.raises(NotConnectedError, match="cannot be run to look for rospy"):
        Ros1Driver("ws://127.0.0.1:1", str(tmp_path / "none"))


@pytest.mark.long
@needs_ros1
def test_the_command(master, still_g1):
    """Promise: `nuno serve --ros1` shows the robot on the master; an interrupt ends it, and the node with it."""
    command = [sys.executable, "-m", "nuno", "serve", "g1", "--ros1", "--port", "0", "--device", "cpu"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=obey_interrupts
    ) as process:
        try:
            said = process.stdout.readline()
            assert "and in the ROS 1 graph" in said, said + process.stderr.read()
            look = "import rospy, sensor_msgs.msg as own; rospy.init_node('look'); print(len("
            look += "rospy.wait_for_message('/joint_states', own.JointState, 30).name))"
            seen = subprocess.run([PYTHON, "-c", look], capture_output=True, text=True, timeout=PATIENCE)
            assert int(seen.stdout.split()[-1]) == len(still_g1.joint_names), seen.stderr
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 130
        finally:
            process.kill()
