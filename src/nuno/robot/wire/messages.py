"""ROS 2 messages as the wire carries them, fields by name, and what they are here."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from nuno.errors import MessageError
from nuno.robot.goal import Tolerances
from nuno.robot.readings import ImuReading, JointState
from nuno.robot.trajectory import JointTrajectory
from nuno.shapes.coordinates import Coordinates
from nuno.validation import finite_array, number

Fields = dict[str, Any]

CLOCK = "rosgraph_msgs/msg/Clock"
JOINT_STATE = "sensor_msgs/msg/JointState"
CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
STATUS = "action_msgs/msg/GoalStatusArray"
IMU = "sensor_msgs/msg/Imu"
WRENCH = "geometry_msgs/msg/WrenchStamped"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TWIST = "geometry_msgs/msg/Twist"
ODOMETRY = "nav_msgs/msg/Odometry"
STRING = "std_msgs/msg/String"
FOLLOW = "control_msgs/action/FollowJointTrajectory"
GRIPPER = "control_msgs/action/GripperCommand"
NAVIGATE = "nav2_msgs/action/NavigateToPose"
ADVANCE = "nuno_msgs/srv/Advance"
GO_VELOCITY = "nuno_msgs/action/GoVelocity"

NUMBERS = (float, int)
"""Types of numbers in JSON; bool is another."""
MAX_TIME = 2.0**31 - 1.0  # [s] what the wire has 32 bits for


# Fields of messages that were received


def field(message: Any, path: str, kind: type | tuple[type, ...] = object, default: Any = None) -> Any:
    """Return a field of a message, or ``default`` where it is left out: ROS fills such fields with zeros.

    Args:
        message: Its fields.
        path: The field's name, with dots within nested messages: "header.stamp".
        kind: What it must be.
        default: In its place; None where it may not be left out.

    Raises:
        MessageError: it is not there, or of another type.
    """
    found = message
    for name in path.split("."):
        if not isinstance(found, Mapping):
            raise MessageError(f"{path!r} must lie in messages, got a {type(found).__name__}")
        if found.get(name) is None:
            if default is None:
                raise MessageError(f"a field {path!r} is missing; there are: {', '.join(map(str, found)) or 'none'}")
            return default
        found = found[name]
    if not isinstance(found, kind):
        kinds = " or ".join(own.__name__ for own in (kind if isinstance(kind, tuple) else (kind,)))
        raise MessageError(f"{path!r} must be a {kinds}, got a {type(found).__name__}")
    return found


def real(message: Any, path: str, default: float | None = None) -> float:
    """Return a finite number of a message.

    Raises:
        MessageError: the field holds something else.
    """
    value = field(message, path, default=default)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise MessageError(f"{path!r} must be a number, got a {type(value).__name__}")
    return number(path, value)


def reals(message: Any, path: str, length: int | None = None) -> np.ndarray:
    """Return finite numbers of a message, (length,) float; none where the field is left out."""
    value = field(message, path, list, default=[])
    if not value and length in (None, 0):
        return np.zeros(0)
    return finite_array(path, value, ("k",) if length is None else (length,), error=MessageError)


def vector(message: Any, path: str) -> np.ndarray:
    """Return a vector or point of a message, (3,) float."""
    return np.array([real(message, f"{path}.{axis}", 0.0) for axis in "xyz"])


def names(message: Any, path: str) -> tuple[str, ...]:
    """Return strings of a message.

    Raises:
        MessageError: the field holds something else.
    """
    found = field(message, path, list, default=[])
    if not all(isinstance(name, str) for name in found):
        raise MessageError(f"{path!r} must be strings")
    return tuple(found)


def seconds(message: Any, path: str, default: float | None = None) -> float:
    """Return a time or duration of a message [s]."""
    value = field(message, path, Mapping, default={} if default is not None else None)
    if not value and default is not None:
        return default
    return real(value, "sec", 0.0) + 1e-9 * real(value, "nanosec", 0.0)


# Fields of messages to send


def time_fields(time: float) -> Fields:
    """Return a time or duration [s] as builtin_interfaces has it."""
    whole = round(min(max(time, -MAX_TIME), MAX_TIME) * 1e9)
    return {"sec": whole // 10**9, "nanosec": whole % 10**9}


def header_fields(time: float, frame: str = "") -> Fields:
    """Return a std_msgs/msg/Header."""
    return {"stamp": time_fields(time), "frame_id": frame}


def vector_fields(value: Sequence[float] | np.ndarray) -> Fields:
    """Return a geometry_msgs/msg/Vector3, or a Point."""
    return dict(zip("xyz", map(float, value), strict=True))


def quaternion_fields(value: Sequence[float] | np.ndarray) -> Fields:
    """Return a geometry_msgs/msg/Quaternion of one that is (w, x, y, z)."""
    return dict(zip("wxyz", map(float, value), strict=True))


# Both ways


def joint_state_fields(state: JointState) -> Fields:
    """Return a sensor_msgs/msg/JointState."""
    return {
        "header": header_fields(state.time), "name": list(state.names), "position": state.positions.tolist(),
        "velocity": state.velocities.tolist(), "effort": state.efforts.tolist(),
    }  # fmt: skip


def read_joint_state(message: Fields) -> JointState:
    """Return what a sensor_msgs/msg/JointState says.

    Drivers that do not measure something leave it out, or send what is no number: then velocities and efforts are zero,
    and a joint without a position is not among the names.

    Raises:
        MessageError: a field that is missing or of another type, or lengths that do not fit.
    """
    joints = names(message, "name")
    positions = _measured(message, "position", len(joints))
    known = np.isfinite(positions)
    motion = [np.nan_to_num(_measured(message, what, len(joints)))[known] for what in ("velocity", "effort")]
    return JointState(
        seconds(message, "header.stamp", 0.0), tuple(joint for joint, own in zip(joints, known, strict=True) if own),
        positions[known], *motion,
    )  # fmt: skip


def _measured(message: Fields, path: str, length: int) -> np.ndarray:
    """Return numbers of a message, (length,) float, NaN where there are none."""
    found = field(message, path, list, default=[]) or [None] * length
    try:
        values = np.array(found, dtype=float)  # None becomes NaN
    except (TypeError, ValueError) as error:
        raise MessageError(f"{path!r} must be numbers, got {str(found)[:60]}") from error
    if values.shape != (length,):
        raise MessageError(f"{path!r} has {len(found)} numbers for {length} joints")
    return values


def trajectory_fields(trajectory: JointTrajectory, start: float | None = None) -> Fields:
    """Return a trajectory_msgs/msg/JointTrajectory.

    Args:
        trajectory: It.
        start: When it begins [s] of the robot's clock; None is when it arrives, which is a stamp of zero.
    """
    nothing: list[list[float]] = [[]] * len(trajectory.times)
    tables = [nothing if own is None else own.tolist()
              for own in (trajectory.positions, trajectory.velocities, trajectory.accelerations)]  # fmt: skip
    points = [
        {
            "positions": positions, "velocities": velocities, "accelerations": accelerations, "effort": [],
            "time_from_start": time_fields(time),
        }
        for time, positions, velocities, accelerations in zip(trajectory.times.tolist(), *tables, strict=True)
    ]  # fmt: skip
    return {"header": header_fields(start or 0.0), "joint_names": list(trajectory.names), "points": points}


def read_trajectory(message: Fields) -> tuple[JointTrajectory, float | None]:
    """Return what a trajectory_msgs/msg/JointTrajectory says, and when it begins [s], None when it arrives.

    Raises:
        MessageError: a field that is missing, of another type or not finite, or lengths that do not fit.
        InvalidInputError: no trajectory: no joints or points, times that do not increase.
    """
    joints, points = names(message, "joint_names"), field(message, "points", list)
    if not points:
        raise MessageError("a trajectory needs at least one point")
    tables = _tables(points, len(joints)) or {
        what: _table(points, what, len(joints)) for what in ("positions", "velocities", "accelerations")
    }
    times = _times(points)
    if times is None:
        times = np.array([seconds(point, "time_from_start", 0.0) for point in points])
    start = seconds(message, "header.stamp", 0.0)
    positions = tables.pop("positions")
    assert positions is not None  # of the checks above
    return JointTrajectory(joints, times, positions, **tables), start or None


def _tables(points: list[Any], width: int) -> dict[str, np.ndarray | None] | None:
    """Return the numbers of all points at once, (k, width) float each; None where they must be looked at one by one."""
    tables: dict[str, np.ndarray | None] = {}
    try:
        for what in ("positions", "velocities", "accelerations"):
            rows = [point.get(what) or () for point in points]
            if not any(rows) and what != "positions":
                tables[what] = None
            elif not all(type(value) in NUMBERS for value in itertools.chain.from_iterable(rows)):
                return None
            else:
                tables[what] = np.array(rows, dtype=float)
    except (AttributeError, TypeError, ValueError, OverflowError):
        return None
    fits = all(table is None or (table.shape == (len(points), width) and np.isfinite(table).all())
               for table in tables.values())  # fmt: skip
    return tables if fits else None


def _table(points: list[Any], what: str, width: int) -> np.ndarray | None:
    """Return what points say of one thing, (k, width) float; None where they say nothing. Raises by name."""
    rows = [reals(point, what) for point in points]
    if all(len(row) == 0 for row in rows) and what != "positions":
        return None
    wrong = next((k for k, row in enumerate(rows) if len(row) != width), None)
    if wrong is not None:
        raise MessageError(f"point {wrong} has {len(rows[wrong])} {what} for {width} joints")
    return np.array(rows)


def _times(points: list[Any]) -> np.ndarray | None:
    """Return the times of all points at once, (k,) float [s]; None where they must be looked at one by one."""
    try:
        given = [point["time_from_start"] for point in points]
        parts = [(time.get("sec", 0), time.get("nanosec", 0)) for time in given]
        if not all(type(a) in NUMBERS and type(b) in NUMBERS for a, b in parts):
            return None
        whole, fraction = np.array(parts, dtype=float).T
        times = whole + 1e-9 * fraction
    except (AttributeError, KeyError, TypeError, ValueError, OverflowError):
        return None
    return times if np.isfinite(times).all() else None


def follow_fields(
    trajectory: JointTrajectory, start: float | None = None, tolerances: Tolerances | None = None
) -> Fields:
    """Return a goal of control_msgs/action/FollowJointTrajectory."""
    fields: Fields = {"trajectory": trajectory_fields(trajectory, start)}
    if tolerances is not None:
        fields["path_tolerance"] = _tolerance_fields(tolerances.path)
        fields["goal_tolerance"] = _tolerance_fields(tolerances.goal)
        fields["goal_time_tolerance"] = time_fields(tolerances.goal_time)
    return fields


def read_follow(message: Fields) -> tuple[JointTrajectory, float | None, Tolerances | None]:
    """Return what a goal of control_msgs/action/FollowJointTrajectory says; see ``read_trajectory``.

    Raises:
        MessageError: a field of another kind, or a negative tolerance.
    """
    trajectory, start = read_trajectory(field(message, "trajectory", Mapping))
    path, goal = _read_tolerances(message, "path_tolerance"), _read_tolerances(message, "goal_tolerance")
    late = seconds(message, "goal_time_tolerance", 0.0)
    if late < 0.0:
        raise MessageError(f"goal_time_tolerance must be at least 0, got {late} s")
    return trajectory, start, Tolerances(path, goal, late) if path or goal or late else None


def _tolerance_fields(tolerances: Mapping[str, float]) -> list[Fields]:
    """Return tolerances of positions by joint; one of zero, which in ROS is none that was given, becomes tiny."""
    return [{"name": joint, "position": max(value, 1e-12)} for joint, value in tolerances.items()]


def _read_tolerances(message: Fields, what: str) -> dict[str, float]:
    """Return tolerances of positions by joint; as in ROS, one that is not above zero is none."""
    given = {field(own, "name", str): real(own, "position", 0.0) for own in field(message, what, list, default=[])}
    return {joint: value for joint, value in given.items() if value > 0.0}


def imu_fields(reading: ImuReading, frame: str) -> Fields:
    """Return a sensor_msgs/msg/Imu; covariances of zero are unknown ones."""
    return {
        "header": header_fields(reading.time, frame),
        "orientation": quaternion_fields(reading.quaternion), "orientation_covariance": [0.0] * 9,
        "angular_velocity": vector_fields(reading.angular_velocity), "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": vector_fields(reading.linear_acceleration), "linear_acceleration_covariance": [0.0] * 9,
    }  # fmt: skip


def read_imu(message: Fields) -> ImuReading:
    """Return what a sensor_msgs/msg/Imu says.

    Raises:
        MessageError: a field that is of another type or not finite.
    """
    turn = np.array([real(message, f"orientation.{axis}", 1.0 if axis == "w" else 0.0) for axis in "wxyz"])
    return ImuReading(
        seconds(message, "header.stamp", 0.0), turn, vector(message, "angular_velocity"),
        vector(message, "linear_acceleration"),
    )  # fmt: skip


def wrench_fields(time: float, wrench: tuple[np.ndarray, np.ndarray], frame: str) -> Fields:
    """Return a geometry_msgs/msg/WrenchStamped of a force [N] and a torque [N m]."""
    force, torque = wrench
    both = {"force": vector_fields(force), "torque": vector_fields(torque)}
    return {"header": header_fields(time, frame), "wrench": both}


def read_wrench(message: Fields) -> tuple[np.ndarray, np.ndarray]:
    """Return the force (3,) [N] and torque (3,) [N m] of a geometry_msgs/msg/WrenchStamped.

    Raises:
        MessageError: a field that is of another type or not finite.
    """
    return vector(message, "wrench.force"), vector(message, "wrench.torque")


def pose_fields(time: float, frame: str, x: float, y: float, yaw: float) -> Fields:
    """Return a geometry_msgs/msg/PoseStamped of a place on the floor [m, rad]."""
    turn = quaternion_fields((math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)))
    return {"header": header_fields(time, frame), "pose": {"position": vector_fields((x, y, 0.0)), "orientation": turn}}


def read_pose(message: Fields) -> tuple[str, Coordinates]:
    """Return the frame and the pose of a geometry_msgs/msg/PoseStamped; without orientation it is not turned.

    Raises:
        MessageError: a field that is of another type or not finite.
    """
    frame = field(message, "header.frame_id", str, default="")
    return frame, read_coordinates(field(message, "pose", Mapping))


def read_coordinates(message: Any) -> Coordinates:
    """Return a geometry_msgs/msg/Pose.

    Raises:
        MessageError: a field that is of another type or not finite.
    """
    turn = [real(message, f"orientation.{axis}", 1.0 if axis == "w" else 0.0) for axis in "wxyz"]
    return Coordinates(vector(message, "position"), turn)


def twist_fields(x: float, y: float, yaw: float) -> Fields:
    """Return a geometry_msgs/msg/Twist of a velocity on the floor [m/s, rad/s]."""
    return {"linear": vector_fields((x, y, 0.0)), "angular": vector_fields((0.0, 0.0, yaw))}


def read_twist(message: Fields) -> tuple[float, float, float]:
    """Return the velocity on the floor of a geometry_msgs/msg/Twist [m/s, rad/s].

    Raises:
        MessageError: a field that is of another type or not finite.
    """
    linear, angular = vector(message, "linear"), vector(message, "angular")
    return float(linear[0]), float(linear[1]), float(angular[2])
