"""Robots in imagined worlds: what is under way goes on with the same bits, commands differ, and the best is adopted."""

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError


def standing(dynamics):
    """Return a world and a robot in it whose arm is under way, with a towel that falls before it."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0.6, 0.0, 1.0)))
    world.attach(towel)
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
    robot.angle_vector({"arm_left_4_joint": float(robot.angle_vector()[17]) - 0.3}, 0.5)
    world.run(0.1)
    return world, robot, towel


@pytest.fixture(
    scope="module", params=[False, pytest.param(True, marks=pytest.mark.long)], ids=["kinematic", "dynamic"]
)
def scene(request):
    """The scene of ``standing``, saved."""
    world, robot, towel = standing(request.param)
    return world, robot, towel, world.save()


def test_what_is_under_way_goes_on_in_every_world(scene):
    """An arm on its way goes on, in each of three worlds, to the bit as in the robot's own world."""
    world, robot, towel, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    assert [state.q.tolist() for state in futures.robot.state()] == [robot.state().q.tolist()] * 3
    world.run(0.3)
    futures.run(0.3)
    link = robot.links.bodies[20]
    for k, state in enumerate(futures.robot.state()):
        assert np.array_equal(state.q, robot.state().q) and np.array_equal(state.v, robot.state().v)
        assert np.array_equal(futures.find(link.name).vertices[k], link.vertices)
        assert np.array_equal(futures.find(towel.name).vertices[k], towel.vertices)


def test_commands_differ_and_the_best_is_adopted(scene):
    """Each world's head goes elsewhere; the world becomes the second one, robot and its goal included."""
    world, robot, _, saved = scene
    world.restore(saved)
    futures = world.imagine(3)
    wanted = np.array([-0.1, 0.0, 0.1])
    futures.robot.angle_vector({"head_1_joint": wanted}, 0.2)
    futures.run(0.5)
    k = robot.actual.joint_index("head_1_joint")
    np.testing.assert_allclose(futures.robot.angle_vector()[:, k], wanted, atol=0.01)
    assert robot.read_reference().positions[k] == pytest.approx(0.0, abs=1e-3)  # the robot itself knows nothing of it
    one = futures.robot.state()[2]
    world.adopt(futures, 2)
    assert np.array_equal(robot.state().q, one.q)
    futures.run(0.1)
    world.run(0.1)
    assert np.array_equal(robot.state().q, futures.robot.state()[2].q)


def test_commands_are_those_of_the_driver():
    """A way through three postures, and one posture: in an imagined world to the bit as by the driver in its own."""
    world, robot, _ = standing(False)
    world.run(0.6)
    futures = world.imagine(2)
    start = robot.actual.angle_vector()
    way = np.repeat(start[None], 3, axis=0)
    arm = [robot.actual.joint_index(f"arm_left_{k}_joint") for k in (2, 4)]
    way[:, arm] += np.array([[0.1, -0.2], [0.2, -0.1], [0.15, 0.0]])
    spans = [0.3, 0.02, 0.3]  # the second is too short, and is stretched

    def follow():  # the driver may have waited for a fresh state before it sent
        futures.run(max(0.0, world.time - futures.time))

    robot.angle_vector_sequence(list(way), spans)
    follow()
    futures.robot.angle_vector_sequence(np.stack([way, np.repeat(start[None], 3, axis=0)]), spans)
    for seconds in (0.4, 0.3):
        world.run(seconds)
        follow()
        states = futures.robot.state()
        assert np.array_equal(states[0].q, robot.state().q) and np.array_equal(states[0].v, robot.state().v)
        assert np.abs(states[0].q - states[1].q).max() > 0.05
    robot.angle_vector(start, 0.5)
    follow()
    futures.robot.angle_vector(start, 0.5)
    world.run(0.3)
    follow()
    assert np.array_equal(futures.robot.state()[0].q, robot.state().q)
    for wrong, times, named in ((way[:, :5], 1.0, "avs"), (way, [1.0, 1.0], "times"), (way, 0.0, "times")):
        with pytest.raises(InvalidInputError, match=named):
            futures.robot.angle_vector_sequence(wrong, times)


