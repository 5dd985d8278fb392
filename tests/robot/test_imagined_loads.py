"""Copies under a servo command feel what they hold, as the robot does."""

import numpy as np
import pytest
from lifter import G, lifter_in

import nuno

STIFFNESS = 400.0
"""[N/m] Of the slide's servo law."""
LIFTED = 0.01 + 0.9 + 2 * 0.05
"""[kg] What the slide carries: crank, palm and fingers."""
CUBE = 0.5
"""[kg]"""


@pytest.fixture
def room(tmp_path):
    """A lifter without dynamics that grips a cube, its slide held by a spring law."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, fingers=False)
    cube = world.add(nuno.box((0.05,) * 3, name="cube", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=CUBE))
    support = world.grip(cube, to=cube.position)
    robot.start_grasp("rarm")
    support.release()
    robot.servo(nuno.ServoCommand(("lift",), q=0.0, kp=STIFFNESS, kd=40.0))
    return world, robot


def test_copies_sag_by_what_they_carry(room):
    """By m g / k, as the robot's own slide does; where a copy lets go, by the palm's weight alone."""
    world, robot = room
    futures = world.imagine(2)
    futures.robot.stop_grasp("rarm", worlds=1)
    for own in (world, futures):
        own.run(2.0)
    row = robot.actual.joint_index("lift")
    carrying, empty = futures.robot.angle_vector()[:, row]
    assert carrying == pytest.approx(-(LIFTED + CUBE) * G / STIFFNESS, rel=1e-3)
    assert empty == pytest.approx(-LIFTED * G / STIFFNESS, rel=1e-3)
    assert robot.actual.angle_vector()[row] == pytest.approx(carrying, rel=1e-4)


def test_copies_feel_it_on_the_way(room):
    """All of the motion is that of the robot, to the bit."""
    world, robot = room
    robot.sleep(1.5)
    robot.servo(nuno.ServoCommand(("lift",), q=0.1, kp=STIFFNESS, kd=40.0))
    futures, row = world.imagine(1), robot.actual.joint_index("lift")
    heights = []
    for _ in range(30):
        world.step()
        futures.step()
        heights.append((robot.actual.angle_vector()[row], futures.robot.angle_vector()[0, row]))
    own, imagined = np.transpose(heights)
    np.testing.assert_array_equal(imagined, own)
    assert np.ptp(own) > 0.05


def gripped_cube(world, palm):
    """Let the palm carry a cube that a program gripped to it."""
    cube = world.add(nuno.box((0.05,) * 3, name="load", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=CUBE))
    world.grip(cube, to=palm)
    return cube


def gripped_towel(world, palm):
    """Let a towel hang from the palm, which it touches besides."""
    towel = world.add(nuno.sheet((0.1, 0.1), (6, 6), name="load", position=(0.0, 0.0, 1.0)))
    world.attach(towel)
    world.grip(towel, [0, 5], to=palm)
    return towel


def lying_cube(world, palm):
    """Lay a cube on the palm."""
    cube = world.add(nuno.box((0.05,) * 3, name="load", position=(0.0, 0.0, 1.14)))
    world.attach(cube, nuno.Rigid(mass=CUBE))
    return cube


def lying_towel(world, palm):
    """Let a towel fall on the palm."""
    towel = world.add(nuno.sheet((0.3, 0.3), (10, 10), name="load", position=(0.0, 0.0, 1.15)))
    world.attach(towel)
    return towel


@pytest.mark.parametrize("carry", [gripped_cube, gripped_towel, lying_cube, lying_towel])
def test_what_is_felt_goes_along(tmp_path, carry):
    """A world that is restored, imagined or adopted, under a servo command or before one, goes on to the bit."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, fingers=False)
    load = carry(world, next(body for body in robot.links.bodies if "palm" in body.name))
    row = robot.actual.joint_index("lift")

    def after(seconds=0.1, command=True):
        if command:
            robot.servo(nuno.ServoCommand(("lift",), q=0.05, kp=STIFFNESS, kd=40.0))
        world.run(seconds)
        return np.concatenate([robot.state().q, robot.state().v, load.vertices.ravel()])

    world.run(0.3)
    kept = world.save()
    expected = after()
    world.restore(kept)
    np.testing.assert_array_equal(after(), expected)  # what a command that comes first feels
    assert robot.actual.angle_vector()[row] != 0.0

    kept, futures = world.save(), world.imagine(2)
    expected = after(command=False)
    world.restore(kept)
    np.testing.assert_array_equal(after(command=False), expected)
    world.gravity = world.gravity  # which makes the world anew
    later = after(command=False)
    futures.run(0.1)
    copies = futures.save()
    futures.run(0.1)
    shapes = futures.find("load").vertices
    found = [np.concatenate([own.q, own.v, x.ravel()]) for own, x in zip(futures.robot.state(), shapes, strict=True)]
    np.testing.assert_array_equal(found, [later, later])
    futures.restore(copies)
    world.adopt(futures, 1)
    np.testing.assert_array_equal(after(command=False), later)


def test_the_load_of_a_grip_that_is_released_goes_at_once(room):
    """So a hand that opens after a restore lets the slide spring up as it did."""
    world, robot = room
    robot.sleep(1.5)
    kept = world.save()
    robot.stop_grasp("rarm")
    expected = robot.state().q.copy()
    world.restore(kept)
    robot.stop_grasp("rarm")
    np.testing.assert_array_equal(robot.state().q, expected)


def test_asking_for_contacts_changes_nothing_after_a_restore(tmp_path):
    """A towel that a moving palm leads goes on as if nobody had asked: until now it jumped by millimetres."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, fingers=False)
    towel = gripped_towel(world, next(body for body in robot.links.bodies if "palm" in body.name))
    world.run(0.3)
    robot.angle_vector({"lift": 0.1}, 0.5)
    world.run(0.2)
    kept = world.save()
    world.run(0.1)
    expected = towel.vertices.copy()
    for asks in (False, True):
        world.restore(kept)
        if asks:
            world.contacts(towel)
        world.run(0.1)
        np.testing.assert_array_equal(towel.vertices, expected)
