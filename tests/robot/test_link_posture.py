"""The posture of a robot by where its links stand."""

import numpy as np
import pytest

import nuno
from nuno.robot.link_posture import posture_of
from nuno.robot.simulated_robot import SimulatedRobot

BENT = {"arm_left_4_joint": -1.5, "head_1_joint": 0.2}


@pytest.mark.parametrize("name", ["talos", "g1"])
def test_the_posture_of_links_is_the_robots(name):
    """Forward kinematics and back, also of G1's two joints without a shape."""
    robot = nuno.Humanoid(name)
    links = robot.enter(nuno.World(device="cpu"))
    lower, upper = robot.joint_limits
    robot.angle_vector(np.clip(robot.angle_vector() + 0.3, lower, upper))
    robot.locate((0.3, -0.2, 1.0))
    robot.rotate(0.4, (0.0, 0.0, 1.0))
    wanted = robot.configuration()
    links.follow(0.0)
    robot.stand()
    np.testing.assert_allclose(posture_of(links), wanted, atol=1e-9)  # doubles, and Newton's last step


def test_a_robot_is_where_a_restored_file_has_its_links(tmp_path):
    """Its angles, clock and sensors are those of the links, its goals are over, and it obeys from there."""
    world = nuno.World(device="cpu")
    robot = SimulatedRobot(nuno.Humanoid(), world)
    before = robot.actual.configuration().copy()
    world.save(tmp_path / "room.npz")
    robot.angle_vector(BENT, 0.5)
    robot.sleep(0.3)
    world.restore(tmp_path / "room.npz")
    assert not robot.is_interpolating() and robot.state().time == world.time == 0.0
    np.testing.assert_allclose(robot.state().q, before, atol=1e-9)
    robot.angle_vector(BENT, 0.5)
    robot.wait_interpolation()
    places, _ = robot.links.poses()
    np.testing.assert_allclose([body.position for body in robot.links.bodies], places, atol=1e-12)
    assert robot.actual.angle_vector()[robot.actual.joint_index("arm_left_4_joint")] == -1.5


@pytest.mark.long
def test_a_hand_holds_what_it_held_in_a_file_of_another_process(tmp_path):
    """The grips are other objects; the hand lets go of them as it opens. The tie was all that bore the sheet."""
    rooms = []
    for _ in range(2):
        world = nuno.World(device="cpu")
        robot = SimulatedRobot(nuno.Humanoid(), world)
        rag = world.add(nuno.sheet((0.1, 0.1), cells=(4, 4), name="rag"))
        rooms.append((world, robot, rag))
    world, robot, rag = rooms[0]
    rag.locate(robot.actual.frame_pose("left_hand").position)
    world.attach(rag)
    assert robot.start_grasp("larm") == [True]
    world.save(tmp_path / "room.npz")
    world, robot, rag = rooms[1]
    world.restore(tmp_path / "room.npz")
    assert robot.hands["left_hand"].held == (rag,)
    height = rag.vertices[:, 2].max()
    assert robot.stop_grasp("larm") == [True] and robot.hands["left_hand"].held == ()
    robot.sleep(0.3)
    assert rag.vertices[:, 2].max() < height - 0.1  # 0.44 m in free fall, less what slides along the fingers


@pytest.mark.long
def test_a_robot_with_dynamics_takes_a_file_of_another_process(tmp_path):
    """It is attached anew by its own joints, stands still in the file's posture, and obeys."""
    rooms = []
    for _ in range(2):
        world = nuno.World(device="cpu")
        world.add(nuno.plane(name="floor"))
        rooms.append((world, SimulatedRobot(nuno.Humanoid(), world, dynamics=True)))
    world, robot = rooms[0]
    robot.angle_vector(BENT, 0.5)
    robot.wait_interpolation()
    robot.sleep(0.5)
    world.save(tmp_path / "room.npz")
    (world, own), wanted = rooms[1], robot.actual.configuration()
    world.restore(tmp_path / "room.npz")
    assert own.is_dynamic and not own.links.missing
    np.testing.assert_allclose(own.actual.configuration(), wanted, atol=1e-3)  # joints of motors give way so much
    own.sleep(0.5)
    assert own.state().fallen is None
    np.testing.assert_allclose(own.actual.angle_vector(), robot.actual.angle_vector(), atol=0.01)


def test_copies_of_a_robot_are_not_restored_from_what_does_not_tell_of_them():
    """Their links would be where the snapshot has them, and they elsewhere; what the batch saved itself is restored."""
    world = nuno.World(device="cpu")
    SimulatedRobot(nuno.Humanoid(), world)
    futures = world.imagine(2)
    own = futures.save()
    futures.robot.angle_vector(BENT, 0.2)
    futures.run(0.1)
    with pytest.raises(nuno.BodyStateError, match="does not say how"):
        futures.restore(world.save())
    assert futures.time == pytest.approx(0.1)
    futures.restore(own)
    assert futures.time == 0.0
