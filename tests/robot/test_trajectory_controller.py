"""The trajectory controller: goals, and what becomes of them."""

import numpy as np
import pytest

from nuno.robot.goal import GoalStatus, ResultCode, Tolerances
from nuno.robot.trajectory import JointTrajectory
from nuno.robot.trajectory_controller import Later, TrajectoryController

ROWS = np.array([0, 1])
STEP = 0.01


def controller(limits=None):
    """Return a controller of two joints at 0."""
    return TrajectoryController(("a", "b"), np.zeros(2), limits)


def goal_to(position, seconds=1.0, velocities=((0.0, 0.0),), names=("a", "b")):
    """Return a trajectory with one point."""
    return JointTrajectory(names, [seconds], [position], velocities)


def run(own, start, end, lag=0.0):
    """Advance from one time to another, the joints lagging behind by ``lag``; return the last motion wanted."""
    desired = own.piece.at(start)
    for time in np.arange(start + STEP, end + 0.5 * STEP, STEP):
        own.advance(time)
        desired = own.piece.at(time)
        actual = (desired[0] - lag, desired[1], desired[2])
        own.check(time, desired, actual, ROWS)
    return desired


def test_a_goal_is_reached_and_succeeds():
    """Active until its time, then done with 0, and the joints rest there."""
    own = controller()
    goal = own.accept(goal_to((1.0, -1.0)), 5.0)
    assert goal.status == GoalStatus.ACTIVE and own.is_busy
    run(own, 5.0, 5.9)
    assert goal.status == GoalStatus.ACTIVE
    np.testing.assert_allclose(goal.feedback.desired[0], own.piece.at(5.9)[0])
    np.testing.assert_allclose(goal.feedback.error, 0.0)
    desired = run(own, 5.9, 6.0)
    assert (goal.status, goal.code, own.is_busy) == (GoalStatus.SUCCEEDED, ResultCode.SUCCESSFUL, False)
    np.testing.assert_allclose(desired[0], (1.0, -1.0))
    np.testing.assert_allclose(desired[1], 0.0, atol=1e-12)


def test_another_goal_starts_from_the_reference():
    """Position and velocity are continuous; the first goal ends as preempted."""
    own = controller()
    first = own.accept(goal_to((1.0, 0.0)), 0.0)
    before = run(own, 0.0, 0.5)
    second = own.accept(goal_to((0.0, 1.0)), 0.5)
    after = own.piece.at(0.5)
    np.testing.assert_allclose(after[0], before[0])
    np.testing.assert_allclose(after[1], before[1])
    assert before[1][0] == pytest.approx(1.5)  # [rad/s] the middle of a cubic
    assert first.status == GoalStatus.PREEMPTED and second.status == GoalStatus.ACTIVE
    run(own, 0.5, 1.5)
    assert second.status == GoalStatus.SUCCEEDED


def test_a_goal_that_starts_later_lets_the_motion_go_on():
    """Until its start; it joins that motion there."""
    own = controller()
    own.accept(goal_to((1.0, 0.0)), 0.0)
    other = controller()
    other.accept(goal_to((1.0, 0.0)), 0.0)
    later = own.accept(goal_to((0.0, 0.0)), 0.2, start_time=0.505)
    for time in (0.3, 0.5, 0.7):
        own.advance(time)
        np.testing.assert_allclose(own.piece.at(time)[0], other.piece.at(time)[0])
    own.advance(0.71)  # it began at 0.705
    start = own.piece.at(0.705)
    np.testing.assert_allclose(start[0], other.piece.at(0.705)[0])
    np.testing.assert_allclose(start[1], other.piece.at(0.705)[1])
    assert later.status == GoalStatus.ACTIVE
    run(own, 0.71, 1.71)
    assert later.status == GoalStatus.SUCCEEDED


