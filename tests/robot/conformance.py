"""What every robot behind ``RobotInterface`` does, whatever is behind it.

A test module makes a class of this one, with a fixture ``interface``: Talos' interface, the robot standing in its
posture, at rest. Where messages take their time, it widens ``lag``.
"""

from __future__ import annotations

import numpy as np
import pytest

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.goal import GoalStatus, ResultCode, Tolerances
from nuno.robot.interface import RobotInterface
from nuno.robot.trajectory import JointTrajectory
from nuno.shapes.coordinates import Coordinates

REACHED = 1.01e-3
"""[rad] What a goal counts as reached within, and rounding."""


def bent(interface: RobotInterface, **angles: float) -> np.ndarray:
    """Return the present angles with some joints elsewhere: ``larm_4`` is Talos' "arm_left_4_joint"."""
    wanted = interface.angle_vector()
    for short, angle in angles.items():
        side, number = short.split("_")
        wanted[interface.robot.joint_index(f"arm_{'left' if side == 'larm' else 'right'}_{number}_joint")] = angle
    return wanted


def raw(interface: RobotInterface, angle: float, seconds: float) -> JointTrajectory:
    """Return a trajectory of the head that no velocity limit has stretched."""
    return JointTrajectory(("head_1_joint", "head_2_joint"), [seconds], [[angle, 0.0]], [[0.0, 0.0]])


