"""A second participant, whose messages are written down anew, finds what it expects of a robot of ROS 2."""

import gc
import os
import signal
import subprocess
import sys
import uuid
from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed: no DDS to talk to")

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from ros2_node import (
    BEST_EFFORT,
    LATCHED,
    PATIENCE,
    UUID,
    CameraInfo,
    CancelRequest,
    CancelResponse,
    Clock,
    Duration,
    FeedbackMessage,
    FollowGoal,
    GetResultRequest,
    GetResultResponse,
    GoalInfo,
    Header,
    Image,
    JointState,
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    Node,
    SendGoalRequest,
    SendGoalResponse,
    String,
    TFMessage,
    Time,
    Twist,
    Vector3,
    graph_domain,
    hear,
    stay_here,
    until,
)  # fmt: skip

from interrupts import obey_interrupts
from nuno.errors import InvalidInputError
from nuno.robot.readings import ImageReading
from nuno.robot.ros2.dds_bridge import DdsBridge
from nuno.robot.ros2.dds_types import dds_type, from_dds, to_dds
from nuno.robot.ros2.definitions import DEFINITIONS

DOMAIN = graph_domain()
LARM = "larm_controller"
FOLLOW = f"{LARM}/follow_joint_trajectory/_action"
HEADER = Header(Time(0, 0), "")


@pytest.fixture
def node(serve):
    """A server in real time, and a node beside it."""
    server = serve()
    return Node(server.domain)


def trajectory(plain, seconds=0.2, change=0.2, controller=LARM):
    """One point for the left arm."""
    joints = plain.controller_param_table[controller][0]["joint_names"]
    after = Duration(int(seconds), round(1e9 * (seconds % 1)))
    point = JointTrajectoryPoint([plain.angles[joint] + change for joint in joints], [], [], [], after)
    return JointTrajectory(HEADER, joints, [point])


def test_states_and_time_come(node, plain):
    """Joint states for readers that want every one, the clock for those that do not mind, the URDF for latecomers."""
    state = hear(node.listen("rt/joint_states", JointState))
    assert state.name == list(plain.robot.joint_names)
    np.testing.assert_allclose(state.position, list(plain.angles.values()))
    assert state.effort == [1.5] * len(state.name)
    clock = node.listen("rt/clock", Clock, BEST_EFFORT)
    first = hear(clock).clock
    assert hear(clock, lambda own: (own.clock.sec, own.clock.nanosec) > (first.sec, first.nanosec))
    assert "<robot" in hear(node.listen("rt/robot_description", String, LATCHED)).data


def test_transforms_make_a_tree(node, plain):
    """Every link in its parent, the base in odom, with unit quaternions."""
    found = hear(node.listen("rt/tf", TFMessage)).transforms
    parents = {own.child_frame_id: own.header.frame_id for own in found}
    assert parents["pelvis"] == "odom"
    assert set(parents.values()) - {"odom"} <= set(parents)
    turns = np.array([[getattr(own.transform.rotation, axis) for axis in "xyzw"] for own in found])
    np.testing.assert_allclose(np.linalg.norm(turns, axis=1), 1.0, atol=1e-12)


def test_a_trajectory_on_a_topic_is_followed_and_stops_with_its_sender(node, plain):
    """Joints go there; when all who could send are gone, they hold."""
    before = dict(plain.angles)
    writer = node.talk(f"rt/{LARM}/joint_trajectory", JointTrajectory)
    writer.write(trajectory(plain))
    joint = plain.controller_param_table[LARM][0]["joint_names"][0]
    until(lambda: abs(plain.angles[joint] - before[joint] - 0.2) < 1e-9)
    writer.write(trajectory(plain, 1000.0))
    until(lambda: plain.is_busy(plain.controller_param_table[LARM][0]))
    del writer
    gc.collect()
    until(lambda: not plain.is_busy(plain.controller_param_table[LARM][0]))


def test_velocities_are_walked(node, plain):
    """The newest counts."""
    writer = node.talk("rt/cmd_vel", Twist)
    for x in (0.1, 0.3):
        writer.write(Twist(Vector3(x, 0.0, 0.0), Vector3(0.0, 0.0, 0.2)))
    until(lambda: plain.going is not None and np.allclose(plain.going[1], (0.3, 0.0, 0.2)))
    until(lambda: plain.place[0] > 0.01)


class Action:
    """A client of an action, as rclpy's."""

    def __init__(self, node):
        """Find its services."""
        self.send = node.service(f"{FOLLOW}/send_goal", SendGoalRequest, SendGoalResponse)
        self.result = node.service(f"{FOLLOW}/get_result", GetResultRequest, GetResultResponse)
        self.cancel = node.service(f"{FOLLOW}/cancel_goal", CancelRequest, CancelResponse)
        self.number = 0

    def call(self, service, kind, *fields):
        """Ask a service, and return the answer to that very request."""
        self.number += 1
        writer, reader = service
        writer.write(kind(12345678901234567890, self.number, *fields))
        answer = hear(reader, lambda own: own.seq == self.number)
        assert answer.guid == 12345678901234567890
        return answer

    def goal(self, trajectory):
        """Send a goal; return what it is called and whether it was accepted."""
        name = UUID(list(uuid.uuid4().bytes))
        own = FollowGoal(trajectory, MultiDOFJointTrajectory(HEADER, [], []), [], [], [], [], Duration(0, 0))
        return name, self.call(self.send, SendGoalRequest, name, own).accepted


