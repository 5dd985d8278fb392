"""A plain robot on the wire, and those who talk to it."""

import pytest
from plain_robot import PlainRobot
from wire_with import PATIENCE, RawClient

from nuno.robot.wire.client import WireRobot
from nuno.robot.wire.server import RobotServer


@pytest.fixture
def plain(still_g1):
    """A robot of its own to each test."""
    return PlainRobot(still_g1)


@pytest.fixture
def serve(plain):
    """Put the plain robot on the wire; time passes when clients wait, unless told otherwise."""
    servers = []

    def start(robot=plain, **options):
        servers.append(RobotServer(robot, **({"port": 0, "real_time_factor": None} | options)))
        return servers[-1]

    yield start
    for server in servers:
        server.close()


@pytest.fixture
def join(still_g1):
    """Connect a ``WireRobot``."""
    robots = []

    def start(server, **options):
        robots.append(WireRobot(getattr(server, "url", server), still_g1, **({"timeout": PATIENCE} | options)))
        return robots[-1]

    yield start
    for robot in robots:
        robot.close()


@pytest.fixture
def raw():
    """Connect a ``RawClient``."""
    clients = []

    def start(server, **options):
        clients.append(RawClient(server.url, **options))
        return clients[-1]

    yield start
    for client in clients:
        client.socket.close()
