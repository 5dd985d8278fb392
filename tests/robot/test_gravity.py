"""A robot in a world whose gravity changes: soles, sensors and motors bear m g of the moment."""

import logging

import numpy as np
import pytest

import nuno
from nuno.robot.goal import GoalStatus
from nuno.robot.walk_check import zero_moments
from nuno.robot.walking import plan_walk

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


HEAVIER = (0.0, 0.0, -15.0)
LIGHTER = (0.0, 0.0, -5.0)


@pytest.mark.parametrize("gravity", [LIGHTER, HEAVIER], ids=["lighter", "heavier"])
def test_a_walk_is_planned_for_the_gravity_there_is(still_talos, gravity):
    """By inverse dynamics under that gravity, which another model does, the zero moment point is where it was wanted.

    A walk for another gravity misses it by the difference of h / g times the acceleration.
    """
    model = still_talos.model.copy()
    model.gravity.linear = np.array(gravity)
    missed = []
    for own in (gravity, (0.0, 0.0, -9.81)):
        walk = plan_walk(still_talos, 0.3, gravity=own)
        motion = (walk.configurations, walk.velocities, walk.accelerations)
        points = zero_moments(model, model.createData(), motion, float(walk.feet[0, :, 2].mean()))[0]
        missed.append(np.sqrt(np.mean((points - walk.zmp_wanted)[1:-1] ** 2)))
    assert missed[0] < 0.004 and missed[1] > 2.0 * missed[0]  # [m], preview control's own error


@pytest.mark.parametrize("dynamics", [False, True], ids=["kinematic", "dynamic"])
def test_robots_and_copies_walk_by_their_worlds_gravity(dynamics):
    """Upright and there; a copy goes as the robot does, to the bit, and neither as on Earth."""
    ends = []
    for gravity in (LIGHTER, (0.0, 0.0, -9.81)):
        world = nuno.World(device="cpu", gravity=gravity)
        world.add(nuno.plane(name="floor"))
        robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
        start, futures = robot.state().q[0], world.imagine(1)
        assert futures.robot.go_pos(0.2, 0.0, 0.0).all()
        robot.go_pos(0.2, 0.0, 0.0, wait=False)
        world.run(2.0)
        futures.run(2.0)
        np.testing.assert_array_equal(futures.robot.state()[0].q, robot.state().q)
        ends.append(robot.state().q)
        robot.wait_until(lambda own=robot: not own.gait.is_walking, timeout=10.0)
        # the base, which a robot that walked has elsewhere over its feet than one that stands as it began
        assert robot.state().q[0] - start == pytest.approx(0.2, abs=0.02) and robot.state().fallen is None
    assert np.abs(ends[0] - ends[1]).max() > 1e-4


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (0.5, 0.0, -9.81)], ids=str)
def test_walks_without_such_gravity_are_refused(still_talos, gravity):
    """By a named error, or a goal that ends as rejected, of the robot and of its copies."""
    with pytest.raises(nuno.WalkError, match="along -z"):
        plan_walk(still_talos, 0.3, gravity=gravity)
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    futures = world.imagine(2)
    world.gravity = futures.gravity = gravity
    assert not robot.go_pos(0.3)
    goal = robot.send_velocity(0.1, 0.0, 0.0)
    assert goal.status == GoalStatus.REJECTED and "along -z" in goal.text
    assert not futures.robot.go_pos(0.3).any()
    assert all("along -z" in own.text for own in futures.robot.base_goals())
