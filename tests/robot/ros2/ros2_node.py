"""A program of ROS 2 as DDS sees it, with messages written down a second time, by hand, from ROS' own .msg files."""

import os
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import array, float64, int8, int32, int64, sequence, uint8, uint16, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

PATIENCE = 120.0
"""[s] For two participants to find each other on a loaded machine; most do in a tenth of a second."""
RELIABLE = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(10), Policy.Durability.Volatile)
BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5))
LATCHED = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(1), Policy.Durability.TransientLocal)


@final
@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """builtin_interfaces/msg/Time."""

    sec: int32
    nanosec: uint32


@final
@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    """builtin_interfaces/msg/Duration."""

    sec: int32
    nanosec: uint32


@final
@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """std_msgs/msg/Header."""

    stamp: Time
    frame_id: str


@final
@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """std_msgs/msg/String."""

    data: str


@final
@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    """rosgraph_msgs/msg/Clock."""

    clock: Time


@final
@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """sensor_msgs/msg/JointState."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@final
@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """geometry_msgs/msg/Vector3."""

    x: float64
    y: float64
    z: float64


@final
@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    """geometry_msgs/msg/Quaternion."""

    x: float64
    y: float64
    z: float64
    w: float64


@final
@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    """geometry_msgs/msg/Twist."""

    linear: Vector3
    angular: Vector3


@final
@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    """geometry_msgs/msg/Transform."""

    translation: Vector3
    rotation: Quaternion


@final
@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    """geometry_msgs/msg/TransformStamped."""

    header: Header
    child_frame_id: str
    transform: Transform


@final
@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    """tf2_msgs/msg/TFMessage."""

    transforms: sequence[TransformStamped]


@final
@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    """sensor_msgs/msg/Image."""

    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@final
@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    """sensor_msgs/msg/RegionOfInterest."""

    x_offset: uint32
    y_offset: uint32
    height: uint32
    width: uint32
    do_rectify: bool


@final
@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    """sensor_msgs/msg/CameraInfo."""

    header: Header
    height: uint32
    width: uint32
    distortion_model: str
    d: sequence[float64]
    k: array[float64, 9]
    r: array[float64, 9]
    p: array[float64, 12]
    binning_x: uint32
    binning_y: uint32
    roi: RegionOfInterest


@final
@dataclass
class JointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectoryPoint_"):
    """trajectory_msgs/msg/JointTrajectoryPoint."""

    positions: sequence[float64]
    velocities: sequence[float64]
    accelerations: sequence[float64]
    effort: sequence[float64]
    time_from_start: Duration


@final
@dataclass
class JointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::JointTrajectory_"):
    """trajectory_msgs/msg/JointTrajectory."""

    header: Header
    joint_names: sequence[str]
    points: sequence[JointTrajectoryPoint]


@final
@dataclass
class MultiDOFJointTrajectoryPoint(IdlStruct, typename="trajectory_msgs::msg::dds_::MultiDOFJointTrajectoryPoint_"):
    """trajectory_msgs/msg/MultiDOFJointTrajectoryPoint."""

    transforms: sequence[Transform]
    velocities: sequence[Twist]
    accelerations: sequence[Twist]
    time_from_start: Duration


@final
@dataclass
class MultiDOFJointTrajectory(IdlStruct, typename="trajectory_msgs::msg::dds_::MultiDOFJointTrajectory_"):
    """trajectory_msgs/msg/MultiDOFJointTrajectory."""

    header: Header
    joint_names: sequence[str]
    points: sequence[MultiDOFJointTrajectoryPoint]


@final
@dataclass
class JointTolerance(IdlStruct, typename="control_msgs::msg::dds_::JointTolerance_"):
    """control_msgs/msg/JointTolerance."""

    name: str
    position: float64
    velocity: float64
    acceleration: float64


@final
@dataclass
class JointComponentTolerance(IdlStruct, typename="control_msgs::msg::dds_::JointComponentTolerance_"):
    """control_msgs/msg/JointComponentTolerance."""

    joint_name: str
    component: uint16
    position: float64
    velocity: float64
    acceleration: float64


@final
@dataclass
class FollowGoal(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_Goal_"):
    """The goal of control_msgs/action/FollowJointTrajectory."""

    trajectory: JointTrajectory
    multi_dof_trajectory: MultiDOFJointTrajectory
    path_tolerance: sequence[JointTolerance]
    component_path_tolerance: sequence[JointComponentTolerance]
    goal_tolerance: sequence[JointTolerance]
    component_goal_tolerance: sequence[JointComponentTolerance]
    goal_time_tolerance: Duration


@final
@dataclass
class UUID(IdlStruct, typename="unique_identifier_msgs::msg::dds_::UUID_"):
    """unique_identifier_msgs/msg/UUID."""

    uuid: array[uint8, 16]


@final
@dataclass
class SendGoalRequest(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_SendGoal_Request_"):
    """The goal, behind the header of rmw_cyclonedds_cpp."""

    guid: uint64
    seq: int64
    goal_id: UUID
    goal: FollowGoal


@final
@dataclass
class SendGoalResponse(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_SendGoal_Response_"):
    """Whether it was accepted."""

    guid: uint64
    seq: int64
    accepted: bool
    stamp: Time


@final
@dataclass
class GetResultRequest(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_GetResult_Request_"):
    """Whose result."""

    guid: uint64
    seq: int64
    goal_id: UUID


@final
@dataclass
class FollowResult(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_Result_"):
    """The result of control_msgs/action/FollowJointTrajectory."""

    error_code: int32
    error_string: str


@final
@dataclass
class GetResultResponse(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_GetResult_Response_"):
    """How it ended."""

    guid: uint64
    seq: int64
    status: int8
    result: FollowResult


@final
@dataclass
class Feedback(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_Feedback_"):
    """The feedback of control_msgs/action/FollowJointTrajectory."""

    header: Header
    joint_names: sequence[str]
    desired: JointTrajectoryPoint
    actual: JointTrajectoryPoint
    error: JointTrajectoryPoint
    multi_dof_joint_names: sequence[str]
    multi_dof_desired: MultiDOFJointTrajectoryPoint
    multi_dof_actual: MultiDOFJointTrajectoryPoint
    multi_dof_error: MultiDOFJointTrajectoryPoint


@final
@dataclass
class FeedbackMessage(IdlStruct, typename="control_msgs::action::dds_::FollowJointTrajectory_FeedbackMessage_"):
    """Feedback, and of which goal."""

    goal_id: UUID
    feedback: Feedback


@final
@dataclass
class GoalInfo(IdlStruct, typename="action_msgs::msg::dds_::GoalInfo_"):
    """action_msgs/msg/GoalInfo."""

    goal_id: UUID
    stamp: Time


@final
@dataclass
class CancelRequest(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Request_"):
    """The request of action_msgs/srv/CancelGoal."""

    guid: uint64
    seq: int64
    goal_info: GoalInfo


@final
@dataclass
class CancelResponse(IdlStruct, typename="action_msgs::srv::dds_::CancelGoal_Response_"):
    """Its response."""

    guid: uint64
    seq: int64
    return_code: int8
    goals_canceling: sequence[GoalInfo]


def graph_domain():
    """Return this process's domain: others may run tests on the same machine."""
    return 60 + os.getpid() % 150


