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
    """All of the motion is that of the robot, but for the first frame, in which a copy's grip has told of nothing."""
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
    # without the cube's weight for a frame, 1.5 kg come to g t m / M = 0.05 m/s, which the law damps within 2 mm
    np.testing.assert_allclose(imagined, own, atol=3e-3)
    assert np.ptp(own) > 0.05
