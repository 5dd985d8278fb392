"""What a hand holds as its robot loses dynamics, gets them, and is read from a file: it stays held."""

import logging

import numpy as np
import pytest
from lifter import G, lifter_in

import nuno
from nuno.joints.held_points import held_points

PALM = 1.01
"""[kg] Beyond the wrist: the palm, the crank and the fingers."""
CUBE = 0.2
"""[kg]"""


def room(folder, fingers, dynamics=True):
    """A lifter whose hand is closed on a cube, by grip or by friction."""
    world = nuno.World(device="cpu")
    robot = lifter_in(folder, world, fingers=fingers, dynamics=dynamics)
    cube = world.add(nuno.box((0.05,) * 3, name="cube", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=CUBE, friction=0.8))
    support = world.grip(cube, to=cube.position)
    robot.start_grasp("rarm")
    support.release()
    robot.sleep(0.2)
    return world, robot, cube


def assert_held(robot, cube, height):
    """The hand has the cube, at rest where it was, and its wrist bears both weights."""
    robot.sleep(0.4)
    assert [body.name for body in robot.hands["right_hand"].held] == ["cube"]
    assert cube.position[2] == pytest.approx(height, abs=2e-3)  # the palm sinks by its weight on its motor: 0.6 mm
    np.testing.assert_allclose(cube.velocity, 0.0, atol=1e-3)
    assert robot.read().wrenches["right_wrist"][2] == pytest.approx(-(PALM + CUBE) * G, rel=1e-3)


@pytest.mark.parametrize("fingers", [False, True], ids=["gripping", "pressing"])
def test_a_hand_holds_on_as_dynamics_come_and_go(tmp_path, fingers):
    """Twice there and back."""
    _, robot, cube = room(tmp_path, fingers)
    height = cube.position[2]
    for change in (robot.detach, robot.attach, robot.detach, robot.attach):
        change()
        assert_held(robot, cube, height)


@pytest.mark.parametrize("fingers", [False, True], ids=["gripping", "pressing"])
@pytest.mark.parametrize("dynamics", [True, False], ids=["dynamic", "kinematic"])
def test_a_hand_of_another_process_holds_what_the_files_hand_held(tmp_path, fingers, dynamics):
    """The robot there had dynamics, that of this program has them too, or has none."""
    world, _, cube = room(tmp_path, fingers)
    world.save(tmp_path / "room.npz")
    here = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, here, fingers=fingers, dynamics=True)
    if not dynamics:
        robot.detach()
    own = here.add(nuno.box((0.05,) * 3, name="cube", position=(3.0, 0.0, 0.0)))
    here.restore(tmp_path / "room.npz")
    assert robot.is_dynamic == dynamics
    assert_held(robot, own, cube.position[2])


def test_an_open_hand_of_a_file_stays_open(tmp_path):
    """A cube that is between its fingers and touches one of them at most is not held."""
    world = nuno.World(device="cpu")
    lifter_in(tmp_path, world, dynamics=True)
    cube = world.add(nuno.box((0.05,) * 3, name="cube", position=(0.0, 0.01, 1.0)))
    world.attach(cube, nuno.Rigid(mass=CUBE))
    world.grip(cube, to=cube.position)
    world.run(0.1)
    world.save(tmp_path / "room.npz")
    here = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, here, dynamics=True)
    here.restore(tmp_path / "room.npz")
    robot.sleep(0.3)
    assert robot.hands["right_hand"].held == ()
    assert robot.hands["right_hand"].width == pytest.approx(0.08, abs=1e-3)


@pytest.mark.parametrize("cells", [8, 1], ids=["vertices", "surface"])
def test_cloth_is_held_at_the_same_points(tmp_path, cells):
    """Vertices, or, of a coarse one, points of its surface: they are where they were in the hand."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, fingers=False, dynamics=True)
    towel = world.add(nuno.sheet((0.2, 0.2), (cells, cells), name="towel", position=(0.0, 0.0, 1.0)))
    world.attach(towel)
    robot.start_grasp("rarm")
    robot.sleep(0.2)
    (before,) = robot.hands["right_hand"].grips
    points = held_points(before)
    robot.detach()
    (after,) = robot.hands["right_hand"].grips
    np.testing.assert_allclose(held_points(after), points, atol=1e-9)
    robot.angle_vector({"lift": 0.1}, 0.5)
    robot.sleep(0.7)
    np.testing.assert_allclose(held_points(after) - (0.0, 0.0, 0.1), points, atol=2e-3)  # it had sunk by less


def test_what_a_program_gripped_to_a_link_is_told_as_it_is_let_go(tmp_path, caplog):
    """By name, once, and what the hand holds is not among it."""
    world, robot, cube = room(tmp_path, fingers=False)
    ball = world.add(nuno.sphere(0.02, name="ball", position=(0.0, 0.3, 1.1)))
    world.attach(ball, nuno.Rigid(mass=0.1))
    world.grip(ball, to=robot.hands["right_hand"].body)
    with caplog.at_level(logging.WARNING):
        robot.detach()
    (record,) = caplog.records
    assert "'ball' by 'lifter/palm'" in record.getMessage()
    assert "cube" not in record.getMessage()
    assert robot.hands["right_hand"].held == (cube,)
