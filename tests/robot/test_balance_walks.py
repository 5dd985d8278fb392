"""Balance of whole robots: pushes, loads, uneven ground, falls; bounds of the inverted pendulum."""

import math

import numpy as np
import pytest

import nuno
from nuno.robot.robot_model import standing_place

G = 9.81


def standing(name):
    """A world with a floor, and a robot that stands in it."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid(name), world, dynamics=True)
    robot.sleep(0.5)
    return world, robot


@pytest.fixture(scope="module", params=["talos", pytest.param("g1", marks=pytest.mark.long)])
def stood(request):
    """A robot after 0.5 s, with a snapshot."""
    world, robot = standing(request.param)
    return world, robot, world.save()


PUSHED = pytest.mark.parametrize("stood", ["talos", pytest.param("g1", marks=pytest.mark.slow)], indirect=True)
"""One robot is pushed by long tests, the other by slow ones."""


def front_bound(robot):
    """The impulse [N s] that brings the capture point to the soles' front edge: m w d, w = sqrt(g / h)."""
    actual = robot.actual
    centre = actual.centre_of_mass
    ahead = actual.support_polygon()[:, 0].max() - centre[0]
    return actual.mass * math.sqrt(G / centre[2]) * ahead


def push(world, robot, impulse, way=(1.0, 0.0, 0.0)):
    """Push the base for 0.05 s."""
    world.push(robot.links.bodies[0], np.array(way) * impulse / 0.05, duration=0.05)


def test_the_floor_bears_the_weight_and_is_told(stood):
    """Both feet touch, nothing else does, and the forces add up to the weight within 1 %."""
    world, robot, saved = stood
    world.restore(saved)
    robot.sleep(0.1)
    contacts = robot.state().contacts
    ankles = {robot.links.names[robot.links.joints.index(robot.actual.model.frames[f].parentJoint)]
              for f in map(robot.actual.frame_index, robot.actual.feet)}  # fmt: skip
    assert set(contacts) == ankles
    pressed = [force[2] for own in contacts.values() for force in own.values()]
    assert sum(pressed) == pytest.approx(robot.actual.mass * G, rel=0.01)


@pytest.mark.long
@PUSHED
def test_below_the_capture_bound_its_feet_stay(stood):
    """0.7 m w d ahead: ankles are enough, no foot is lifted, and it stands where it stood within 5 mm."""
    world, robot, saved = stood
    world.restore(saved)
    start = standing_place(robot.actual)
    push(world, robot, 0.7 * front_bound(robot))
    for _ in range(120):
        world.step()
        assert robot.state().footing.step is None
    assert robot.state().fallen is None
    assert np.abs(np.subtract(standing_place(robot.actual), start))[:2].max() < 5e-3


@pytest.mark.long
def test_past_the_capture_bound_it_steps_and_stands():
    """Talos, 40 N s ahead, 1.25 times m w d: it makes a step ahead and comes to rest there."""
    world, robot = standing("talos")
    assert 40.0 > 1.2 * front_bound(robot)
    push(world, robot, 40.0)
    feet = set()
    for _ in range(240):
        world.step()
        assert robot.state().fallen is None
        step = robot.state().footing.step
        if step is not None:
            feet.add(step.foot)
    assert feet and robot.state().footing.step is None
    assert standing_place(robot.actual)[0] > 0.05
    assert np.abs(robot.state().v).max() < 0.1


@pytest.mark.long
@PUSHED
def test_far_past_it_falls_says_so_and_is_set_up(stood, caplog):
    """3 N s a kilogram: it falls, says when and why, lies on more than its feet, and stands again when set up."""
    world, robot, saved = stood
    world.restore(saved)
    push(world, robot, 3.0 * robot.actual.mass)
    world.run(2.0)
    state = robot.state()
    assert state.fallen is not None and "at t = " in state.fallen
    assert any("fell" in record.message for record in caplog.records)
    assert len(set(state.contacts)) >= 1 and state.footing is None
    robot.set_up((1.0, 0.0, 0.0), 0.5)
    world.run(0.5)
    x, y, yaw = standing_place(robot.actual)
    assert robot.state().fallen is None and robot.state().over_torque == ()
    np.testing.assert_allclose((x, y, yaw), (1.0, 0.0, 0.5), atol=0.01)


@pytest.mark.slow
def test_it_walks_over_a_board(stood):
    """A board of 1 cm in the way, wider than the stance: up, over and down again, to 2 cm of the goal."""
    name = stood[1].actual.name
    world, robot = standing(name)
    world.add(nuno.box((0.25, 0.9, 0.01), position=(0.35, 0.0, 0.005), name="board"))
    goal = robot.send_base(0.6, 0.0, 0.0, None, True)
    highest = 0.0
    while not goal.is_done and robot.state().fallen is None:
        world.step()
        feet = [robot.actual.frame_pose(foot).position[2] for foot in robot.actual.feet]
        highest = max(highest, min(feet))
    assert robot.state().fallen is None
    # Both feet stood on it, or one did while the other was in the air. Of the four balls by which a sole of G1's
    # touches, two are on the board and two before or behind it: its middle is half as high.
    assert highest > {"talos": 0.008, "g1": 0.0045}[name]
    x, y, _ = standing_place(robot.actual)
    assert np.hypot(x - 0.6, y) < 0.02


@pytest.mark.slow
def test_a_mat_on_the_arms_is_weighed_and_carried():
    """5 kg of foam on Talos' forearms: known to balance within 15 %, in the plan of the walk, and still there after."""
    world, robot = standing("talos")
    robot.angle_vector({"arm_left_4_joint": -1.8, "arm_right_4_joint": -1.8}, 0.8)
    robot.wait_interpolation()
    arms = [body for body, link in zip(robot.links.bodies, robot.links.names, strict=True) if "left_5" in link]
    top = max(float(body.vertices[:, 2].max()) for body in arms)
    mat = world.add(nuno.soft_box((0.3, 1.0, 0.04), (4, 12, 1), name="mat", position=(0.2, 0.0, top + 0.03)))
    world.attach(mat, nuno.Soft(youngs_modulus=1e6, density=5.0 / 0.012, friction=0.8))
    robot.sleep(1.5)
    load = robot.balance.load(robot.state())
    assert load.mass == pytest.approx(5.0, rel=0.15)
    np.testing.assert_allclose(load.place[:2], mat.vertices.mean(axis=0)[:2], atol=0.06)
    assert robot.go_pos(0.3, 0.0, 0.0)
    assert robot.state().fallen is None
    assert mat.vertices[:, 2].min() > 0.9
    x, y, _ = standing_place(robot.actual)
    assert np.hypot(x - 0.3, y) < 0.02
