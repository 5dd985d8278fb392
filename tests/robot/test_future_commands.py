"""The commands of a future: the robot does what its copy was told, in a world that stays as it is."""

import logging

import numpy as np
import pytest

import nuno
from nuno.errors import BodyStateError, InvalidInputError

ARM = "arm_left_4_joint"
HEAD = "head_1_joint"


def under_way(dynamics):
    """Return a world and a robot in it whose arm is under way, with a towel that falls before it."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), name="towel", position=(0.6, 0.0, 1.0)))
    world.attach(towel)
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world, dynamics=dynamics)
    robot.angle_vector({ARM: robot.angle_vector()[robot.actual.joint_index(ARM)] - 0.3}, 0.5)
    world.run(0.1)
    return world, robot


@pytest.fixture(
    scope="module", params=[False, pytest.param(True, marks=pytest.mark.long)], ids=["kinematic", "dynamic"]
)
def scene(request):
    """The scene of ``under_way``, saved."""
    world, robot = under_way(request.param)
    return world, robot, world.save()


def steps(world, driver, count):
    """Step a world, and return configuration, velocity and acceleration after each frame."""
    found = []
    for _ in range(count):
        world.step()
        states = driver.state()
        alone = not isinstance(states, tuple)
        rows = [np.concatenate([own.q, own.v, own.a]) for own in ((states,) if alone else states)]
        found.append(rows[0] if alone else rows)
    return np.array(found)


def imagined(world):
    """Return futures, and their 39 frames, in which the arm goes on, then heads go to two places, each on its way."""
    futures = world.imagine(2)
    ways = [steps(futures, futures.robot, 3)]
    futures.robot.angle_vector({HEAD: [-0.2, 0.2]}, 0.3)
    ways.append(steps(futures, futures.robot, 6))
    futures.robot.angle_vector({HEAD: [0.1, -0.1], ARM: -1.2}, 0.4)
    ways.append(steps(futures, futures.robot, 30))
    return futures, np.concatenate(ways)


def test_the_robot_does_what_its_copy_did(scene):
    """From the same moment every frame has the same bits; what was under way goes on until the first command."""
    world, robot, saved = scene
    world.restore(saved)
    before = world.save()
    futures, ways = imagined(world)
    towel = world.find("towel").vertices.copy()
    now = world.time
    world.adopt(futures, 1, only="commands")
    assert world.time == now and np.array_equal(world.find("towel").vertices, towel)
    assert robot.is_moving()
    np.testing.assert_array_equal(steps(world, robot, 39), ways[:, 1])
    assert not robot.is_moving() or robot.is_dynamic  # motors are not where they are wanted at once
    # another future after that, from the same moment again
    world.restore(before)
    world.adopt(futures, 0, only="commands")
    kept = world.save()
    np.testing.assert_array_equal(steps(world, robot, 20), ways[:20, 0])
    world.restore(kept)  # what is to come is part of a snapshot
    copies = world.imagine(1)  # and goes along into futures
    np.testing.assert_array_equal(steps(copies, copies.robot, 39)[:, 0], ways[:, 0])
    np.testing.assert_array_equal(steps(world, robot, 39), ways[:, 0])


def test_what_the_robot_was_told_since_is_given_up(scene):
    """A goal that was sent after imagining, before anything moved, ends as preempted; frames are the copy's."""
    world, robot, saved = scene
    world.restore(saved)
    futures, ways = imagined(world)
    world.restore(saved)
    name, controller = next(iter(robot.joints.controllers.items()))
    here = robot.joints.positions[robot.joints.rows[name]]
    other = robot.joints.send(name, nuno.JointTrajectory(controller.names, [0.5], here[None]))
    world.adopt(futures, 0, only="commands")
    assert other.is_done and not other.succeeded and "commands of a future" in other.text
    np.testing.assert_array_equal(steps(world, robot, 20), ways[:20, 0])


def test_later_the_commands_begin_then(scene):
    """The world has gone on for 0.7 s and its arm has come to rest: heads go as in the future, as long after now."""
    world, robot, saved = scene
    world.restore(saved)
    futures, ways = imagined(world)
    world.run(0.7)
    world.adopt(futures, 1, only="commands")
    found = steps(world, robot, 39)
    head = robot.actual.angles_of(found)[:, robot.actual.joint_index(HEAD)]
    expected = robot.actual.angles_of(ways[:, 1])[:, robot.actual.joint_index(HEAD)]
    # the same splines from the same rest; motors leave the head elsewhere by what it sags
    np.testing.assert_allclose(head, expected, atol=5e-3 if robot.is_dynamic else 1e-9)
    arm = robot.actual.angles_of(found)[:, robot.actual.joint_index(ARM)]
    assert arm[-1] == pytest.approx(-1.2, abs=0.02 if robot.is_dynamic else 1e-9)


def test_nothing_to_do_is_told(scene, caplog):
    """A copy that was told nothing while nothing was under way: a warning says that the robot holds."""
    world, robot, saved = scene
    world.restore(saved)
    world.run(0.6)
    futures = world.imagine(2)
    futures.run(0.1)
    with caplog.at_level(logging.WARNING, logger="nuno"):
        world.adopt(futures, 1, only="commands")
    assert "was told nothing in future 1" in caplog.text
    assert not robot.is_moving()


def test_what_cannot_be_adopted_is_named(scene):
    """Another world's futures, numbers out of range, no robot, one that came or left since: nothing changes."""
    world, robot, saved = scene
    world.restore(saved)
    futures = world.imagine(2)
    futures.robot.angle_vector({HEAD: 0.1}, 0.2)
    with pytest.raises(InvalidInputError, match="only must be"):
        world.adopt(futures, 0, only="robot")
    with pytest.raises(InvalidInputError, match="imagine of this world"):
        world.adopt(nuno.World(device="cpu"), 0, only="commands")
    with pytest.raises(InvalidInputError, match="k must be"):
        world.adopt(futures, 2, only="commands")
    with pytest.raises(BodyStateError, match="no robot in this world"):
        futures.adopt(futures.imagine(2, world=0), 0, only="commands", world=0)
    world.drivers.remove(robot)
    without = world.imagine(1)
    with pytest.raises(BodyStateError, match="no robot in this world"):
        world.adopt(futures, 0, only="commands")
    world.drivers.append(robot)
    with pytest.raises(BodyStateError, match="not in these futures"):
        world.adopt(without, 0, only="commands")


@pytest.mark.long
def test_walks_go_on_or_are_refused():
    """A walk under way goes on beside the commands, to the bit; where it has gone on since, it is refused by name."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    robot = nuno.SimulatedRobot(nuno.Humanoid("talos"), world)
    robot.send_base(0.4, 0.0, 0.0, None, True)
    world.run(0.3)
    futures = world.imagine(1)
    ways = steps(futures, futures.robot, 30)
    world.adopt(futures, 0, only="commands")
    np.testing.assert_array_equal(steps(world, robot, 30), ways[:, 0])
    with pytest.raises(BodyStateError, match="walks, and these futures"):
        world.adopt(futures, 0, only="commands")
    robot.wait_until(lambda: not robot.gait.is_walking)
    with pytest.raises(BodyStateError, match="walked as these futures"):
        world.adopt(futures, 0, only="commands")
