"""A robot in a world whose gravity changes: soles, sensors and motors bear m g of the moment."""

import logging

import numpy as np
import pytest

import nuno

MARS = (0.0, 0.0, -3.71)


def soles(robot):
    """What the floor bears [N]."""
    return sum(force[2] for own in robot.state().contacts.values() for force in own.values())


def ankles(robot):
    """What legs bear between the feet and the rest [N]."""
    wrenches = robot.read().wrenches
    return wrenches["left_ankle"][2] + wrenches["right_ankle"][2]


@pytest.fixture
def room():
    """A floor."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    return world


@pytest.mark.parametrize("dynamics", [False, True], ids=["kinematic", "dynamic"])
def test_a_robot_bears_its_weight_of_now(room, dynamics):
    """Before and after the change; forces of soles are within 0.1 % as on Earth, sensors follow."""
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), room, dynamics=dynamics)
    robot.sleep(0.3)
    on_earth = ankles(robot)
    room.gravity = MARS
    robot.sleep(0.5)
    share = MARS[2] / -9.81
    assert ankles(robot) == pytest.approx(share * on_earth, rel=1e-3)
    assert np.linalg.norm(robot.read().specific_force) == pytest.approx(-MARS[2], rel=1e-3)
    assert robot.read().contacts == {"left_foot": True, "right_foot": True}
    if dynamics:
        assert soles(robot) == pytest.approx(-MARS[2] * robot.actual.mass, rel=1e-3)
        assert robot.state().fallen is None
        assert np.abs(robot.state().v).max() < 5e-3  # it stands, as on Earth


def test_a_snapshot_brings_its_gravity_along(room):
    """What is restored in a world of another gravity stands there by the motors that it takes there."""
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), room, dynamics=True)
    on_earth = room.save()
    room.gravity = MARS
    robot.sleep(0.3)
    room.restore(on_earth)
    robot.sleep(0.3)
    assert room.gravity == (0.0, 0.0, -9.81)
    assert soles(robot) == pytest.approx(9.81 * robot.actual.mass, rel=1e-3)


def test_copies_reckon_with_their_own_gravity(room):
    """And the robot with its own, though copies were asked in between."""
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), room, dynamics=True)
    robot.sleep(0.2)
    futures = room.imagine(1)
    futures.gravity = MARS
    alone = room.save()
    for _ in range(20):
        futures.step()
        room.step()
    together = room.find(robot.links.bodies[-1].name).vertices
    weight = sum(force[2] for own in futures.robot.state()[0].contacts.values() for force in own.values())
    assert weight == pytest.approx(-MARS[2] * robot.actual.mass, rel=1e-2)
    room.restore(alone)
    room.run(20 / 60.0)
    np.testing.assert_array_equal(robot.links.bodies[-1].vertices, together)


def test_without_gravity_a_robot_floats(room, caplog):
    """Its momentum stays that at which it was let go, its joints go where they are sent, and nobody says it fell."""
    room.gravity = (0.0, 0.0, 0.0)
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), room, dynamics=True)
    room.remove("floor")
    with caplog.at_level(logging.WARNING):
        robot.angle_vector({"arm_left_4_joint": -1.4}, 0.5)
        robot.sleep(0.8)
    assert robot.actual.angle_vector()[robot.actual.joint_index("arm_left_4_joint")] == pytest.approx(-1.4, abs=0.01)
    momentum = sum(body.momentum for body in robot.links.bodies)
    np.testing.assert_allclose(momentum, 0.0, atol=0.02)  # kg m/s, of 90 kg: single precision over 50 substeps
    assert robot.state().fallen is None
    assert not caplog.records