class Conformance:
    """The tests."""

    lag = 0.05
    """[s] of the robot's clock that may pass between what happens and when it is known: a few frames."""

    # Time

    def test_sleep_lets_the_clock_go_on(self, interface):
        """By as much as was asked for, at least."""
        before = interface.now()
        interface.sleep(0.2)
        assert 0.2 - 1e-9 <= interface.now() - before <= 0.2 + self.lag

    def test_wait_until_gives_up(self, interface):
        """After the timeout, and no sooner; with the condition's truth as its answer."""
        before = interface.now()
        assert not interface.wait_until(lambda: False, 0.1)
        assert 0.1 - 1e-9 <= interface.now() - before <= 0.1 + self.lag
        assert interface.wait_until(lambda: True, 0.1)

    # Joint states

    def test_angle_vector_without_angles_is_fresh(self, interface):
        """It waits for a joint state that is newer than the call."""
        before = interface.now()
        angles = interface.angle_vector()
        assert angles.shape == (len(interface.robot.joint_names),)
        assert interface.joint_state.time > before
        assert interface.update_robot_state() is True
        assert interface.update_robot_state(wait_until_update=True) is True

    def test_vectors_at_rest(self, interface):
        """Nothing moves, the controllers hold the joints where they are, and the knees bear the robot."""
        angles = interface.angle_vector()
        np.testing.assert_allclose(interface.potentio_vector(), angles, atol=1e-9)
        np.testing.assert_allclose(interface.reference_vector(), angles, atol=1e-9)
        np.testing.assert_allclose(interface.error_vector(), 0.0, atol=1e-9)
        np.testing.assert_allclose(interface.velocity_vector(), 0.0, atol=1e-9)
        knee = interface.robot.joint_index("leg_left_4_joint")
        assert abs(interface.torque_vector()[knee]) > 10.0  # [N m] half of 90 kg on bent knees

    def test_controllers_have_all_joints_once(self, interface):
        """The default controller is all of them, each also under its own name."""
        controllers = interface.default_controller()
        joints = [joint for own in controllers for joint in own["joint_names"]]
        assert sorted(joints) == sorted(interface.robot.joint_names)
        assert len(interface.controller_table["default_controller"]) == len(controllers)
        for own in controllers:
            assert len(interface.controller_table[own["controller_type"]]) == 1
        assert {"larm_controller", "rarm_controller", "head_controller"} < set(interface.controller_table)

    # Motions

    def test_angle_vector_returns_at_once_and_arrives_in_time(self, interface):
        """The angles come back, the motion goes on, and the wait returns when it ends."""
        wanted = bent(interface, larm_4=-0.9, rarm_4=-0.8)
        before = interface.now()
        np.testing.assert_array_equal(interface.angle_vector(wanted, 1.0), wanted)
        assert interface.now() - before < 0.5
        assert interface.is_interpolating()
        interface.sleep(0.2)
        assert interface.is_moving()
        assert interface.wait_interpolation() == [False] * len(interface.default_controller())
        assert 1.0 - 1e-9 <= interface.now() - before <= 1.0 + self.lag
        assert not interface.is_interpolating()
        np.testing.assert_allclose(interface.angle_vector(), wanted, atol=REACHED)
        assert not interface.is_moving()

    def test_angles_by_name(self, interface):
        """Other joints stay where they are."""
        before = interface.angle_vector()
        sent = interface.angle_vector({"head_1_joint": 0.3}, 0.8)
        interface.wait_interpolation()
        after = interface.angle_vector()
        head = interface.robot.joint_index("head_1_joint")
        assert sent[head] == 0.3 and abs(after[head] - 0.3) < REACHED
        np.testing.assert_allclose(np.delete(after, head), np.delete(before, head), atol=1e-9)

    def test_a_motion_is_a_cubic(self, interface):
        """From rest to rest, a quarter of the way in time is 5/32 of the way: 3 s^2 - 2 s^3."""
        head = interface.robot.joint_index("head_1_joint")
        interface.angle_vector({"head_1_joint": 0.4}, 2.0)
        start = interface.now()
        interface.sleep(0.5)
        state = interface.read_joint_state()
        s = (state.time - start) / 2.0
        told = state.positions[state.names.index("head_1_joint")]
        # 1.5 * 0.4 / 2 rad/s for as long as a message may take
        assert abs(told - 0.4 * (3 * s**2 - 2 * s**3)) < 0.3 * self.lag
        interface.wait_interpolation()
        assert abs(interface.angle_vector()[head] - 0.4) < REACHED

    def test_too_short_a_time_is_stretched(self, interface):
        """To what the velocity limits need, at least."""
        start, wanted = interface.angle_vector(), bent(interface, larm_1=-0.4)
        shortest = interface.angle_vector_duration(start, wanted)
        limit = interface.robot.velocity_limits[interface.robot.joint_index("arm_left_1_joint")]
        assert shortest == pytest.approx(np.abs(wanted - start).max() / limit)
        named = interface.angle_vector_duration(start, wanted, return_joint_names=True)
        assert max(named) == (pytest.approx(shortest), "arm_left_1_joint")
        before = interface.now()
        interface.angle_vector(wanted, 0.0)
        interface.wait_interpolation()
        # on a cubic at the limit's mean velocity the joint lags behind: it needs 1.097 times as long
        assert shortest <= interface.now() - before <= 1.11 * shortest + self.lag
        np.testing.assert_allclose(interface.angle_vector(), wanted, atol=REACHED)

    def test_no_time_is_a_multiple_of_the_shortest(self, interface):
        """Five times it by default; another scale where one is given."""
        start, wanted = interface.angle_vector(), bent(interface, larm_1=-0.4)
        shortest = interface.angle_vector_duration(start, wanted)
        for goal, options, factor in ((wanted, {}, 5.0), (start, {"time_scale": 3.0}, 3.0)):
            before = interface.now()
            interface.angle_vector(goal, **options)
            interface.wait_interpolation()
            assert interface.now() - before == pytest.approx(factor * shortest, abs=self.lag)

    def test_another_goal_preempts(self, interface):
        """The first ends as preempted, the second arrives, without a jump between."""
        client = interface.controller_table["head_controller"][0]
        interface.angle_vector({"head_1_joint": 0.6}, 2.0)
        first = client.goal
        interface.sleep(0.5)
        interface.angle_vector({"head_1_joint": -0.2}, 1.0)
        interface.wait_interpolation()
        assert first.status == GoalStatus.PREEMPTED
        assert client.goal.status == GoalStatus.SUCCEEDED and client.goal.code == ResultCode.SUCCESSFUL
        assert abs(interface.angle_vector()[interface.robot.joint_index("head_1_joint")] + 0.2) < REACHED

    def test_a_controller_moves_its_joints_only(self, interface):
        """And goes on while another is sent elsewhere."""
        start, wanted = interface.angle_vector(), bent(interface, larm_4=-0.9, rarm_4=-0.9)
        interface.angle_vector(wanted, 1.0, "larm_controller")
        interface.angle_vector({"head_1_joint": 0.2}, 0.5, "head_controller")
        assert interface.is_interpolating("larm_controller")
        assert interface.wait_interpolation("head_controller") == [False]
        assert interface.is_interpolating("larm_controller") and not interface.is_interpolating("rarm_controller")
        interface.wait_interpolation("larm_controller")
        after = interface.angle_vector()
        left, right = (interface.robot.joint_index(f"arm_{side}_4_joint") for side in ("left", "right"))
        assert abs(after[left] - wanted[left]) < REACHED
        assert abs(after[right] - start[right]) < 1e-9

    def test_sequence_goes_through_its_points(self, interface):
        """At their times, with the mean of the velocities before and after, resting where the joint turns back."""
        start = interface.angle_vector()[interface.robot.joint_index("head_1_joint")]
        points = [{"head_1_joint": start + change} for change in (0.2, 0.5, 0.3)]
        before = interface.now()
        sent = interface.angle_vector_sequence(points, [0.5, 0.5, 0.4])
        assert isinstance(sent, list) and len(sent) == 3
        trajectory = interface.controller_table["head_controller"][0].goal.asked
        np.testing.assert_allclose(trajectory.times, (0.5, 1.0, 1.4))
        mean = 0.5 * (0.2 / 0.5 + 0.3 / 0.5)
        np.testing.assert_allclose(trajectory.velocities[:, 0], (mean, 0.0, 0.0), atol=1e-9)
        interface.wait_interpolation()
        assert 1.4 - 1e-9 <= interface.now() - before <= 1.4 + self.lag
        np.testing.assert_allclose(interface.angle_vector(), sent[-1], atol=REACHED)

    def test_one_time_serves_a_whole_sequence(self, interface):
        """A number instead of a list; without any, five times the shortest of each."""
        points = [{"head_1_joint": angle} for angle in (0.2, 0.1)]
        interface.angle_vector_sequence(points, 0.6, "head_controller")
        goal = interface.controller_table["head_controller"][0].goal
        np.testing.assert_allclose(goal.asked.times, (0.6, 1.2))
        interface.wait_interpolation("head_controller")
        interface.angle_vector_sequence(points, controller_type="head_controller")
        goal = interface.controller_table["head_controller"][0].goal
        np.testing.assert_allclose(goal.asked.times, (0.5, 1.0), atol=1e-6)  # 0.1 rad at 1 rad/s
        interface.cancel_angle_vector()

    def test_velocities_on_arrival(self, interface):
        """Are part of what is sent."""
        speeds = np.zeros(len(interface.robot.joint_names))
        speeds[interface.robot.joint_index("head_1_joint")] = 0.1
        interface.angle_vector({"head_1_joint": 0.2}, 0.5, velocities=speeds)
        assert interface.controller_table["head_controller"][0].goal.asked.velocities[-1, 0] == 0.1
        interface.wait_interpolation()

    @pytest.mark.parametrize(("kind", "quarter"), [("linear", 0.25), ("minjerk", 0.103515625)])
    def test_interpolation(self, interface, kind, quarter):
        """Many points on a line, or on 10 s^3 - 15 s^4 + 6 s^5 (0.1035 at a quarter)."""
        start = interface.angle_vector()[interface.robot.joint_index("head_1_joint")]
        sent = interface.angle_vector({"head_1_joint": start + 0.4}, 2.0, interpolation=kind, interpolation_dt=0.1)
        assert len(sent) == 20
        trajectory = interface.controller_table["head_controller"][0].goal.asked
        assert trajectory.times[4] == pytest.approx(0.5)
        assert trajectory.positions[4, 0] == pytest.approx(start + 0.4 * quarter)
        interface.wait_interpolation()
        np.testing.assert_allclose(interface.angle_vector(), sent[-1], atol=REACHED)

    def test_start_time_delays(self, interface):
        """Nothing moves before it, and the motion is over when both times have passed."""
        before = interface.now()
        start = interface.angle_vector()
        interface.angle_vector({"head_1_joint": 0.3}, 0.6, start_time=0.4)
        interface.sleep(0.3)
        np.testing.assert_allclose(interface.angle_vector(), start, atol=1e-9)
        interface.wait_interpolation()
        assert 1.0 - 1e-9 <= interface.now() - before <= 1.0 + 2 * self.lag
        assert abs(interface.angle_vector()[interface.robot.joint_index("head_1_joint")] - 0.3) < REACHED

    def test_wait_interpolation_with_a_timeout(self, interface):
        """It tells what still moves."""
        interface.angle_vector({"head_1_joint": 0.3}, 2.0, "head_controller")
        before = interface.now()
        assert interface.wait_interpolation("head_controller", 0.2) == [True]
        assert interface.now() - before <= 0.2 + self.lag
        assert interface.wait_interpolation("head_controller") == [False]

    def test_cancel_holds(self, interface):
        """Where the joints are; the goal ends as preempted."""
        interface.angle_vector({"head_1_joint": 0.6}, 2.0)
        interface.sleep(0.5)
        interface.cancel_angle_vector()
        assert interface.wait_interpolation() == [False] * len(interface.controller_actions)
        assert interface.controller_table["head_controller"][0].goal.status == GoalStatus.PREEMPTED
        held = interface.angle_vector()
        interface.sleep(0.3)
        np.testing.assert_allclose(interface.angle_vector(), held, atol=1e-9)
        assert 0.01 < held[interface.robot.joint_index("head_1_joint")] < 0.59

    def test_stop_motion(self, interface):
        """Slows down in the time that it has."""
        head = interface.robot.joint_index("head_1_joint")
        interface.angle_vector({"head_1_joint": 0.6}, 2.0)
        interface.sleep(1.0)
        at = interface.angle_vector()[head]
        interface.stop_motion(0.4)
        # 0.45 rad/s in the middle of the way, less than half of that on average
        assert 0.0 < interface.angle_vector()[head] - at < 0.45 * (0.4 + self.lag)
        np.testing.assert_allclose(interface.velocity_vector(), 0.0, atol=1e-9)
        interface.angle_vector({"head_1_joint": 0.0}, 1.0)
        interface.stop_motion()
        assert not interface.is_interpolating()

    # What is refused

    def test_an_unknown_controller(self, interface):
        """Sends nothing, and says so; where there is no answer to give it is an error."""
        start = interface.angle_vector()
        assert interface.angle_vector(start, 1.0, "tail_controller") is False
        assert interface.angle_vector_sequence([start], [1.0], "tail_controller") is False
        for ask in (interface.wait_interpolation, interface.is_interpolating, interface.is_moving):
            with pytest.raises(UnknownNameError, match="tail_controller"):
                ask("tail_controller")

    def test_bad_goals_are_refused(self, interface):
        """NaN, another length, negative times, a scale below 1: nothing is sent."""
        good = interface.angle_vector()
        nan = good.copy()
        nan[3] = np.nan
        for call in (
            lambda: interface.angle_vector(nan, 1.0),
            lambda: interface.angle_vector(good[:-1], 1.0),
            lambda: interface.angle_vector(good, -1.0),
            lambda: interface.angle_vector(good, np.nan),
            lambda: interface.angle_vector(good, "soon"),
            lambda: interface.angle_vector(good, 1.0, start_time=-0.1),
            lambda: interface.angle_vector(good, 1.0, time_scale=0.5),
            lambda: interface.angle_vector(good, 1.0, velocities=nan),
            lambda: interface.angle_vector(good, 1.0, interpolation="cubic"),
            lambda: interface.angle_vector(good + 0.1, 1.0, interpolation="linear", interpolation_dt=1e-9),
            lambda: interface.angle_vector(good, 1e300),
            lambda: interface.controller_table["head_controller"][0].send_goal(raw(interface, 0.1, 1.0), np.nan),
            lambda: interface.angle_vector({"head_1_joint": np.inf}, 1.0),
            lambda: interface.angle_vector({"tail_joint": 0.1}, 1.0),
            lambda: interface.angle_vector_sequence([], []),
            lambda: interface.angle_vector_sequence([good, nan], [1.0, 1.0]),
            lambda: interface.angle_vector_sequence([good, good], [1.0]),
            lambda: interface.angle_vector_sequence([good, good], [1.0, -1.0]),
            lambda: interface.wait_interpolation(timeout=-1.0),
            lambda: interface.stop_motion(-1.0),
        ):
            with pytest.raises((InvalidInputError, UnknownNameError)):
                call()
        assert not interface.is_interpolating() and not interface.is_moving()

    def test_goals_beyond_limits_end_at_them(self, interface):
        """As a driver does whose commands saturate: the motion goes to the limit and counts as done."""
        head = interface.robot.joint_index("head_2_joint")
        limit = interface.robot.joint_limits[1][head]
        interface.angle_vector({"head_2_joint": limit + 0.3}, 2.0)
        interface.wait_interpolation()
        assert interface.controller_table["head_controller"][0].goal.status == GoalStatus.SUCCEEDED
        assert interface.angle_vector()[head] == pytest.approx(limit, abs=REACHED)

    def test_a_path_tolerance_that_is_violated(self, interface):
        """The goal is aborted with -4, and the joints hold."""
        client = interface.controller_table["head_controller"][0]
        # 1 rad in 0.3 s: the head turns at 1 rad/s at most and lags behind
        goal = client.send_goal(raw(interface, 1.0, 0.3), tolerances=Tolerances(path={"head_1_joint": 0.1}))
        interface.wait_interpolation("head_controller")
        assert (goal.status, goal.code) == (GoalStatus.ABORTED, ResultCode.PATH_TOLERANCE_VIOLATED)
        assert "head_1_joint" in goal.text
        held = interface.angle_vector()
        interface.sleep(0.2)
        np.testing.assert_allclose(interface.angle_vector(), held, atol=1e-9)

    def test_a_goal_tolerance_that_is_violated(self, interface):
        """Aborted with -5 once the goal's time and what it may be late are over; in time where that is enough."""
        client = interface.controller_table["head_controller"][0]
        strict = Tolerances(goal={"head_1_joint": 0.05}, goal_time=0.2)
        goal = client.send_goal(raw(interface, 1.0, 0.3), tolerances=strict)
        before = interface.now()
        interface.wait_interpolation("head_controller")
        assert (goal.status, goal.code) == (GoalStatus.ABORTED, ResultCode.GOAL_TOLERANCE_VIOLATED)
        assert 0.5 - 1e-9 <= interface.now() - before <= 0.5 + self.lag
        patient = Tolerances(goal={"head_1_joint": 0.05}, goal_time=2.0)
        goal = client.send_goal(raw(interface, 0.0, 0.1), tolerances=patient)
        interface.wait_interpolation("head_controller")
        assert (goal.status, goal.code) == (GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL)

    def test_joints_that_are_not_the_controllers(self, interface):
        """Too many, too few or others: rejected with -2, and what was under way goes on."""
        client = interface.controller_table["head_controller"][0]
        interface.angle_vector({"head_1_joint": 0.3}, 1.0, "head_controller")
        under_way = client.goal
        for names in (("head_1_joint",), ("head_1_joint", "torso_1_joint"), ("head_1_joint", "tail_joint")):
            goal = client.send_goal(JointTrajectory(names, [1.0], np.zeros((1, len(names)))))
            interface.wait_until(lambda goal=goal: goal.is_done, 1.0)
            assert goal.status in (GoalStatus.REJECTED, GoalStatus.ABORTED)
            assert goal.code == ResultCode.INVALID_JOINTS
        interface.wait_until(lambda: under_way.is_done, 2.0)
        assert under_way.status == GoalStatus.SUCCEEDED

    # Going

    def test_go_pos(self, interface):
        """The robot stands where it was to go, seen from where it stood; odometry tells."""
        start, base = interface.footprint(), interface.odom
        assert interface.go_pos(0.15, 0.05, 0.2) is True
        place = start.copy_coords().translate((0.15, 0.05, 0.0)).rotate(0.2, "z")
        end = interface.footprint()
        np.testing.assert_allclose(end.position, place.position, atol=2e-3)
        np.testing.assert_allclose(end.rotation, place.rotation, atol=2e-3)
        assert np.linalg.norm(interface.odom.position - base.position) > 0.1
        assert not interface.is_interpolating()

    def test_go_velocity_and_stop(self, interface):
        """It sets off and comes to rest when it is told, before it is there."""
        start = interface.footprint()
        assert interface.go_velocity(0.1, 0.0, 0.0, 6.0) is True
        interface.sleep(2.5)
        assert interface.go_stop() is True
        gone = start.to_local(interface.footprint().position[None])[0]
        assert 0.02 < gone[0] < 0.45
        state = interface.angle_vector()
        interface.sleep(0.2)
        np.testing.assert_allclose(interface.angle_vector(), state, atol=1e-9)

    def test_move_to(self, interface):
        """A place in the world, and in the frame between the soles."""
        place = interface.footprint().translate((0.1, 0.0, 0.0))
        assert interface.move_to(place, frame_id="world") is True
        np.testing.assert_allclose(interface.footprint().position, place.position, atol=2e-3)
        assert interface.move_to(Coordinates((0.0, 0.04, 0.0)), wait=False) is True
        assert interface.go_stop() is True
        with pytest.raises(UnknownNameError, match="tail"):
            interface.move_to("tail")
        with pytest.raises(InvalidInputError):
            interface.move_to((0.1, 0.0, 0.0))

    def test_going_is_refused(self, interface):
        """Faster than it can walk: false; what is no number: an error."""
        assert interface.go_velocity(5.0, 0.0, 0.0, wait=True) is False
        with pytest.raises(InvalidInputError):
            interface.go_pos(np.nan, 0.0, 0.0)
        with pytest.raises(InvalidInputError):
            interface.go_velocity(0.1, 0.0, 0.0, sec=-1.0)

    # Hands

    def test_grippers_close_and_open(self, interface):
        """A hand that closes tells whether it holds something, others whether they got there; the joint shows it."""
        joint = interface.robot.joint_index("gripper_left_joint")
        opened = interface.angle_vector()[joint]
        assert interface.start_grasp("larm") == [False]
        closed = interface.angle_vector()[joint]
        assert abs(closed - opened) > 0.3
        assert interface.move_gripper("larm", 0.5) == [True]
        assert interface.angle_vector()[joint] == pytest.approx(0.5 * (opened + closed), abs=REACHED)
        assert interface.stop_grasp() == [True, True]
        assert interface.angle_vector()[joint] == pytest.approx(opened, abs=REACHED)
        assert interface.move_gripper("arms", 0.2, wait=False) == []

    def test_grippers_refuse(self, interface):
        """Another arm, an opening out of range."""
        with pytest.raises(UnknownNameError, match="tail"):
            interface.move_gripper("tail", 0.0)
        with pytest.raises(InvalidInputError):
            interface.move_gripper("larm", 1.2)
        with pytest.raises(InvalidInputError):
            interface.move_gripper("larm", np.nan)

    # Sensors

    def test_inertial_measurement_at_rest(self, interface):
        """Gravity upwards and no turning; its orientation is that of the model's frame."""
        coords = interface.imucoords()
        upwards = coords.rotation @ interface.accel_vector()
        np.testing.assert_allclose(upwards, (0.0, 0.0, 9.81), atol=1e-6)
        np.testing.assert_allclose(interface.gyro_vector(), 0.0, atol=1e-9)

    def test_forces_at_rest(self, interface):
        """The ankles bear all but the feet, upright; a wrist bears its hand, downwards."""
        forces = interface.force_vector()
        assert set(forces) == {"larm", "rarm", "lleg", "rleg"}
        np.testing.assert_allclose(interface.force_vector("larm"), forces["larm"], atol=1e-6)
        interface.update_robot_state()
        robot = interface.robot
        legs = sum(robot.frame_pose(f"{side}_ankle").rotation @ forces[f"{side[0]}leg"] for side in ("left", "right"))
        assert 0.9 * 9.81 * robot.mass < legs[2] < 9.81 * robot.mass
        hand = robot.frame_pose("left_wrist").rotation @ forces["larm"]
        assert hand[2] < -5.0 and np.abs(hand[:2]).max() < 0.01 * abs(hand[2])
        assert interface.moment_vector("rarm").shape == (3,)
        with pytest.raises(UnknownNameError, match="tail"):
            interface.force_vector("tail")

    def test_zero_moment_point_at_rest(self, interface):
        """Below the centre of mass."""
        point = interface.zmp_vector("world")
        np.testing.assert_allclose(point[:2], interface.robot.centre_of_mass[:2], atol=1e-4)
        assert abs(point[2]) < 1e-4
        pose = interface.footprint()
        np.testing.assert_allclose(pose.to_world(interface.zmp_vector()[None])[0], point, atol=1e-6)
        with pytest.raises(InvalidInputError, match="wrt"):
            interface.zmp_vector("moon")

    # Controllers by name

    def test_add_controller(self, interface):
        """With actions a name stands for all controllers; without, it is the default from now on, and empty."""
        made = interface.add_controller("everything", create_actions=True)
        assert len(made) == len(interface.default_controller())
        assert interface.controller_table["everything"] == made
        assert interface.add_controller("nothing") == []
        assert interface.controller_type == "nothing"
