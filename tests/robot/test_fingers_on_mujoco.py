"""Hands of robots with dynamics on MuJoCo: they press, lift, let slip and keep as on Nuno's own engine."""

import numpy as np
import pytest
from lifter import PEAK, G, cube_in, height, lift, lifter_in
from swung_cube import SwungCube

import nuno

pytest.importorskip("mujoco", minversion="4.0")

MU = np.sqrt(0.8 * 0.5)  # of a cube with 0.5 on links with 0.8
MASS = 0.5


@pytest.fixture
def scene(tmp_path):
    """A world with a lifter, and a cube that a grip keeps between its open fingers."""
    world = nuno.World(device="cpu", engine="mujoco")
    robot = lifter_in(tmp_path, world, dynamics=True)
    cube, kept = cube_in(world, mass=MASS)
    return world, robot, cube, kept


def bound(acceleration=0.0):
    """Return the force [N] of the fingers at which the cube begins to slide."""
    return MASS * (G + acceleration) / (2.0 * MU)


def test_closing_on_nothing_tells_so(tmp_path):
    """The fingers meet, without pressing on anything; opened, they are as far apart as they were."""
    world = nuno.World(device="cpu", engine="mujoco")
    robot = lifter_in(tmp_path, world, dynamics=True)
    hand = robot.hands["right_hand"]
    assert robot.start_grasp("rarm", effort=5.0) == [False]
    assert hand.width == pytest.approx(0.0, abs=1e-4) and hand.held == ()
    assert robot.stop_grasp("rarm") == [True]
    assert hand.width == pytest.approx(0.08, abs=1e-3)


@pytest.mark.parametrize(("effort", "force"), [(10.0, 10.0), (1e4, 20.0 * 0.5 / 0.08)])
def test_fingers_press_with_the_effort_that_was_asked_for(scene, effort, force):
    """They stop at the cube's faces; each presses with the effort, up to what the joint's torque makes of it."""
    _, robot, cube, _ = scene
    hand = robot.hands["right_hand"]
    assert robot.start_grasp("rarm", effort=effort) == [True]
    robot.sleep(0.1)
    contacts = robot.state().contacts
    for link in ("a", "b"):
        assert abs(contacts[link]["cube"][1]) == pytest.approx(force, rel=0.02)
    assert hand.width == pytest.approx(0.05, abs=1e-3) and hand.held == (cube,)


@pytest.mark.long
def test_a_cube_is_lifted_by_friction_alone(scene):
    """0.5 m up in 1 s with 1.2 times the bound's force: it slides by less than 0.2 mm, and the wrist bears it."""
    _, robot, cube, kept = scene
    empty = robot.read().wrenches["right_wrist"][2]
    assert robot.start_grasp("rarm", effort=1.2 * bound(PEAK)) == [True]
    kept.release()
    assert lift(robot, height(cube), mass=1.01 + MASS) < 2e-4
    robot.sleep(0.3)
    assert robot.hands["right_hand"].held == (cube,)
    assert empty - robot.read().wrenches["right_wrist"][2] == pytest.approx(MASS * G, rel=0.02)


@pytest.mark.long
def test_a_cube_slips_where_friction_is_too_small(scene):
    """With 0.8 times the force that its weight takes it slides down by (1 - 0.8) g t^2 / 2, and out of the hand."""
    world, robot, cube, kept = scene
    robot.servo(nuno.ServoCommand(("lift",), q=0.0, kp=1e4, dq=0.0, kd=300.0, tau=1.01 * G))
    assert robot.start_grasp("rarm", effort=0.8 * bound()) == [True]
    kept.release()
    start = height(cube)(robot)
    world.run(0.1)
    assert start - height(cube)(robot) == pytest.approx(0.5 * 0.2 * G * 0.1**2, rel=0.1)
    world.run(0.5)
    assert start - height(cube)(robot) > 0.1 and robot.hands["right_hand"].held == ()


@pytest.mark.long
def test_what_is_held_is_imagined_and_dynamics_come_and_go(scene):
    """Imagined hands keep the cube and lift it; detached and attached, the hand holds it; opened, it falls."""
    world, robot, cube, kept = scene
    robot.start_grasp("rarm", effort=30.0)
    kept.release()
    start = height(cube)(robot)
    futures = world.imagine(2)
    futures.robot.angle_vector({"lift": [0.0, 0.1]}, 0.3)
    futures.run(0.5)
    np.testing.assert_allclose(futures.find("cube").position[:, 2], (1.0, 1.1), atol=0.02)
    robot.detach()
    assert [grip.body for grip in robot.hands["right_hand"].grips] == [cube]
    robot.angle_vector({"lift": 0.2}, 0.5)
    robot.wait_interpolation()
    robot.attach()
    world.run(0.5)
    assert robot.hands["right_hand"].held == (cube,)
    assert height(cube)(robot) == pytest.approx(start, abs=5e-4)
    robot.stop_grasp("rarm")
    world.run(0.2)
    assert start - height(cube)(robot) > 0.1


@pytest.mark.slow
def test_talos_lifts_a_cube_with_its_fingers():
    """Its arm swings 0.2 kg by 0.4 m in 1 s between the tips of its gripper, and the cube is held.

    MuJoCo's friction creeps under load: 1.5 mm along the fingers here, where 0.1 mm is Nuno's.
    """
    swung = SwungCube(nuno.World(device="cpu", engine="mujoco"))
    assert swung.swing().max() < 2e-3
    assert swung.is_held()
    assert swung.let_go() > 0.05
