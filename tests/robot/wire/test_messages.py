"""ROS 2 messages, and what they are here."""

import json

import numpy as np
import pytest

from nuno.errors import InvalidInputError, MessageError
from nuno.robot.goal import Tolerances
from nuno.robot.readings import ImuReading, JointState
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.wire import messages as ros


def through(fields):
    """Fields as the other side gets them."""
    return json.loads(json.dumps(fields))


@pytest.mark.parametrize("time", [0.0, 1.5, 12345.678901234, -0.25])
def test_times(time):
    """Whole seconds and nanoseconds, never negative nanoseconds, as builtin_interfaces has it."""
    fields = ros.time_fields(time)
    assert isinstance(fields["sec"], int)
    assert 0 <= fields["nanosec"] < 10**9
    assert ros.seconds({"t": fields}, "t") == pytest.approx(time, abs=1e-9)  # a nanosecond is the least that is told


def test_joint_state_both_ways():
    """What joints tell arrives as it was."""
    state = JointState(2.25, ("a", "b"), np.array([0.1, -0.2]), np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    told = ros.read_joint_state(through(ros.joint_state_fields(state)))
    assert (told.time, told.names) == (2.25, ("a", "b"))
    for what in ("positions", "velocities", "efforts"):
        assert getattr(told, what).tolist() == getattr(state, what).tolist()


def test_joint_state_of_a_real_driver():
    """Drivers without torque sensors send null or nothing; a joint without a position is not known."""
    told = ros.read_joint_state(
        {"name": ["a", "b", "c"], "position": [1.0, None, 3.0], "velocity": [], "effort": [None, None, 2.0]}
    )
    assert told.names == ("a", "c")
    assert (told.positions.tolist(), told.velocities.tolist(), told.efforts.tolist()) == ([1, 3], [0, 0], [0, 2])


def test_trajectory_both_ways():
    """Positions, velocities, accelerations and tolerances arrive as they were."""
    points = np.array([[0.1, 0.2], [0.3, 0.4]])
    sent = JointTrajectory(("a", "b"), np.array([0.5, 1.25]), points, 2 * points, 3 * points)
    tolerances = Tolerances({"a": 0.01}, {"b": 0.02}, 0.5)
    told, start, allowed = ros.read_follow(through(ros.follow_fields(sent, 7.5, tolerances)))
    assert (told.names, told.times.tolist(), start) == (("a", "b"), [0.5, 1.25], 7.5)
    for what in ("positions", "velocities", "accelerations"):
        assert getattr(told, what).tolist() == getattr(sent, what).tolist()
    assert (allowed.path, allowed.goal, allowed.goal_time) == (tolerances.path, tolerances.goal, 0.5)


def test_trajectory_now_and_without_velocities():
    """A stamp of zero means at once; what is left out is not there."""
    sent = JointTrajectory(("a",), np.array([1.0]), np.array([[0.1]]))
    told, start, allowed = ros.read_follow(through(ros.follow_fields(sent)))
    assert (start, allowed, told.velocities, told.accelerations) == (None, None, None, None)


POINT = {"positions": [0.1], "time_from_start": {"sec": 1, "nanosec": 0}}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"points": []}, "at least one point"),
        ({"points": [POINT | {"positions": [0.1, 0.2]}]}, "point 0 has 2 positions for 1 joints"),
        ({"points": [POINT | {"positions": []}]}, "point 0 has 0 positions"),
        ({"points": [POINT | {"positions": [float("nan")]}]}, "finite"),
        ({"points": [POINT | {"positions": [1e999]}]}, "finite"),
        ({"points": [POINT | {"positions": ["far"]}]}, "numbers"),
        ({"points": [POINT | {"positions": [None]}]}, "finite"),
        ({"points": [POINT | {"positions": {}}]}, "must be a list"),
        ({"points": [POINT | {"velocities": [1.0, 2.0]}]}, "2 velocities"),
        ({"points": [POINT | {"time_from_start": {"sec": -1}}]}, "times"),
        ({"points": [POINT | {"time_from_start": {"sec": "soon"}}]}, "must be a number"),
        ({"points": [POINT, POINT]}, "increase"),
        ({"points": [7]}, "must lie in messages"),
        ({"points": 7}, "must be a list"),
        ({"joint_names": [3]}, "must be strings"),
        ({"joint_names": []}, "for 0 joints"),
        ({"joint_names": ["a", "a"]}, "for 2 joints"),
        ({"header": {"stamp": 5}}, "must be a Mapping"),
    ],
)
def test_bad_trajectories_are_named(change, said):
    """What is no trajectory is refused, and the refusal says where and why."""
    with pytest.raises(InvalidInputError, match=said):
        ros.read_follow({"trajectory": {"joint_names": ["a"], "points": [POINT]} | change})


