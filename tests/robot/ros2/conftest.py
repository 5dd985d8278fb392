"""A plain robot in a ROS 2 graph of this machine, and those who look at it."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "wire"))  # for the plain robot

@pytest.fixture
def plain(still_g1):
    """A robot of its own to each test."""
    from plain_robot import PlainRobot

    return PlainRobot(still_g1)


@pytest.fixture
def serve(plain, monkeypatch):
    """Put a robot in the graph."""
    from ros2_node import graph_domain

    from nuno.robot.ros2.ros2_server import Ros2Server

    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    servers = []

    def start(robot=plain, **options):
        servers.append(Ros2Server(robot, graph_domain(), **options))
        return servers[-1]

    yield start
    for server in servers:
        server.close()
