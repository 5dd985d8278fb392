"""Robots with dynamics on ground that moves: they ride on it, and a fall there is told."""

import numpy as np
import pytest
from alike import assert_copies_go_on_alike

import nuno
from nuno.robot.ride import Ride

HEIGHT = 0.2
"""[m], of the platform's top."""


def stands(kind="g1", size=0.8):
    """A robot on a square platform of a size [m], at rest."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    platform = world.add(nuno.box((size, size, HEIGHT), name="platform", position=(0.0, 0.0, 0.5 * HEIGHT)))
    humanoid = nuno.Humanoid(kind)
    humanoid.stand((0.0, 0.0, HEIGHT))
    robot = nuno.SimulatedRobot(humanoid, world, dynamics=True)
    robot.sleep(0.4)
    return world, platform, robot


def go(world, platform, shift, seconds, turn=0.0):
    """Send the platform on its way."""
    start, ends = np.array(platform.position), np.array([0.0, 0.5 * turn])
    turns = np.stack([np.cos(ends), 0.0 * ends, 0.0 * ends, np.sin(ends)], axis=1)
    times = world.time + np.array([0.0, seconds])
    world.move(platform, nuno.Path(times, [start, start + shift], turns, interpolation="minimum_jerk"))


def seen_from(platform, robot):
    """Where the base is (3,) [m], along the platform's axes."""
    w, _, _, z = platform.quaternion
    cosine, sine = 1.0 - 2.0 * z * z, 2.0 * w * z
    x, y, up = robot.state().q[:3] - platform.position
    return np.array([cosine * x + sine * y, cosine * y - sine * x, up])


def pressed(robot):
    """Force of the ground on the feet [N], upwards."""
    return sum(force[2] for own in robot.state().contacts.values() for force in own.values())


def test_a_standing_robot_goes_with_its_ground():
    """Up by 0.3 m in 1 s, and aside by 0.4 m in 2 s: it comes to rest where it stood there, within 2 mm.

    A quarter of the way up its feet bear m (g + a) within 2 %: the motion of least jerk has
    a = (60 s - 180 s^2 + 120 s^3) 0.3 m / (1 s)^2 there.
    """
    world, platform, robot = stands("talos")
    before = seen_from(platform, robot)
    go(world, platform, (0.0, 0.0, 0.3), 1.0)
    robot.sleep(0.25)
    s = 0.25
    bears = robot.actual.mass * (9.81 + 0.3 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3))
    assert pressed(robot) == pytest.approx(bears, rel=0.02)
    robot.sleep(1.25)
    go(world, platform, (0.0, 0.4, 0.0), 2.0)
    robot.sleep(3.0)
    np.testing.assert_allclose(seen_from(platform, robot), before, atol=2e-3)
    assert robot.state().fallen is None
    assert platform.position[2] == pytest.approx(0.4)


def test_it_turns_with_its_ground_and_walks_on_from_there():
    """By 90 degrees in 3 s, within a degree; a walk ahead then goes along y, where it looks."""
    world, platform, robot = stands()
    before = seen_from(platform, robot)
    go(world, platform, (0.0, 0.0, 0.2), 3.0, turn=0.5 * np.pi)
    robot.sleep(3.5)
    z, w = robot.state().q[5:7]
    assert 2.0 * np.arctan2(z, w) == pytest.approx(0.5 * np.pi, abs=np.deg2rad(1.0))
    np.testing.assert_allclose(seen_from(platform, robot), before, atol=2e-3)
    start = robot.state().q[:3]
    assert robot.go_pos(0.15, 0.0, 0.0)
    x, y, _ = robot.state().q[:3] - start
    assert abs(x) < 0.02 and y == pytest.approx(0.15, abs=0.03)  # as near as its walks come on a floor
    assert robot.state().fallen is None