def test_a_trajectory_that_comes_late_is_joined_where_it_is():
    """Its points that have passed are left out; one that is all over is rejected."""
    own = controller()
    trajectory = JointTrajectory(("a", "b"), [1.0, 2.0], [[1.0, 0.0], [2.0, 0.0]])
    goal = own.accept(trajectory, 10.0, start_time=-0.5)
    assert goal.status == GoalStatus.ACTIVE
    np.testing.assert_allclose(own.piece.at(10.25)[0], (0.5, 0.0))  # from 0 to 1 in the half second that is left
    run(own, 10.0, 11.5)
    assert goal.status == GoalStatus.SUCCEEDED
    over = own.accept(trajectory, 20.0, start_time=-2.5)
    assert (over.status, over.code) == (GoalStatus.REJECTED, ResultCode.INVALID_GOAL)


@pytest.mark.parametrize("names", [("a",), ("a", "c"), ("a", "b", "c")])
def test_other_joints_are_rejected(names):
    """With -2, and the goal under way goes on."""
    own = controller()
    under_way = own.accept(goal_to((1.0, 0.0)), 0.0)
    goal = own.accept(JointTrajectory(names, [1.0], np.zeros((1, len(names)))), 0.1)
    assert (goal.status, goal.code) == (GoalStatus.REJECTED, ResultCode.INVALID_JOINTS)
    assert under_way.status == GoalStatus.ACTIVE and own.goal is under_way
    odd = own.accept(goal_to((1.0, 0.0)), 0.1, tolerances=Tolerances(path={"c": 0.1}))
    assert (odd.status, odd.code) == (GoalStatus.REJECTED, ResultCode.INVALID_JOINTS)


def test_joints_in_another_order():
    """Go where they are to go by name."""
    own = controller()
    own.accept(goal_to((1.0, -1.0), names=("b", "a")), 0.0)
    np.testing.assert_allclose(run(own, 0.0, 1.0)[0], (-1.0, 1.0))


def test_path_tolerance():
    """Violated: aborted with -4, held where the joints are. Kept: nothing happens."""
    own = controller()
    goal = own.accept(goal_to((1.0, 0.0)), 0.0, tolerances=Tolerances(path={"a": 0.2}))
    run(own, 0.0, 0.5, lag=0.19)
    assert goal.status == GoalStatus.ACTIVE
    desired = run(own, 0.5, 0.51, lag=0.21)
    assert (goal.status, goal.code) == (GoalStatus.ABORTED, ResultCode.PATH_TOLERANCE_VIOLATED)
    np.testing.assert_allclose(own.piece.at(9.0)[0], desired[0] - 0.21)
    np.testing.assert_allclose(own.piece.at(9.0)[1], 0.0)


def test_goal_tolerance():
    """Within it at the end: done. Beyond: waits as long as the goal may be late, then -5; for ever if 0."""
    for lag, late, status in (
        (0.09, 0.2, GoalStatus.SUCCEEDED),
        (0.11, 0.2, GoalStatus.ABORTED),
        (0.11, 0.0, GoalStatus.ACTIVE),
    ):
        own = controller()
        goal = own.accept(goal_to((1.0, 0.0)), 0.0, tolerances=Tolerances({}, {"a": 0.1, "b": 0.2}, late))
        run(own, 0.0, 1.19, lag)
        assert goal.status == (GoalStatus.ACTIVE if lag > 0.1 else status)
        run(own, 1.19, 1.25, lag)
        assert goal.status == status
        if status == GoalStatus.ABORTED:
            assert goal.code == ResultCode.GOAL_TOLERANCE_VIOLATED and "a is" in goal.text
    own = controller()
    late_but_there = own.accept(goal_to((1.0, 0.0)), 0.0)
    run(own, 0.0, 1.5, 0.1)
    assert late_but_there.status == GoalStatus.ACTIVE
    run(own, 1.5, 1.51, 0.0)
    assert late_but_there.status == GoalStatus.SUCCEEDED


