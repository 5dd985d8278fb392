"""A robot on the wire in the place of one in the program: connections that end, other programs, real robots."""

import socket
import threading
import time

import numpy as np
import pytest
from lifter import cube_in, lifter_in
from other_robot import SKEW, OtherRobot
from wire_with import PATIENCE, until

import nuno
from nuno.errors import ConnectionLostError, NotConnectedError, RobotModelError, RobotTimeoutError
from nuno.robot.goal import GoalStatus, ResultCode
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.wire.client import WireRobot
from nuno.robot.wire.names import Names
from nuno.robot.wire.server import RobotServer


def cut(robot):
    """End a connection as a cable that is cut does."""
    robot.connection._socket.socket.shutdown(socket.SHUT_RDWR)


@pytest.fixture
def other(still_g1):
    """A robot behind another rosbridge."""
    robot = OtherRobot(still_g1)
    yield robot
    robot.close()


def test_nobody_listens(still_g1):
    """A url at which there is no robot is named at once."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(NotConnectedError, match=f"cannot connect to ws://127.0.0.1:{port}"):
        WireRobot(f"ws://127.0.0.1:{port}", still_g1)


def test_no_joint_states(serve, join):
    """A server that publishes none under the name that was asked for is named, with the topic."""
    with pytest.raises(RobotTimeoutError, match=r"sent no /elsewhere/joint_states within 1 s"):
        join(serve(), timeout=1.0, names=Names("elsewhere"))


@pytest.mark.parametrize("factor", [None, 1.0])
def test_connection_that_drops_in_a_motion(serve, join, plain, factor):
    """Whoever waits is told by name, at once; the robot holds where it is."""
    server = serve(real_time_factor=factor)
    robot = join(server)
    robot.angle_vector(robot.angle_vector() + 0.1, 1e6)
    raised = []

    def wait():
        try:
            robot.wait_interpolation()
        except ConnectionLostError as error:
            raised.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    time.sleep(0.1)
    cut(robot)
    thread.join()  # long before the motion ends, however fast it is
    assert "is lost" in raised[0]
    while not all(goal.is_done for goal, *_ in plain.goals.values()):
        time.sleep(0.01)
    for ask in (robot.now, robot.angle_vector, robot.is_moving, lambda: robot.sleep(1.0), robot.read_base,
                lambda: robot.angle_vector(np.zeros(len(plain.angles)), 1.0), robot.cancel_angle_vector,
                robot.go_stop, lambda: robot.move_gripper("larm", 0.0)):  # fmt: skip
        with pytest.raises(ConnectionLostError):
            ask()


def test_a_lost_robot_can_be_connected_to_again(serve, join, plain):
    """The next connection finds the robot where it was left."""
    server = serve()
    first = join(server)
    first.angle_vector(first.angle_vector() + 0.1, 1.0)
    first.sleep(0.5)
    first.close()
    second = join(server)
    held = second.angle_vector()
    second.sleep(1.0)
    np.testing.assert_array_equal(second.angle_vector(), held)
    assert not second.is_moving()


def test_two_programs(serve, join, plain):
    """Both see the robot move; the later goal takes the place of the earlier; either may cancel the other's."""
    server = serve()
    first, second = join(server), join(server)
    start = first.angle_vector()
    first.angle_vector(start + 0.05, 2.0, "larm_controller")
    assert second.wait_until(lambda: second.is_moving("larm_controller"), 1.0)
    assert not second.is_interpolating("larm_controller")
    goal = first.controller_table["larm_controller"][0].goal
    second.angle_vector(start, 1.0, "larm_controller")
    assert first.wait_interpolation("larm_controller") == [False]
    assert goal.status == GoalStatus.PREEMPTED
    second.wait_interpolation("larm_controller")
    np.testing.assert_allclose(second.angle_vector(), start, atol=1e-12)  # straight back, up to rounding
    first.angle_vector(start + 0.05, 2.0, "larm_controller")
    assert second.wait_until(lambda: second.is_moving("larm_controller"), 1.0)
    second.cancel_angle_vector()
    first.wait_interpolation("larm_controller")
    assert first.controller_table["larm_controller"][0].goal.status == GoalStatus.PREEMPTED


