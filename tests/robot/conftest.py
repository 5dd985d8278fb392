"""Robots that several tests read; those that move them make their own."""

import pytest

import nuno
from nuno.robot.simulated_robot import SimulatedRobot


@pytest.fixture(scope="session")
def still_talos():
    """Talos as it starts; not to be moved."""
    return nuno.Humanoid()


@pytest.fixture
def talos(still_talos):
    """Talos, put back as it starts: meshes are read once."""
    still_talos.stand()
    yield still_talos
    still_talos.stand()


@pytest.fixture(scope="session")
def still_g1():
    """G1 as it starts; not to be moved."""
    return nuno.Humanoid("g1")


@pytest.fixture
def g1(still_g1):
    """G1, put back as it starts."""
    still_g1.stand()
    yield still_g1
    still_g1.stand()


@pytest.fixture(scope="module")
def links(still_talos):
    """Talos' links in a world: hulls are made once."""
    return still_talos.copy().enter(nuno.World(device="cpu"))


@pytest.fixture
def simulated(links):
    """Talos, put back as it starts, and a driver for it."""
    links.robot.stand()
    links.follow(0.0)
    robot = SimulatedRobot(links.robot, links.world, links=links)
    yield robot
    robot.world.stop()
    robot.leave()


@pytest.fixture(scope="module")
def floor_world():
    """A world with a floor and a standing Talos with dynamics, as it is after 0.3 s; whoever uses it restores it."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    robot.sleep(0.3)
    return world, robot, world.save()


@pytest.fixture
def standing(floor_world):
    """The world and the robot of ``floor_world``, as they were."""
    world, robot, saved = floor_world
    world.restore(saved)
    return world, robot