def test_commands_begin_where_the_joints_are(scene):
    """A way, and a posture by name, sent while arms sag behind what is wanted: as by the driver, to the bit."""
    world, robot, _, saved = scene
    world.restore(saved)
    futures = world.imagine(1)
    if robot.is_dynamic:  # the driver plans from its encoders, which are not where the joints are wanted
        assert np.abs(robot.joints.desired[0] - robot.actual.angle_vector()).max() > 1e-5
    arm = robot.actual.joint_index("arm_left_2_joint")
    way = np.repeat(robot.actual.angle_vector()[None], 2, axis=0)
    way[:, arm] += (0.1, 0.2)
    robot.angle_vector_sequence(list(way), 0.2)
    futures.robot.angle_vector_sequence(way, 0.2)
    for command in (None, {"head_1_joint": 0.1}):
        if command:
            robot.angle_vector(command, 0.2)
            futures.robot.angle_vector(command, 0.2)
        world.run(0.1)
        futures.run(0.1)
        (state,) = futures.robot.state()
        assert np.array_equal(state.q, robot.state().q) and np.array_equal(state.v, robot.state().v)


def test_a_batch_goes_back_with_its_robots(scene):
    """Saved and restored, all worlds' robots go on with the same bits; copies of a copy too."""
    world, _, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.robot.angle_vector({"head_1_joint": np.array([-0.1, 0.1])}, 0.2)
    futures.run(0.1)
    kept = futures.save()
    futures.run(0.1)
    once = [state.q for state in futures.robot.state()]
    futures.restore(kept)
    again = futures.imagine(2, world=1)
    futures.run(0.1)
    again.run(0.1)
    assert all(np.array_equal(a, state.q) for a, state in zip(once, futures.robot.state(), strict=True))
    assert all(np.array_equal(once[1], state.q) for state in again.robot.state())


def test_bad_commands_are_named(scene):
    """Another number of joints or worlds, and a world without a robot."""
    world, _, _, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    with pytest.raises(InvalidInputError, match="angles"):
        futures.robot.angle_vector(np.zeros((2, 5)))
    with pytest.raises(InvalidInputError, match="head_1_joint"):
        futures.robot.angle_vector({"head_1_joint": np.zeros(3)})
    with pytest.raises(BodyStateError, match="one robot"):
        _ = nuno.World(device="cpu").robot


@pytest.mark.long
def test_what_the_hands_hold_is_held_alike_in_every_world():
    """A box fixed to a hand, an arm under way: the same bits in imagined worlds, and after a world is restored."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=True)
    box = world.add(nuno.box((0.1, 0.1, 0.1), position=robot.actual.frame_pose("left_hand").position))
    world.attach(box, nuno.Rigid(mass=2.0))
    for link in robot.links.bodies:
        world.ignore_contact(box, link)
    nuno.fixed_joint(box, robot.links.bodies[robot.links.names.index("arm_left_7_link")])
    robot.angle_vector({"arm_left_4_joint": float(robot.angle_vector()[17]) - 0.2}, 0.3)
    world.run(0.15)
    loads = robot.state().loads
    assert loads is not None and np.linalg.norm(loads[:, :3].sum(axis=0)) > 10.0
    saved, futures = world.save(), world.imagine(2)
    futures.run(0.2)
    world.run(0.2)
    once = robot.state()
    world.restore(saved)
    world.run(0.2)
    for state in (*futures.robot.state(), robot.state()):
        assert np.array_equal(state.q, once.q) and np.array_equal(state.v, once.v)


@pytest.mark.long
def test_a_robot_is_what_the_adopted_or_restored_one_was(standing):
    """With dynamics or without, whatever was detached and attached since; its motions end by its own tolerances."""
    world, robot = standing
    saved, moving = world.save(), world.imagine(1)
    robot.detach()
    still = world.imagine(1)
    robot.attach()  # by other joints
    world.adopt(moving, 0)
    robot.sleep(0.1)
    assert robot.is_dynamic and robot.state().fallen is None
    world.adopt(still, 0)
    assert not robot.is_dynamic and not any(body.is_dynamic for body in robot.links.bodies)
    robot.sleep(0.1)
    world.adopt(moving, 0)
    assert robot.is_dynamic
    robot.detach()
    world.restore(saved)
    robot.angle_vector({"arm_left_4_joint": -1.0}, 0.3)
    robot.sleep(0.5)
    assert not robot.is_interpolating()  # motors are not 1 mrad near; it waited for that