@pytest.mark.parametrize("newtons", [75.0, 110.0])
def test_a_push_on_ground_at_a_steady_pace_does_what_it_does_on_ground_at_rest(newtons):
    """Galileo's principle: pushed ahead for 0.2 s, it makes as many steps, and stands again where it does there."""
    found = []
    for speed in (0.0, 0.1):
        world, platform, robot = stands(size=2.0)
        start = np.array(platform.position)
        ends = world.time + np.array([0.0, 10.0])
        if speed:
            world.move(platform, nuno.Path(ends, [start, start + 10.0 * speed * np.eye(3)[0]]))
        robot.sleep(1.5)
        world.push(robot.links.bodies[0], (newtons, 0.0, 0.0), duration=0.2)
        steps = 0
        for _ in range(30):
            robot.sleep(0.1)
            step = robot.state().footing.step
            steps = steps if step is None else max(steps, step.count)
        found.append((*seen_from(platform, robot), steps))
        assert robot.state().fallen is None
    np.testing.assert_allclose(*found, atol=0.02)  # contact and rounding differ: steps land a frame earlier or later


def falls(robot):
    """Let all joints go, and return why the robot has fallen after 1.5 s, and its base's height [m]."""
    names = robot.actual.joint_names
    robot.servo(nuno.ServoCommand(names, 0.0, kd=1.0))
    robot.sleep(1.5)
    return robot.state().fallen, robot.state().q[2]


def test_a_fall_on_a_risen_platform_is_told():
    """It collapses on a platform of 0.7 m, where it lies higher than half its height above where it stood before."""
    world, platform, robot = stands(size=2.0)
    go(world, platform, (0.0, 0.0, 0.5), 1.0)
    robot.sleep(1.2)
    why, height = falls(robot)
    assert why is not None and "above its feet's ground" in why
    assert height > HEIGHT + 0.5  # [m]: it lies on the platform


def test_a_fall_on_a_rigid_lift_is_told():
    """A body that a grip lifts follows no path, but soles that lay flat on it tell how high it is."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    lift = world.add(nuno.box((2.0, 2.0, HEIGHT), name="lift", position=(0.0, 0.0, 0.5 * HEIGHT)))
    world.attach(lift, nuno.Rigid(mass=200.0))
    humanoid = nuno.Humanoid("g1")
    humanoid.stand((0.0, 0.0, HEIGHT))
    robot = nuno.SimulatedRobot(humanoid, world, dynamics=True)
    start = np.array(lift.position)
    times = world.time + np.array([0.0, 0.4, 3.4])
    world.grip(lift, to=nuno.Path(times, [start, start, start + 0.5 * np.eye(3)[2]], interpolation="minimum_jerk"))
    robot.sleep(3.6)
    assert robot.state().fallen is None
    assert robot.state().footing.rise == pytest.approx(lift.position[2] - start[2], abs=0.01)
    why, height = falls(robot)
    assert why is not None and "above its feet's ground" in why
    assert height > HEIGHT + 0.5


def test_copies_and_a_restored_robot_ride_alike():
    """To the bit; and where a world's platform goes another way, its robot goes with that."""
    world, platform, robot = stands()
    others, there = world.imagine(2), robot.state().q[:3].copy()
    start = np.array(platform.position)
    shifts = np.array([(0.0, 0.2, 0.0), (-0.2, 0.0, 0.1)])
    keys = np.stack([np.tile(start, (2, 1)), start + shifts], axis=1)
    others.move("platform", nuno.Path(others.time + np.array([0.0, 2.0]), keys, interpolation="minimum_jerk"))
    go(world, platform, (0.1, 0.0, 0.2), 1.0, turn=0.3)
    robot.sleep(0.5)
    assert_copies_go_on_alike(world, robot, 0.8)
    others.run(2.5)
    for state, shift in zip(others.robot.state(), shifts, strict=True):
        assert state.fallen is None
        np.testing.assert_allclose(state.q[:3] - there, shift, atol=3e-3)


def test_a_ride_leads_what_is_wanted_to_where_the_ground_has_gone():
    """A quarter turn about the origin and 1 m up: the base turns about it, and its joints stay."""
    ride = Ride(np.array([0.0, 0.0, 1.0]), 0.5 * np.pi, np.zeros(3), np.zeros(3), 0.2, np.zeros(3))
    q = ride.carried(np.array([1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.3]))
    np.testing.assert_allclose(q, (0.0, 1.0, 1.5, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5), 0.3), atol=1e-12)
    np.testing.assert_allclose(ride.speeds(np.array([0.5, 0.0, 0.0])), (0.0, 0.1, 0.0))