def test_cancel_holds():
    """Where the joints are; a second cancel changes nothing."""
    own = controller()
    goal = own.accept(goal_to((1.0, 0.0)), 0.0)
    desired = run(own, 0.0, 0.4)
    own.cancel(desired[0])
    assert goal.status == GoalStatus.PREEMPTED and not own.is_busy
    np.testing.assert_array_equal(own.piece.at(0.9)[0], desired[0])
    own.cancel(desired[0])
    assert goal.status == GoalStatus.PREEMPTED


def test_goals_beyond_limits_are_taken_to_them():
    """The other points stay as they are."""
    own = controller((np.array([-0.5, -1.0]), np.array([0.5, 1.0])))
    own.accept(goal_to((2.0, 0.4)), 0.0)
    np.testing.assert_allclose(run(own, 0.0, 1.0)[0], (0.5, 0.4))


def test_a_trajectory_of_no_duration():
    """Is there at once."""
    own = controller()
    goal = own.accept(goal_to((1e-4, 0.0), 0.0), 0.0)
    run(own, 0.0, STEP)
    assert goal.status == GoalStatus.SUCCEEDED


def test_saved_and_loaded():
    """It goes on as it did, to the bit; the goal is active again, and one that came since is given up."""
    own = controller()
    goal = own.accept(goal_to((1.0, 0.0)), 0.0)
    run(own, 0.0, 0.3)
    saved = own.save()
    end = run(own, 0.3, 1.0)
    later = own.accept(goal_to((3.0, 0.0)), 1.0)
    own.load(saved)
    assert goal.status == GoalStatus.ACTIVE and later.status == GoalStatus.PREEMPTED
    np.testing.assert_array_equal(run(own, 0.3, 1.0)[0], end[0])
    assert goal.status == GoalStatus.SUCCEEDED


def test_what_is_to_come_is_followed_as_if_it_were_sent_then():
    """Two trajectories sent at 0.2 and 0.5 s, and a controller that is told of both before: equal, also looked ahead.

    Another one that is 1 s later goes the same way from the same rest.
    """
    first = JointTrajectory(("a", "b"), [0.3, 0.6], [[0.3, -0.1], [0.5, 0.2]], np.zeros((2, 2)))
    ways = [
        JointTrajectory(("a", "b"), [0.2, 0.5], [[0.1, 0.4], [-0.2, 0.3]], np.zeros((2, 2))),
        JointTrajectory(("b", "a"), [0.4], [[0.0, 1.0]]),
    ]
    sent = [Later(0.2, ways[0]), Later(0.5, ways[1].of(("a", "b")))]
    told, own, later = (TrajectoryController(("a", "b"), np.zeros(2)) for _ in range(3))
    told.accept(first, 0.0)
    saved = told.save()
    own.accept(first, 0.0)
    own.go_on(saved, sent)
    later.begin_anew(saved, sent, 0.0, 1.0, np.zeros(2))
    times = np.arange(1, 13) * 0.1
    ahead, goals = own.ahead(np.array([0.0, *times])), []
    for k, time in enumerate(times.tolist()):
        for each, step in ((told, time), (own, time), (later, 1.0 + time)):
            each.advance(step)
        np.testing.assert_array_equal(own.piece.at(time)[0], told.piece.at(time)[0])
        np.testing.assert_allclose(later.piece.at(1.0 + time)[0], told.piece.at(time)[0], atol=1e-12)
        np.testing.assert_allclose(ahead[k + 1], told.piece.at(time)[0], atol=1e-12)  # rounds in another order
        assert own.is_busy
        goals.append(own.goal)
        for each in (own, told):
            each.check(time, *[each.piece.at(time)] * 2, np.arange(2))
        for way in sent:
            if abs(time - way.start) < 1e-9:
                told.accept(way.trajectory, time)
        if time >= 0.9:
            break
    assert own.goal.succeeded and told.goal.succeeded and not own.is_busy
    assert [goal.status for goal in dict.fromkeys(goals)][:2] == [GoalStatus.PREEMPTED] * 2
    own.go_on(saved, sent)
    own.cancel(np.zeros(2))
    assert not own.is_busy and own.end == -np.inf