def test_missing_trajectory():
    """A goal without its trajectory lists what it has."""
    with pytest.raises(MessageError, match=r"'trajectory' is missing; there are: points"):
        ros.read_follow({"points": []})


def test_sensors_both_ways():
    """Forces and the inertial measurement unit arrive as they were."""
    force, torque = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    told = ros.read_wrench(through(ros.wrench_fields(1.0, (force, torque), "left_wrist")))
    assert (told[0].tolist(), told[1].tolist()) == (force.tolist(), torque.tolist())
    reading = ImuReading(1.5, np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 9.81]))
    imu = ros.read_imu(through(ros.imu_fields(reading, "imu")))
    assert (imu.time, imu.quaternion.tolist()) == (1.5, [0.5, 0.5, 0.5, 0.5])
    assert imu.angular_velocity.tolist() == [1, 2, 3]
    assert imu.linear_acceleration.tolist() == [0, 0, 9.81]


def test_places_both_ways():
    """A place on the floor arrives with its frame and turn."""
    frame, place = ros.read_pose(through(ros.pose_fields(0.0, "base_footprint", 0.5, -0.25, 0.3)))
    assert frame == "base_footprint"
    np.testing.assert_allclose(place.position, [0.5, -0.25, 0.0])
    np.testing.assert_allclose(place.quaternion, [np.cos(0.15), 0, 0, np.sin(0.15)], atol=1e-15)  # rounding of unit
    assert ros.read_twist(through(ros.twist_fields(0.1, 0.2, 0.3))) == (0.1, 0.2, 0.3)


def test_points_are_read_at_once(monkeypatch):
    """Of a goal of thousands of points none is looked at by itself; what is read is the same as one by one."""
    points = [
        {"positions": [0.001 * k, 1], "velocities": [0.1, -0.2], "accelerations": [],
         "time_from_start": {"sec": k // 1000, "nanosec": 1_000_000 * (k % 1000) + 1}}
        for k in range(5000)
    ]  # fmt: skip
    message = {"joint_names": ["a", "b"], "points": points}
    slow = {"joint_names": ["a", "b"], "points": [*points[:-1], points[-1] | {"positions": [4.999, None]}]}
    with pytest.raises(MessageError, match="positions"):
        ros.read_trajectory(slow)
    with monkeypatch.context() as patch:
        patch.setattr(ros, "_tables", lambda points, width: None)
        patch.setattr(ros, "_times", lambda points: None)
        expected, _ = ros.read_trajectory(message)
    monkeypatch.setattr(ros, "reals", None)
    monkeypatch.setattr(ros, "seconds", lambda message, path, default=None: 0.0)  # of the header
    found, _ = ros.read_trajectory(message)
    for what in ("times", "positions", "velocities"):
        np.testing.assert_array_equal(getattr(found, what), getattr(expected, what))
    assert found.accelerations is None


@pytest.mark.parametrize("value", ["1", None, [1.0], float("nan"), 10**400])
def test_a_point_that_is_none(value):
    """A value that is no number is named, in positions and in times."""
    point = {"positions": [0.0], "time_from_start": {"sec": 1}}
    for wrong in ({"positions": [value]}, {"time_from_start": {"sec": value}}):
        if wrong.get("time_from_start") == {"sec": None}:
            continue  # left out: it is zero, as in ROS
        with pytest.raises((MessageError, InvalidInputError)):
            ros.read_trajectory({"joint_names": ["a"], "points": [point | wrong]})