def test_two_programs_wait_at_once(serve, join, plain):
    """Time goes on for both, and no further than the longer of the two waits."""
    server = serve()
    first, second = join(server), join(server)
    threads = [threading.Thread(target=robot.sleep, args=(span,)) for robot, span in ((first, 0.8), (second, 0.5))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert 0.8 - 1e-9 <= plain.now() <= 1.3 + 1e-9


def test_base_hands_and_forces(serve, join, plain):
    """What is not joints passes through too; what the robot does not have is named."""
    robot = join(serve())
    assert robot.go_pos(0.1, 0.2, 0.3)
    np.testing.assert_allclose(plain.place, (0.1, 0.2, 0.3), atol=1e-9)  # nanoseconds on the wire
    np.testing.assert_allclose(robot.odom.position, (0.1, 0.2, 0.0), atol=1e-9)
    assert robot.go_velocity(0.1, 0.0, 0.0, sec=2.0, wait=True)
    np.testing.assert_allclose(plain.place, (0.3, 0.2, 0.3), atol=1e-9)
    assert robot.go_pos(1.0, wait=False)
    robot.sleep(0.5)
    assert robot.go_stop()
    assert 0.0 < plain.place[0] - 0.3 < 1.0
    force, torque = robot.read_wrench("left_wrist")
    assert (force.tolist(), torque.tolist()) == ([1, 2, 3], [4, 5, pytest.approx(plain.now())])
    robot.sleep(0.5)
    assert robot.read_wrench("left_wrist")[1][2] == pytest.approx(plain.now())
    with pytest.raises(RobotModelError, match="no topic '/imu/data'"):
        robot.read_imu()
    with pytest.raises(RobotModelError, match="no topic '/right_wrist/wrench'"):
        robot.read_wrench("right_wrist")


def test_refused_goal(serve, join, plain):
    """A goal that the controller does not take comes back as rejected, with the robot's words."""
    robot = join(serve())
    own = robot.controller_table["larm_controller"][0]
    goal = own.send_goal(JointTrajectory(("waist_yaw_joint",), [1.0], [[0.0]]))
    assert (goal.status, goal.code) == (GoalStatus.REJECTED, ResultCode.INVALID_JOINTS)
    assert "waist_yaw_joint" in goal.text


def test_clock_that_stands_still(serve, join, plain):
    """Whoever waits for a robot whose clock has stopped is told so, and does not wait for ever."""
    server = serve(real_time_factor=1.0)
    robot = join(server)
    robot.connection.timeout = 0.3
    with server.lock:  # no tick can be made
        with pytest.raises(RobotTimeoutError, match="stands still"):
            robot.sleep(1.0)
    robot.connection.timeout = PATIENCE
    robot.sleep(0.05)


def test_other_names(serve, join, plain):
    """Topics and actions by other names, behind a namespace, on both sides."""
    names = Names("lab/g1", joint_states="joints", wrench="ft/{frame}", navigate="/go")
    robot = join(serve(names=names), names=names)
    robot.angle_vector(robot.angle_vector() + 0.02, 0.5)
    assert not any(robot.wait_interpolation())
    assert robot.go_pos(0.1)
    assert robot.read_wrench("left_wrist")[0].tolist() == [1, 2, 3]


def test_a_robot_with_other_controllers(other, join):
    """A real robot: its own controllers, clock, and no acknowledgement; results end the wait."""
    robot = join(other, controllers={"larm_controller": ["left_elbow_joint", "left_shoulder_roll_joint"]})
    assert abs(robot.now() - time.time() - SKEW) < 0.1 * SKEW  # what is told is late on a busy machine
    assert len(robot.angle_vector()) == 29  # two topics' joints
    assert robot.torque_vector().tolist() == [0.0] * 29  # what is not measured
    before = time.monotonic()
    robot.angle_vector({"left_elbow_joint": 0.4}, 3600.0)
    assert robot.is_interpolating() and robot.is_moving()
    robot.angle_vector({"left_elbow_joint": 0.5}, 0.5)
    assert robot.wait_interpolation() == [False]
    assert time.monotonic() - before >= 0.5
    assert robot.angle_vector()[robot.robot.joint_index("left_elbow_joint")] == 0.5
    robot.angle_vector({"left_elbow_joint": 0.2}, 3600.0, start_time=1.0)
    robot.cancel_angle_vector()
    assert robot.controller_actions[0].goal.status == GoalStatus.PREEMPTED


def test_a_robot_that_refuses(other, join, still_g1):
    """A refusal that is a text, as of rosbridge, is a rejected goal, known when it arrives."""
    robot = join(other, controllers={"larm_controller": [*still_g1.joint_names[:7], "left_elbow_joint"]})
    robot.angle_vector({"left_elbow_joint": 0.5}, 0.5)
    robot.wait_interpolation()
    goal = robot.controller_actions[0].goal
    assert (goal.status, goal.code, goal.text) == (GoalStatus.REJECTED, -1, "Action goal was rejected")


def test_a_robot_without_a_controller(other, join):
    """A controller that the robot does not have is left out once it has been waited for."""
    begin = time.monotonic()
    robot = join(other, controllers={"tail_controller": ["left_elbow_joint"]}, controller_timeout=0.3)
    assert time.monotonic() - begin >= 0.3
    assert robot.controller_actions == []
    assert robot.angle_vector({"left_elbow_joint": 0.5}, 0.5, "tail_controller") is False


def test_a_robot_that_does_not_tell_its_controllers(still_g1, join):
    """Without rosapi a controller is believed to be there."""
    other = OtherRobot(still_g1, with_rosapi=False)
    try:
        robot = join(other, controllers={"larm_controller": ["left_elbow_joint"]})
        robot.angle_vector({"left_elbow_joint": 0.5}, 0.2)
        assert robot.wait_interpolation() == [False]
    finally:
        other.close()


def test_velocities_of_a_real_base(other, join):
    """Are told again and again until their time is over, and then that of rest."""
    robot = join(other, controllers={"larm_controller": ["left_elbow_joint"]})
    begin = time.monotonic()
    assert robot.go_velocity(0.1, 0.0, 0.2, sec=0.5, wait=True)
    until(lambda: other.velocities[-1][1]["linear"]["x"] == 0.0)  # the last one is under way
    told = [(own["linear"]["x"], own["angular"]["z"]) for _, own in other.velocities]
    assert told[:-1] == [(0.1, 0.2)] * (len(told) - 1)
    assert told[-1] == (0.0, 0.0)
    assert other.velocities[-1][0] - begin >= 0.5
    robot.go_velocity(0.1, sec=3600.0)
    assert robot.go_stop()  # long before the hour is over
    assert robot._stream._goal.status == GoalStatus.PREEMPTED


def test_a_robot_whose_states_stop(other, join):
    """A robot that is connected but tells nothing any more is named, not waited for without end."""
    robot = join(other, controllers={"larm_controller": ["left_elbow_joint"]})
    robot.connection.timeout = 1.0
    other.silent = True
    with pytest.raises(RobotTimeoutError, match="no fresh joint state"):
        while True:  # some states may be under way
            robot.angle_vector()


def test_a_grasp_tells_whether_something_is_held(tmp_path):
    """Through the wire as at the robot itself: False where the hand closed on nothing, True on a cube."""
    world = nuno.World(device="cpu")
    robot = lifter_in(tmp_path, world)
    with RobotServer(robot, port=0, real_time_factor=None) as server:
        with WireRobot(server.url, robot.robot, timeout=PATIENCE) as client:
            assert client.start_grasp("rarm") == [False]
            assert client.stop_grasp("rarm") == [True]
            cube_in(world)
            assert client.start_grasp("rarm") == [True]
            assert client.move_gripper("rarm", 0.0) == [False]  # the cube keeps the fingers apart
            assert client.move_gripper("rarm", 0.0, ignore_stall=True) == [True]
