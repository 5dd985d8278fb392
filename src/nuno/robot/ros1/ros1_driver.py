"""Ros1Driver: the process that puts a rosbridge server's robot into a ROS 1 graph."""

from __future__ import annotations

import json
import logging
import subprocess
import threading
from pathlib import Path
from typing import Any

from nuno.errors import NotConnectedError
from nuno.robot.ros1.ros1_node import NO_MASTER, READY
from nuno.robot.wire.bridge import import_websockets
from nuno.validation import checked

logger = logging.getLogger(__name__)

PYTHON = "/usr/bin/python3"
"""The interpreter of a system's ROS 1: Debian's and Ubuntu's packages are for that one."""
RUN = "import sys; sys.path.append(sys.argv[1]); from ros1.ros1_node import main; sys.exit(main())"
CHECK = "import actionlib, genpy, rosgraph, rospy, sensor_msgs.msg, trajectory_msgs.msg, nav_msgs.msg, tf2_msgs.msg"
PACKAGES = (
    "python3-rospy", "python3-actionlib", "python3-sensor-msgs", "python3-trajectory-msgs", "python3-nav-msgs",
    "python3-tf2-msgs", "python3-rosgraph-msgs",
)  # fmt: skip
"""Of Debian and Ubuntu, which have no control_msgs: those messages are made here."""
STARTING = 30.0
"""[s] For the node to find the master and the server."""
ENDING = 5.0
"""[s] For the node to take its leave of the master."""


class Ros1Driver:
    """A node "/nuno" on a ROS master, for the robot of a server: topics, FollowJointTrajectory, grippers, tf, images.

    It is a process of the system's own Python, which has rospy; Nuno's need not. What nobody has subscribed to is not
    computed. Time is the simulation's: ``/use_sim_time`` is set and ``/clock`` published, so start programs after
    it. When this program or the process ends, all that ROS 1 has asked for stops.

    Args:
        url: Of a ``RobotServer``, or of another rosbridge server of ROS 2.
        python: The Python that has rospy.

    Raises:
        MissingPackageError: websockets is not installed.
        NotConnectedError: that Python lacks rospy or a package of messages, there is no ROS master, or the server
            cannot be reached.
    """

    @checked
    def __init__(self, url: str, python: str = PYTHON) -> None:
        import_websockets("a robot in a ROS 1 graph")
        self.url = url
        _check(python)
        self._socket = _connect(url)
        folder = str(Path(__file__).parents[1])
        self._process = subprocess.Popen(
            [python, "-c", RUN, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            start_new_session=True,  # an interrupt at the terminal ends this program, which ends the node
        )  # fmt: skip
        self._ready = threading.Event()
        self._threads = [threading.Thread(target=run, name="nuno-ros1", daemon=True)
                         for run in (self._from_node, self._to_node)]  # fmt: skip
        for thread in self._threads:
            thread.start()
        while not self._ready.wait(0.05):
            if self._process.poll() is not None:
                self.close()
                raise NotConnectedError(_reason(self._process.returncode))

    def __enter__(self) -> Ros1Driver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Ros1Driver of {self.url}, {'alive' if self.alive else 'ended'}>"

    @property
    def alive(self) -> bool:
        """Return True if the node is there."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the node; a second time does nothing."""
        self._socket.close()
        if self._process.stdin is not None and not self._process.stdin.closed:
            try:
                self._process.stdin.close()  # which the node takes as its end
            except BrokenPipeError:
                logger.debug("the node had ended")
        try:
            self._process.wait(ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()

    def _from_node(self) -> None:
        from websockets.exceptions import ConnectionClosed

        assert self._process.stdout is not None
        for line in self._process.stdout:
            if json.loads(line)["op"] == READY:
                self._ready.set()
                continue
            try:
                self._socket.send(line)
            except ConnectionClosed:
                break
        self._socket.close()  # the server stops what the node has asked for

    def _to_node(self) -> None:
        from websockets.exceptions import ConnectionClosed

        assert self._process.stdin is not None
        try:
            while True:
                text = self._socket.recv()
                self._process.stdin.write(f"{text}\n")
                self._process.stdin.flush()
        except (ConnectionClosed, BrokenPipeError, ValueError) as end:  # a ValueError is a pipe that was closed here
            logger.info("the ROS 1 node of %s ends: %s", self.url, end)
        try:
            self._process.stdin.close()
        except BrokenPipeError:
            logger.debug("the node had ended")


def _check(python: str) -> None:
    try:
        found = subprocess.run([python, "-c", CHECK], capture_output=True, text=True, timeout=STARTING)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotConnectedError(f"{python!r} cannot be run to look for rospy: {error}") from error
    if found.returncode != 0:
        lacks = found.stderr.strip().rpartition("\n")[2] or "it ended without a word"
        raise NotConnectedError(
            f"{python} has no ROS 1 ({lacks}); on Debian and Ubuntu: apt install {' '.join(PACKAGES)}; of another "
            "installation source setup.bash and name its Python"
        )


def _connect(url: str) -> Any:
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    try:
        return connect(url, max_size=None, compression=None, proxy=None)
    except (OSError, ValueError, WebSocketException) as error:
        raise NotConnectedError(f"cannot connect to {url}: {error}") from error


def _reason(code: int) -> str:
    if code == NO_MASTER:
        return "there is no ROS master at ROS_MASTER_URI (by default http://localhost:11311): start roscore before"
    return f"the ROS 1 node ended with the status {code}; its standard error says why"
