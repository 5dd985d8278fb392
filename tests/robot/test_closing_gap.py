"""Fingers without dynamics: how far they close on what is between them, by shape, material and force."""

import numpy as np
import pytest
from lifter import cube_in, lifter_in

import nuno


def closed_on(folder, body, material, effort=25.0):
    """Return the width [m] to which a hand without dynamics closes on a body, whether it says it holds it, the hand."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    robot = lifter_in(folder, world)
    world.attach(world.add(body), material)
    told = robot.start_grasp("rarm", effort=effort)
    return robot.hands["right_hand"].width, told, robot


def test_on_nothing_they_meet(tmp_path):
    """The pads meet where nothing is between them, and the hand tells that it holds nothing."""
    robot = lifter_in(tmp_path, nuno.World(device="cpu"))
    links = [robot.links.bodies[robot.links.names.index(name)] for name in ("a", "b")]
    assert links[0].vertices[:, 1].min() - links[1].vertices[:, 1].max() == pytest.approx(0.08, abs=1e-9)
    assert robot.start_grasp("rarm") == [False]
    assert links[0].vertices[:, 1].min() - links[1].vertices[:, 1].max() == pytest.approx(0.0, abs=1e-6)


def test_a_rigid_body_stops_them_at_its_faces(tmp_path):
    """The pads stop 0.05 m apart on a cube of 0.05 m, hold it, and say what stopped them."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world)
    cube, kept = cube_in(world)
    assert robot.start_grasp("rarm") == [True]
    kept.release()
    hand = robot.hands["right_hand"]
    links = [robot.links.bodies[robot.links.names.index(name)] for name in ("a", "b")]
    assert links[0].vertices[:, 1].min() - links[1].vertices[:, 1].max() == pytest.approx(0.05, abs=1e-6)
    assert hand.held == (cube,) and "stopped: cube" in robot.grippers["right_hand"].goal.text
    robot.angle_vector({"lift": 0.5}, 1.0)
    robot.wait_interpolation()
    np.testing.assert_allclose(cube.position, (0.0, 0.0, 1.5), atol=1e-4)
    assert robot.start_grasp("rarm") == [True] and hand.held == (cube,)  # closing again keeps hold
    assert robot.stop_grasp("rarm") == [True] and hand.held == ()


def test_a_turned_cube_is_thicker(tmp_path):
    """Turned by 45 degrees about the vertical: its diagonal is between the pads, to the spacing of the lines."""
    body = nuno.box((0.04,) * 3, position=(0, 0, 1), quaternion=(np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)))
    width, told, _ = closed_on(tmp_path, body, nuno.Rigid(mass=0.1))
    assert told == [True] and width == pytest.approx(0.04 * np.sqrt(2.0), abs=0.03 / 9)


@pytest.mark.parametrize(("effort", "strain"), [(3.0, 0.2), (6.0, 0.4), (1e3, 0.6)])
def test_a_soft_body_gives_way_to_the_force(tmp_path, effort, strain):
    """F / (E A) of its thickness, A the pads' 0.03 x 0.04 m; no more than 0.6."""
    body = nuno.soft_box((0.06, 0.05, 0.06), cells=(3, 3, 3), position=(0, 0, 1))
    width, told, _ = closed_on(tmp_path, body, nuno.Soft(youngs_modulus=12500.0, density=100.0), effort)
    assert told == [True] and width == pytest.approx(0.05 * (1.0 - strain), rel=1e-3)


@pytest.mark.parametrize("layers", [1, 2])
def test_a_cloth_stays_between_as_thick_as_it_is(tmp_path, layers):
    """A layer of 4 mm, or two of a cloth that is folded: the pads stop there, and it is between them."""
    body = nuno.sheet((0.1, 0.1), (20, 20), position=(0, 0, 1), quaternion=(np.sqrt(0.5), np.sqrt(0.5), 0, 0))
    if layers == 2:
        x = nuno.sheet((0.1, 0.2), (20, 40)).vertices[:, :2]
        folded = np.stack([x[:, 0], np.where(x[:, 1] > 0.0, 0.002, -0.002), 1.05 - np.abs(x[:, 1])], axis=1)
        sheet = nuno.sheet((0.1, 0.2), (20, 40))
        world = nuno.World(device="cpu", gravity=(0, 0, 0))
        robot = lifter_in(tmp_path, world)
        world.attach(world.add(sheet), nuno.Cloth(thickness=4e-3))
        world.set_vertices(sheet, folded)
        told, width = robot.start_grasp("rarm"), robot.hands["right_hand"].width
        body = sheet
    else:
        width, told, robot = closed_on(tmp_path, body, nuno.Cloth(thickness=4e-3))
    assert told == [True] and width == pytest.approx(4e-3 * layers, abs=1e-6)
    links = [robot.links.bodies[robot.links.names.index(name)] for name in ("a", "b")]
    held = body.vertices[robot.hands["right_hand"].grips[0].spec.vertices[0]]
    assert held[:, 1].max() < links[0].vertices[:, 1].min() and held[:, 1].min() > links[1].vertices[:, 1].max()


def test_imagined_fingers_close_too(tmp_path):
    """In imagined worlds the tips go with the hand's joint, each world's with its own."""
    world = nuno.World(device="cpu")
    lifter_in(tmp_path, world)
    futures = world.imagine(2)
    futures.robot.angle_vector({"turn": [0.0, -0.25]}, 0.3)
    futures.run(0.4)
    tips = [futures.find(name).position[:, 1] for name in ("lifter/a", "lifter/b")]
    np.testing.assert_allclose(tips[0] - tips[1], (0.09, 0.05), atol=1e-6)
