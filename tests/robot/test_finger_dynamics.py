"""Hands of robots with dynamics: fingers that press with what was asked for, and hold by friction or do not."""

import numpy as np
import pytest
from lifter import PEAK, G, cube_in, height, lift, lifter_in
from swung_cube import SwungCube

import nuno
from nuno.robot.finger_dynamics import AHEAD

MU = np.sqrt(0.8 * 0.5)  # of a cube with 0.5 on links with 0.8
MASS = 0.5


@pytest.fixture
def scene(tmp_path):
    """A world with a lifter, and a cube that a grip keeps between its open fingers."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=True)
    cube, kept = cube_in(world, mass=MASS)
    return world, robot, cube, kept


def bound(acceleration=0.0):
    """Return the force [N] of the fingers at which the cube begins to slide."""
    return MASS * (G + acceleration) / (2.0 * MU)


def test_closing_on_nothing_tells_so(tmp_path):
    """The fingers meet, without pressing on anything; opened, they are as far apart as they were."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=True)
    hand = robot.hands["right_hand"]
    assert robot.start_grasp("rarm", effort=5.0) == [False]
    assert hand.width == pytest.approx(0.0, abs=1e-4) and hand.held == ()
    assert robot.stop_grasp("rarm") == [True]
    assert hand.width == pytest.approx(0.08, abs=1e-3)


def test_fingers_press_with_the_effort_that_was_asked_for(scene):
    """They stop at the cube's faces; each presses with the effort, up to what the joint's torque makes of it."""
    _, robot, cube, _ = scene
    hand = robot.hands["right_hand"]
    most = 20.0 * 0.5 / 0.08  # [N], the joint's work over the fingers' way
    for effort, force in ((10.0, 10.0), (30.0, 30.0), (1e4, most)):
        assert robot.start_grasp("rarm", effort=effort) == [True]
        robot.sleep(0.1)
        contacts = robot.state().contacts
        for link in ("a", "b"):
            assert abs(contacts[link]["cube"][1]) == pytest.approx(force, rel=0.02)
        assert hand.width == pytest.approx(0.05, abs=5e-4) and hand.held == (cube,)
    assert robot.move_gripper("rarm", 0.0, effort=5.0) == [False]  # it did not get there
    assert "cube" in robot.grippers["right_hand"].goal.text


