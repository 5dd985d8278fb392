"""Sensors of imagined robots: each world's tell what those of the robot tell where the same happens."""

from dataclasses import fields

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, RobotModelError

PLAIN = ("positions", "velocities", "torques", "orientation", "angular_velocity", "specific_force", "zero_moment_point")


def laden(dynamics):
    """Return a world and a robot in it, with a towel in its left hand and a rigid cube in its right one."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
    place = robot.actual.frame_pose("left_hand").to_world([(0, 0, 0.03)])[0]
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), name="towel", position=np.add(place, (0.1, 0.1, 0.0))))
    cube = world.add(nuno.box((0.04, 0.04, 0.04), name="cube", position=robot.actual.frame_pose("right_hand").position))
    world.attach(towel, nuno.Cloth(area_density=0.3))
    world.attach(cube, nuno.Rigid(mass=0.3))
    if dynamics:  # what fingers press on may slip: here the last links of the arms hold both
        links = {name: robot.links.bodies[robot.links.names.index(f"arm_{name}_7_link")] for name in ("left", "right")}
        for link in robot.links.bodies:
            world.ignore_contact(cube, link)
        world.grip(towel, [0, 1], to=links["left"])
        nuno.fixed_joint(cube, links["right"])
    else:
        assert robot.hands["left_hand"].close() == (towel,) and robot.hands["right_hand"].close() == (cube,)
    world.run(0.1)
    return world, robot


def assert_same(imagined, k, own):
    """Assert that the readings of a world are, to the bit, those of a robot of its own."""
    for name in PLAIN:
        np.testing.assert_array_equal(getattr(imagined, name)[k], getattr(own, name), err_msg=name)
    assert set(imagined.wrenches) == set(own.wrenches)
    for name, wrench in own.wrenches.items():
        np.testing.assert_array_equal(imagined.wrenches[name][k], wrench, err_msg=name)
    assert {foot: bool(touch[k]) for foot, touch in imagined.contacts.items()} == own.contacts
    assert imagined.time == own.time


@pytest.fixture(
    scope="module", params=[False, pytest.param(True, marks=pytest.mark.long)], ids=["kinematic", "dynamic"]
)
def scene(request):
    """The scene of ``laden``, saved."""
    world, robot = laden(request.param)
    return world, robot, world.save()


def test_imagined_sensors_tell_what_the_robots_own_do(scene):
    """Both arms under way, a towel and a cube in the hands: frame by frame the same bits in each world."""
    world, robot, saved = scene
    world.restore(saved)
    arms = [f"arm_{side}_4_joint" for side in ("left", "right")]
    angles = robot.angle_vector()
    robot.angle_vector({name: angles[robot.actual.joint_index(name)] - 0.3 for name in arms}, 0.5)
    futures = world.imagine(3)
    for _ in range(8):
        world.step()
        futures.step()
        own, imagined = robot.read(), futures.robot.read()
        for k in range(3):
            assert_same(imagined, k, own)
    # what the hands hold is among it: without it the right wrist bears less, by about the cube's weight
    empty = nuno.Sensors(robot.actual).read(robot.state()).wrenches["right_wrist"]
    if not robot.is_dynamic:
        assert np.linalg.norm((own.wrenches["right_wrist"] - empty)[:3]) == pytest.approx(0.3 * 9.81, rel=0.2)


def test_where_commands_differ_each_world_reads_as_a_world_of_its_own(scene):
    """Three motions imagined together, and each in a world alone: the same bits, read at the end.

    Nothing was read in the frame before, so that the towel's contacts are asked for.
    """
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    k = robot.actual.joint_index("arm_left_4_joint")
    goals = robot.actual.angle_vector()[k] + np.array([-0.3, 0.0, 0.2])
    futures.robot.angle_vector({"arm_left_4_joint": goals}, 0.3)
    futures.run(0.2)
    imagined = futures.robot.read()
    assert np.ptp(imagined.wrenches["left_wrist"], axis=0).max() > 0.1
    for k, goal in enumerate(goals):
        world.restore(saved)
        alone = world.imagine(1)
        alone.robot.angle_vector({"arm_left_4_joint": goal}, 0.3)
        alone.run(0.2)
        lone = alone.robot.read()
        for name in PLAIN:
            np.testing.assert_array_equal(getattr(imagined, name)[k], getattr(lone, name)[0], err_msg=name)
        for name, wrench in lone.wrenches.items():
            np.testing.assert_array_equal(imagined.wrenches[name][k], wrench[0], err_msg=name)


def test_readings_are_those_of_the_present_after_a_restore(scene):
    """The cube pulled by 20 N, or not, from the same snapshot to the same time: the wrist feels that pull, or not."""
    world, robot, saved = scene
    world.restore(saved)
    batch = world.imagine(2)
    for one, driver, kept in ((world, robot, saved), (batch, batch.robot, batch.save())):
        pulls = []
        for pull in (0.0, 20.0):
            one.restore(kept)
            one.push("cube", (0.0, 0.0, -pull))
            one.run(0.1)
            pulls.append(np.atleast_2d(driver.read_wrench("right_wrist")[0])[-1])
        more = np.linalg.norm(pulls[1] - pulls[0])
        assert more == pytest.approx(20.0, rel=0.1)  # motors give way a little


def test_states_as_arrays(scene):
    """They are what the records tell, over worlds: base in this library's order of quaternions, and flags."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.robot.angle_vector({"head_1_joint": [0.0, 0.1]}, 0.2)
    futures.run(0.1)
    arrays, records = futures.robot.state_arrays(), futures.robot.state()
    n = len(robot.actual.joint_names)
    assert arrays.time == futures.time == records[0].time
    for k, record in enumerate(records):
        np.testing.assert_array_equal(arrays.base[k], record.q[[0, 1, 2, 6, 3, 4, 5]])
        np.testing.assert_array_equal(arrays.positions[k], robot.actual.angles_of(record.q))
        for name, own in (("velocities", record.v), ("accelerations", record.a)):
            np.testing.assert_array_equal(getattr(arrays, name)[k], own[6:])
        np.testing.assert_array_equal(arrays.base_velocity[k], record.v[:6])
        np.testing.assert_array_equal(arrays.base_acceleration[k], record.a[:6])
        if robot.is_dynamic:
            np.testing.assert_array_equal(arrays.torques[k], record.torques)
    shapes = {field.name: np.shape(getattr(arrays, field.name)) for field in fields(arrays)}
    assert shapes["base"] == (2, 7) and shapes["over_torque"] == shapes["torques"] == (2, n)
    assert shapes["fallen"] == shapes["collided"] == (2,)
    assert not arrays.fallen.any() and not arrays.collided.any() and arrays.fallen.dtype == bool
    assert np.isnan(arrays.torques).all() != robot.is_dynamic


def test_what_cannot_be_read_is_named(scene):
    """A sensor that there is not, and a batch that has lost a link."""
    world, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    with pytest.raises(RobotModelError, match="'nose'"):
        futures.robot.read_wrench("nose")
    force, torque = futures.robot.read_wrench("left_wrist")
    assert force.shape == torque.shape == (2, 3)
    futures.remove(futures.robot.original.links.bodies[3].name)
    with pytest.raises(BodyStateError, match="lack links"):
        futures.robot.read()
