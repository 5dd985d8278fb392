"""Reaching: hands at their targets, feet where they are, nothing beyond its limits."""

import builtins

import numpy as np
import pytest

import nuno
from few_variants import few
from nuno.errors import InvalidInputError, MissingPackageError, UnknownNameError
from nuno.robot.support import distance_inside

HANDS = ("left_hand", "right_hand")
ARMS = ("arm_", "torso_", "shoulder", "elbow", "wrist", "waist")


def random_targets(robot, n):
    """Return n pairs of hand poses that are in reach, as a posture has them: balanced, and no links collide."""
    random = np.random.default_rng(7)
    lower, upper = robot.joint_limits
    free = np.array([any(part in joint for part in ARMS) for joint in robot.joint_names])
    standing = robot.angle_vector()
    found = []
    while len(found) < n:
        share = random.uniform(0.15, 0.85, len(lower))
        robot.angle_vector(np.where(free, lower + share * (upper - lower), standing))
        balanced = distance_inside(robot.support_polygon(), robot.centre_of_mass[:2]) > 0.03
        if balanced and not robot.self_collisions():
            found.append({hand: robot.frame_pose(hand) for hand in HANDS})
    robot.stand()
    return found


def check_reached(robot, result, targets, feet, outline):
    """Check a solution by the robot's own kinematics, not by what the result says of itself."""
    assert result.reached, result.reason
    for hand, target in targets.items():
        pose = robot.frame_pose(hand)
        if isinstance(target, nuno.Coordinates):
            assert np.linalg.norm(pose.position - target.position) < 5e-4  # the tolerance asked for; required are 2 mm
            cosine = 0.5 * (np.trace(pose.rotation.T @ target.rotation) - 1)
            assert np.arccos(min(1.0, cosine)) < 5e-3
        else:
            assert np.linalg.norm(pose.position - target) < 5e-4
    for foot, before in feet.items():
        now = robot.frame_pose(foot)
        assert np.linalg.norm(now.position - before.position) < 1e-4  # what a stance may move
        assert np.abs(now.rotation - before.rotation).max() < 1e-4
    lower, upper = robot.joint_limits
    assert (robot.angle_vector() >= lower).all() and (robot.angle_vector() <= upper).all()
    assert distance_inside(outline, robot.centre_of_mass[:2]) > 0.018  # 20 mm are asked for, 1 mm may be missing
    assert robot.self_collisions() == []


@pytest.mark.parametrize("kind", few(["poses", "points"], "poses"))
def test_60_of_60_targets_of_two_hands_are_reached(talos, kind):
    """What is required: every one of 60 random targets in reach, from standing, within 2 mm."""
    feet = {foot: talos.frame_pose(foot) for foot in talos.feet}
    outline = talos.support_polygon()
    for target in random_targets(talos, 60):
        talos.stand()
        targets = target if kind == "poses" else {hand: pose.position for hand, pose in target.items()}
        check_reached(talos, talos.reach(targets), targets, feet, outline)


def test_points_in_front_are_reached(talos):
    """Where a table is worked at, 0.7 to 1.0 m high: also one after another, without standing up between."""
    feet, outline = {foot: talos.frame_pose(foot) for foot in talos.feet}, talos.support_polygon()
    random = np.random.default_rng(2)
    for _ in range(10):
        x, y, z = random.uniform((0.35, 0.05, 0.7), (0.6, 0.3, 1.0), (2, 3)).T
        targets = {"left_hand": np.array((x[0], y[0], z[0])), "right_hand": np.array((x[1], -y[1], z[1]))}
        check_reached(talos, talos.reach(targets), targets, feet, outline)


def test_another_robot_reaches(g1):
    """G1, which has no SRDF, over what it can reach: 0.5 to 0.8 m high."""
    feet, outline = {foot: g1.frame_pose(foot) for foot in g1.feet}, g1.support_polygon()
    for point in ((0.25, 0.15, 0.55), (0.35, 0.2, 0.65), (0.3, 0.1, 0.8)):
        g1.stand()
        targets = {"left_hand": np.array(point), "right_hand": np.array((point[0], -0.2, 0.7))}
        check_reached(g1, g1.reach(targets), targets, feet, outline)