class Node:
    """A participant of a domain, and what it hears."""

    def __init__(self, domain):
        """Join."""
        self.participant = DomainParticipant(domain)

    def listen(self, topic, kind, quality=RELIABLE):
        """Return a reader of a topic of ROS 2."""
        return DataReader(self.participant, Topic(self.participant, topic, kind), qos=quality)

    def talk(self, topic, kind):
        """Return a writer to one, once somebody listens."""
        writer = DataWriter(self.participant, Topic(self.participant, topic, kind), qos=RELIABLE)
        until(writer.get_matched_subscriptions)
        return writer

    def service(self, name, request, response):
        """Return a writer of requests and a reader of responses."""
        reader = self.listen(f"rr/{name}Reply", response)
        writer = self.talk(f"rq/{name}Request", request)
        until(reader.get_matched_publications)
        return writer, reader


def hear(reader, good=lambda _: True):
    """Return the next message that fits."""
    found = []

    def came():
        found.extend(own for own in reader.take(N=100) if hasattr(own, "__idl__") and good(own))
        return found

    until(came)
    return found[0]


def until(condition):
    """Wait for what others do."""
    end = time.monotonic() + PATIENCE
    while not (found := condition()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)
    return found


def stay_here(domain):
    """Keep a domain to this machine, as the server does with ROS_LOCALHOST_ONLY; the result is to be kept."""
    from nuno.robot.ros2.dds_bridge import LOCAL

    return Domain(domain, LOCAL)
