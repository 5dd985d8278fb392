"""A robot on the wire keeps to the driver's interface: client, wire, server, simulation."""

import pytest
from conformance import Conformance

import nuno
from nuno.robot.simulated_robot import SimulatedRobot
from nuno.robot.wire.client import WireRobot
from nuno.robot.wire.server import RobotServer


@pytest.fixture(scope="module")
def links(still_talos):
    """Talos' links in a world: hulls are made once."""
    return still_talos.copy().enter(nuno.World(device="cpu"))


class TestWireRobot(Conformance):
    """Against a server that lets time pass while somebody waits, at full speed."""

    @pytest.fixture
    def interface(self, links):
        """Talos, put back as it starts, a new driver for it, a server and a client."""
        links.robot.stand()
        links.follow(0.0)
        simulated = SimulatedRobot(links.robot, links.world, links=links)
        with (
            RobotServer(simulated, port=0, real_time_factor=None) as server,
            WireRobot(server.url, links.robot) as robot,
        ):
            yield robot
        simulated.leave()