def test_a_cube_is_lifted_by_friction_alone(scene):
    """0.5 m up in 1 s with 1.2 times the bound's force: it slides by less than 0.2 mm, and the wrist bears it."""
    _, robot, cube, kept = scene
    empty = robot.read().wrenches["right_wrist"][2]
    assert robot.start_grasp("rarm", effort=1.2 * bound(PEAK)) == [True]
    kept.release()
    assert lift(robot, height(cube), mass=1.01 + MASS) < 2e-4
    assert robot.state().q[robot.actual.model.joints[2].idx_q] == pytest.approx(0.5, abs=0.02)
    robot.sleep(0.3)
    assert robot.hands["right_hand"].held == (cube,)
    assert empty - robot.read().wrenches["right_wrist"][2] == pytest.approx(MASS * G, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "share"),
    [
        ("towel", 1.2), ("mat", 0.8), pytest.param("towel", 0.8, marks=pytest.mark.slow),
        pytest.param("mat", 1.2, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_towels_edge_and_a_mats_corner_are_lifted_by_friction_alone(tmp_path, kind, share):
    """0.5 m up in 1 s: with 1.2 times the bound's force they slide by less than 0.5 mm, with 0.8 times out."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=True)
    if kind == "towel":
        upright = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
        body = nuno.sheet((0.2, 0.2), (20, 20), position=(0, 0, 0.92), quaternion=upright)
        mass, material = 0.4 * 0.04, nuno.Cloth(area_density=0.4, friction=0.5, damping=0.02)
    else:
        corner = (np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0)
        low = 1.03 - 0.1 * np.sqrt(2.0)
        body = nuno.soft_box((0.2, 0.02, 0.2), (10, 2, 10), position=(0, 0, low), quaternion=corner)
        mass = 200.0 * 0.04 * 0.02
        material = nuno.Soft(youngs_modulus=1e5, poisson_ratio=0.3, density=200.0, friction=0.5, damping=0.05)
    world.attach(world.add(body), material)
    local = body.vertices - (0.0, 0.0, 1.0)
    between = np.flatnonzero((np.abs(local[:, [0, 2]]) < 0.02).all(axis=1))

    def height(robot):
        return body.vertices[between, 2].mean() - robot.actual.frame_pose("right_hand").position[2]

    rest = world.add(nuno.box((0.5, 0.3, 0.01), position=(0, 0, body.vertices[:, 2].min() - 0.0055)))
    robot.servo(nuno.ServoCommand(("lift",), q=0.0, kp=1e4, dq=0.0, kd=300.0, tau=1.01 * G))
    assert robot.start_grasp("rarm", effort=share * mass * (G + PEAK) / (2.0 * MU)) == [True]
    assert robot.hands["right_hand"].held == (body,)
    world.remove(rest)
    world.run(0.1)  # what stood on it hangs now
    slid = lift(robot, height, mass=1.01 + mass)
    held = robot.hands["right_hand"].held
    assert (slid < 5e-4 and held == (body,)) if share > 1.0 else (slid > 0.1 and held == ())


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


def test_what_is_held_is_restored_imagined_and_adopted(scene):
    """With a cube in the closed hand: the same bits again, in imagined worlds too, and it is still held after those."""
    world, robot, cube, kept = scene
    robot.start_grasp("rarm", effort=30.0)
    kept.release()
    saved, hand, futures = world.save(), robot.hands["right_hand"], world.imagine(2)
    futures.run(0.2)
    world.run(0.2)
    np.testing.assert_array_equal(futures.find("cube").position, [cube.position] * 2)
    world.restore(saved)
    assert hand.held == (cube,)
    futures.robot.angle_vector({"lift": [0.0, 0.1]}, 0.3)
    futures.run(0.5)
    heights = futures.find("cube").position[:, 2]
    assert heights[0] == pytest.approx(1.0, abs=0.02) and heights[1] == pytest.approx(1.1, abs=0.02)
    world.adopt(futures, 1)
    assert world.find("cube").position[2] == heights[1]
    world.run(0.2)
    assert [body.name for body in hand.held] == ["cube"]
    assert world.find("cube").position[2] == pytest.approx(heights[1], abs=2e-3)


def test_dynamics_come_and_go_with_something_in_the_hand(scene):
    """Detached, the hand grips what it pressed on; attached, it presses on it again; opened, it lets it fall."""
    world, robot, cube, kept = scene
    robot.start_grasp("rarm", effort=30.0)
    kept.release()
    start = height(cube)(robot)
    robot.detach()
    hand = robot.hands["right_hand"]
    assert [grip.body for grip in hand.grips] == [cube]
    robot.angle_vector({"lift": 0.2}, 0.5)
    robot.wait_interpolation()
    assert height(cube)(robot) == pytest.approx(start, abs=1e-4)
    robot.attach()
    world.run(0.5)
    assert hand.grips == () and hand.held == (cube,)
    assert height(cube)(robot) == pytest.approx(start, abs=5e-4)
    robot.stop_grasp("rarm")
    world.run(0.2)
    assert start - height(cube)(robot) > 0.1


def test_detached_fingers_are_where_the_joints_say(scene):
    """A cube 6 mm aside pushed both fingers aside by more than 1 mm; their links' poses tell where they are then."""
    world, robot, cube, kept = scene
    kept.release()
    world.grip(cube, to=np.add(cube.position, (0.0, 0.006, 0.0)))
    robot.start_grasp("rarm", effort=30.0)

    def aside():
        places, turns = robot.links.poses()
        assert len(places) == len(robot.links.bodies)
        return max(
            np.linalg.norm(body.position - place) + np.linalg.norm(body.quaternion - turn)
            for body, place, turn in zip(robot.links.bodies, places, turns, strict=True)
        )

    assert aside() > 1e-3  # [m]
    robot.detach()
    assert aside() < 1e-12  # doubles
    world.run(0.1)
    assert aside() < 1e-12


def test_a_vector_of_all_angles_does_not_loosen_it(scene):
    """Angles as they are now, sent to all joints: the closed hand presses on; wanted open by its joint, it opens."""
    world, robot, _, kept = scene
    robot.start_grasp("rarm", effort=30.0)
    kept.release()
    robot.angle_vector(robot.angle_vector(), 0.2)
    robot.wait_interpolation()
    world.run(0.2)
    assert abs(robot.state().contacts["a"]["cube"][1]) == pytest.approx(30.0, rel=0.02)
    robot.angle_vector({"turn": 0.0}, 0.5)
    robot.wait_interpolation()
    assert robot.hands["right_hand"].held == ()


@pytest.mark.parametrize("dynamics", [False, True])
def test_a_vector_that_opens_the_fingers_lets_go_and_says_so(tmp_path, caplog, dynamics):
    """With the hand's joint at 0, open, the cube falls freely, with and without dynamics; a warning names all once."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world, dynamics=dynamics)
    cube, kept = cube_in(world, mass=MASS)
    hand = robot.hands["right_hand"]
    assert robot.start_grasp("rarm", effort=30.0) == [True]
    kept.release()
    robot.angle_vector({"lift": 0.05}, 0.5)  # the joint that closes the hand stays as it is
    robot.wait_interpolation()
    assert hand.held == (cube,) and not caplog.records
    held = cube.position[2]
    robot.angle_vector({"turn": 0.0}, 0.5)
    robot.wait_interpolation()
    assert hand.held == () and hand.grips == () and hand.width == pytest.approx(0.08, abs=1e-3)
    robot.sleep(0.3)
    assert held - cube.position[2] > 0.5 * G * 0.3**2  # [m] of free fall, which began before
    (record,) = caplog.records
    assert all(part in record.getMessage() for part in ("right_hand", "cube", "'turn'", "controller_type"))
    assert robot.stop_grasp("rarm") == [True] and len(caplog.records) == 1


def test_what_a_hand_takes_anew_it_keeps_at_its_new_width(tmp_path, caplog):
    """A cube of 7 cm in place of one of 3 cm: the fingers are further apart than with the first, and hold it."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world)
    hand, held = robot.hands["right_hand"], []
    for edge in (0.03, 0.07):
        cube, kept = cube_in(world, edge=edge)
        assert robot.start_grasp("rarm") == [True]
        kept.release()
        world.run(0.1)
        held.append(hand.width)
        assert hand.held == (cube,)
        if edge == 0.03:
            saved = world.save()
            robot.stop_grasp("rarm")
            world.remove(cube)
    assert held == pytest.approx([0.03, 0.07], abs=1e-6) and not caplog.records
    world.restore(saved)
    robot.angle_vector({"turn": 0.0}, 0.5)
    robot.wait_interpolation()
    assert hand.held == () and "from 0.030 m" in caplog.text


@pytest.mark.long
def test_talos_lifts_a_cube_with_its_fingers():
    """Its arm swings 0.2 kg by 0.4 m in 1 s between the tips of its gripper: the cube slides by less than 0.1 mm."""
    swung = SwungCube(nuno.World(device="cpu"))
    moved = swung.swing()
    assert moved[[0, 2]].max() < 1e-4  # along the fingers
    assert moved[1] < 1.1 * 0.2 * G / (
        2.0 * swung.robot.balance.dynamics.fingers.limits["left_hand"] / AHEAD
    )  # across them, as soft as their motors are
    assert swung.is_held()
    assert swung.let_go() > 0.05
