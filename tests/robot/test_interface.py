"""The driver's interface: every robot keeps to it, the simulated one in process."""

import pytest
from conformance import Conformance

import nuno
from nuno.robot.simulated_robot import SimulatedRobot


@pytest.fixture(scope="module")
def links(still_talos):
    """Talos' links in a world: hulls are made once."""
    return still_talos.copy().enter(nuno.World(device="cpu"))


class TestSimulatedRobot(Conformance):
    """In process."""

    @pytest.fixture
    def interface(self, links):
        """Talos, put back as it starts, and a new driver for it."""
        links.robot.stand()
        links.follow(0.0)
        robot = SimulatedRobot(links.robot, links.world, links=links)
        yield robot
        robot.leave()