def test_one_hand_leaves_the_other_free(talos):
    """Only what is named goes to a target; another frame than a hand may."""
    feet, outline = {foot: talos.frame_pose(foot) for foot in talos.feet}, talos.support_polygon()
    targets = {"right_wrist": np.array((0.5, -0.3, 1.1))}
    check_reached(talos, talos.reach(targets), targets, feet, outline)


def test_it_keeps_its_balance(talos):
    """A target far ahead, for which it would fall over, is reached in balance when that is asked for."""
    target, outline = {"left_hand": np.array((1.2, 0.3, 0.8))}, talos.support_polygon()
    assert talos.reach(target, stance=["left_foot"])  # one foot alone is held: balance is not asked for
    assert distance_inside(outline, talos.centre_of_mass[:2]) < 0.0
    talos.stand()
    feet = {foot: talos.frame_pose(foot) for foot in talos.feet}
    check_reached(talos, talos.reach(target), target, feet, outline)


@pytest.mark.parametrize("target", [(3.0, 0.0, 1.0), (0.3, 0.2, 2.6), (0.0, 0.085, 0.06)])
def test_what_is_out_of_reach_is_said_to_be(talos, target):
    """Too far, too high, inside its own foot: no pose, a reason, and the robot stays."""
    before = talos.configuration()
    result = talos.reach({"left_hand": target})
    assert not result and not result.reached
    assert result.angles is None and result.configuration is None
    assert result.reason
    np.testing.assert_array_equal(talos.configuration(), before)
    if target[2] < 0.1:
        assert "runs into" in result.reason
    else:
        assert "left_hand comes no nearer than" in result.reason
    if target[0] > 1.0:
        assert 1.0 < result.position_errors["left_hand"] < 3.0


def test_a_search_may_leave_the_robot_as_it_is(talos):
    """``move=False``: the angles are returned, and are those that it would take."""
    before = talos.configuration()
    result = talos.reach({"left_hand": (0.5, 0.2, 0.9)}, move=False)
    np.testing.assert_array_equal(talos.configuration(), before)
    talos.take_configuration(result.configuration)
    np.testing.assert_array_equal(talos.angle_vector(), result.angles)
    np.testing.assert_allclose(talos.frame_pose("left_hand").position, (0.5, 0.2, 0.9), atol=5e-4)


def test_the_same_call_gives_the_same_answer(talos):
    """Determinism, also where other starts are tried."""
    target = random_targets(talos, 3)[-1]
    answers = []
    for _ in range(2):
        talos.stand()
        answers.append(talos.reach(target, move=False).configuration)
    np.testing.assert_array_equal(*answers)


def test_bad_targets_raise_and_change_nothing(talos):
    """Named errors that say what is valid."""
    before = talos.configuration()
    for targets, error, message in (
        ({}, InvalidInputError, "at least one"),
        ({"tail": (0, 0, 1)}, UnknownNameError, "no frame named 'tail'"),
        ({"left_hand": (0, 1)}, InvalidInputError, "target of 'left_hand'"),
        ({"left_hand": (0, 1, np.nan)}, InvalidInputError, "finite"),
        ({"left_foot": (0, 0.1, 0)}, InvalidInputError, "stance"),
    ):
        with pytest.raises(error, match=message):
            talos.reach(targets)
    with pytest.raises(InvalidInputError, match="attempts"):
        talos.reach({"left_hand": (0.5, 0.2, 0.9)}, attempts=0)
    np.testing.assert_array_equal(talos.configuration(), before)


def test_a_missing_package_is_named(talos, monkeypatch):
    """Without pink, reaching says how to install it."""
    real = builtins.__import__

    def without_pink(name, *args, **kwargs):
        if name == "pink":
            raise ImportError("no pink", name="pink")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without_pink)
    with pytest.raises(MissingPackageError, match=r"pip install .* '\.\[robot\]'"):
        talos.reach({"left_hand": (0.5, 0.2, 0.9)})