def test_the_action(node, plain):
    """A goal is accepted, tells how far it is, and its result comes when it is there, also to those who ask before."""
    before = dict(plain.angles)
    feedback = node.listen(f"rt/{FOLLOW}/feedback", FeedbackMessage)
    action = Action(node)
    until(feedback.get_matched_publications)
    name, accepted = action.goal(trajectory(plain, 0.3))
    assert accepted
    result = action.call(action.result, GetResultRequest, name)
    assert (result.status, result.result.error_code) == (4, 0)
    joints = plain.controller_param_table[LARM][0]["joint_names"]
    assert plain.angles[joints[0]] == pytest.approx(before[joints[0]] + 0.2)
    told = hear(feedback)
    assert bytes(told.goal_id.uuid) == bytes(name.uuid)
    assert told.feedback.joint_names == joints
    assert len(told.feedback.actual.positions) == len(joints)


def test_a_goal_is_cancelled_and_another_refused(node, plain):
    """A cancelled goal has the status of such, a refused one is not accepted, an unknown one has no result."""
    action = Action(node)
    name, accepted = action.goal(trajectory(plain, 1000.0))
    assert accepted
    answer = action.call(action.cancel, CancelRequest, GoalInfo(name, Time(0, 0)))
    assert answer.return_code == 0
    assert [bytes(own.goal_id.uuid) for own in answer.goals_canceling] == [bytes(name.uuid)]
    assert action.call(action.result, GetResultRequest, name).status == 5
    assert action.call(action.cancel, CancelRequest, GoalInfo(UUID([1] * 16), Time(0, 0))).return_code == 2
    wrong = trajectory(plain)
    wrong.points[0].positions = [0.0]
    name, accepted = action.goal(wrong)
    assert not accepted
    assert action.call(action.result, GetResultRequest, name).status == 0


def test_images(serve, plain, monkeypatch):
    """Colour as rgb8, to the byte, and the camera's pixels."""
    image = np.random.default_rng(1).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    camera = plain.robot.camera("head")
    monkeypatch.setattr(type(plain), "shown_cameras", property(lambda _: ("head",)))
    monkeypatch.setattr(plain, "read_image", lambda name: ImageReading(plain.now(), camera, image), raising=False)
    node = Node(serve().domain)
    found = hear(node.listen("rt/head/image_raw", Image))
    assert (found.encoding, found.height, found.width, found.step) == ("rgb8", 48, 64, 192)
    assert found.header.frame_id == "head_optical_frame"
    assert bytes(found.data) == image.tobytes()
    info = hear(node.listen("rt/head/camera_info", CameraInfo))
    assert (info.k[0], info.p[10], len(info.d)) == (camera.fx, 1.0, 5)


def test_messages_survive_a_round_trip():
    """Every type, with nothing in it and as its fields by name."""
    for kind in DEFINITIONS:
        made = to_dds(kind, {})
        assert from_dds(kind, dds_type(kind).deserialize(made.serialize())) == from_dds(kind, made)


def test_another_layout_is_not_heard(node, plain):
    """A program that has the type's name and other fields is no publisher of it, and does no harm."""

    @final
    @dataclass
    class Odd(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
        text: str

    writer = DataWriter(node.participant, Topic(node.participant, f"rt/{LARM}/joint_trajectory", Odd))
    writer.write(Odd("x" * 50))
    node.talk(f"rt/{LARM}/joint_trajectory", JointTrajectory)  # by now the other would have been found
    assert not writer.get_matched_subscriptions()
    hear(node.listen("rt/joint_states", JointState))  # it goes on


@pytest.mark.long
def test_the_command(plain):
    """Promise: `nuno serve --ros2` is heard in another process; an interrupt ends it."""
    command = [sys.executable, "-m", "nuno", "serve", "g1", "--ros2", "--domain", str(DOMAIN), "--device", "cpu"]
    stays = stay_here(DOMAIN)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=obey_interrupts,
        env=os.environ | {"ROS_LOCALHOST_ONLY": "1"},
    ) as process:  # fmt: skip
        try:
            said = process.stdout.readline()
            assert f"g1 in the ROS 2 domain {DOMAIN}" in said, said + process.stderr.read()
            node = Node(DOMAIN)
            state = hear(node.listen("rt/joint_states", JointState))
            assert state.name == list(plain.robot.joint_names)
            joint = plain.controller_param_table[LARM][0]["joint_names"][0]
            k = state.name.index(joint)
            writer = node.talk(f"rt/{LARM}/joint_trajectory", JointTrajectory)
            writer.write(trajectory(plain))
            states = node.listen("rt/joint_states", JointState)
            hear(states, lambda own: abs(own.position[k] - plain.angles[joint] - 0.2) < 1e-6)
            process.send_signal(signal.SIGINT)
            assert process.wait(PATIENCE) == 130
        finally:
            process.kill()
            del stays


def test_what_cannot_be_served_is_named(plain, monkeypatch):
    """Domains beyond those that DDS has ports for."""
    with pytest.raises(InvalidInputError, match=r"domain must be a whole number in \[0, 232\], got 233"):
        DdsBridge(233)
    monkeypatch.setenv("ROS_DOMAIN_ID", "home")
    with pytest.raises(InvalidInputError, match="ROS_DOMAIN_ID must be a whole number"):
        DdsBridge()


def test_a_failed_simulation_is_told(serve, plain):
    """The server ends, and join raises what it failed with."""
    server = serve()
    plain.failure = RuntimeError("the robot has fallen")
    until(lambda: not server.alive)
    with pytest.raises(RuntimeError, match="fallen"):
        server.join()
