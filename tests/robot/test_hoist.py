"""A robot with dynamics that a hoist lifts by its base: its joints hold still, and each bears what statics says."""

import numpy as np
import pytest
from alike import assert_copies_go_on_alike

import nuno

LIFT = 0.2
"""[m]"""


@pytest.fixture
def lifted():
    """G1 in the air, its base led up in 1 s and at rest since."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("g1"), world, dynamics=True)
    robot.sleep(0.2)
    base, start = robot.links.bodies[0], world.time
    places = np.array([base.position] * 4) + LIFT * np.outer((0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    times = start + np.array([0.0, 1.0, 1.6, 2.6])
    grip = world.grip(base, to=nuno.Path(times, places, interpolation="minimum_jerk"))
    world.run(1.5)
    return world, robot, grip


def test_the_hoist_bears_its_weight_and_its_feet_bear_it_again(lifted):
    """Within 0.1 % at rest in the air; set down and let go, it stands and walks."""
    world, robot, grip = lifted
    weight = 9.81 * robot.actual.mass
    force, _ = grip.wrench
    np.testing.assert_allclose(force, (0.0, 0.0, -weight), atol=1e-3 * weight)
    assert robot.state().contacts == {}
    assert np.abs(robot.state().v).max() < 0.02  # [rad/s]: it hangs still
    assert robot.read().specific_force[2] == pytest.approx(9.81, rel=1e-3)
    world.run(1.5)
    grip.release()
    world.run(0.4)
    soles = sum(force[2] for own in robot.state().contacts.values() for force in own.values())
    assert soles == pytest.approx(weight, rel=0.01)  # as it settles from the hoist
    assert robot.go_pos(0.1, 0.0, 0.0)
    assert robot.state().fallen is None


def test_copies_hang_alike(lifted):
    """An imagined one, and the robot restored, go on as it does, to the bit, down to the floor."""
    world, robot, _ = lifted
    assert_copies_go_on_alike(world, robot, 1.3)
