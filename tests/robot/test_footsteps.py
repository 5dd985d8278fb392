"""Footsteps: they end where they are to end, alternate, and no sole comes near the other."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from nuno.errors import InvalidInputError, WalkError
from nuno.robot.footsteps import (
    LEFT,
    RIGHT,
    Footstep,
    footsteps_along,
    footsteps_to,
    middle_of,
    moved,
    relative,
    screw,
    screw_to,
    sole_gap,
    steps_of_velocity,
)
from nuno.robot.stride import Stride

STRIDE = Stride(step_length=0.2, side_step=0.08, turn_step=0.25, lift=0.05, stance=0.17)
FEET = np.array([[0.0, 0.085, 0.0], [0.0, -0.085, 0.0]])
SIZES = [np.array([0.211, 0.124])] * 2
GOALS = [(1.0, 0, 0), (-0.5, 0, 0), (0, 0.3, 0), (0, -0.3, 0), (0, 0, 1.5), (0, 0, -1.5), (1, 0.4, 0.8), (-1, 2, 3.1)]


def stances(steps, feet):
    """Yield both feet after each step."""
    now = feet.copy()
    for step in steps:
        now[step.foot] = step.pose
        yield now.copy()


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (3.0, -2.0, 2.5)])
def test_steps_end_at_the_goal_side_by_side(goal, start):
    """Exact: the middle of the feet is the goal, which is seen from where they stood, and they stand as before."""
    start = np.array(start)
    feet = np.array([moved(start, foot) for foot in FEET])
    steps = footsteps_to(moved(start, np.array(goal)), feet, STRIDE)
    *_, last = stances(steps, feet)
    end = relative(start, middle_of(last))
    np.testing.assert_allclose(end[:2], goal[:2], atol=1e-12)
    assert abs(math.remainder(end[2] - goal[2], math.tau)) < 1e-12
    np.testing.assert_allclose(sorted(relative(middle_of(last), foot)[1] for foot in last), [-0.085, 0.085], atol=1e-12)


@pytest.mark.parametrize("goal", GOALS)
def test_feet_alternate_within_the_stride_and_apart(goal):
    """The body goes no further a step than the stride allows, and soles keep 10 mm between them."""
    steps = footsteps_to(np.array(goal, dtype=float), FEET, STRIDE, SIZES)
    assert all(a.foot != b.foot for a, b in itertools.pairwise(steps))
    before = FEET
    for feet in stances(steps, FEET):
        assert sole_gap(feet, SIZES) > 0.01
        step = relative(middle_of(before), middle_of(feet))
        assert abs(step[0]) < 0.5 * 2 * STRIDE.step_length + 0.03  # a foot goes two steps far, its middle one
        assert abs(step[2]) <= 0.5 * STRIDE.turn_step + 1e-9  # one of two feet turns by it
        before = feet


def test_to_the_right_the_right_foot_opens():
    """And to the left the left one; ahead, there is one step more than the distance asks for, which closes."""
    assert footsteps_to(np.array([0, -0.1, 0.0]), FEET, STRIDE)[0].foot == RIGHT
    assert footsteps_to(np.array([0, 0.1, 0.0]), FEET, STRIDE)[0].foot == LEFT
    assert len(footsteps_to(np.array([0.8, 0, 0.0]), FEET, STRIDE)) == 5
    assert footsteps_to(np.array([0.0, 0, 0.0]), FEET, STRIDE) == ()


def test_a_screw_is_a_velocity_that_is_kept():
    """Against many small moves, and its inverse; exact on a quarter circle."""
    twist = np.array([0.7, -0.2, 1.9])
    pose = np.zeros(3)
    for _ in range(100000):
        pose = moved(pose, twist / 100000)
    np.testing.assert_allclose(screw(twist), pose, atol=1e-5)  # 1/n of the pieces
    np.testing.assert_allclose(screw_to(screw(twist)), twist, atol=1e-12)
    np.testing.assert_allclose(screw(np.array([0.5 * np.pi, 0, 0.5 * np.pi])), [1, 1, 0.5 * np.pi], atol=1e-12)


def test_feet_that_stand_apart_are_put_side_by_side():
    """Also where the robot is to stay."""
    feet = FEET + np.array([[0.1, 0, 0], [0, 0, 0]])
    *_, last = stances(footsteps_to(middle_of(feet), feet, STRIDE, SIZES), feet)
    np.testing.assert_allclose(last, FEET + np.array([0.05, 0, 0]), atol=1e-9)
    assert footsteps_to(middle_of(FEET), FEET, STRIDE, SIZES) == ()


def test_steps_of_a_velocity():
    """1 s a step; the way is the velocity times the time."""
    assert steps_of_velocity(np.array([0.1, 0, 0]), 5.0, STRIDE) == 5
    steps = footsteps_along(np.array([0.5, 0, 0.5]), FEET, STRIDE, 5)
    *_, last = stances(steps, FEET)
    np.testing.assert_allclose(middle_of(last), screw(np.array([0.5, 0, 0.5])), atol=1e-12)
    with pytest.raises(InvalidInputError, match=r"faster than the stride allows; that way at most \[0.2, 0.0, 0.0\]"):
        steps_of_velocity(np.array([0.3, 0, 0]), 5.0, STRIDE)


def test_the_gap_between_soles():
    """Closed form: side by side, turned by a quarter, one on the other."""
    assert np.isclose(sole_gap(FEET, SIZES), 0.17 - 0.124)
    turned = np.array([[0.0, 0.2, 0.5 * np.pi], [0.0, 0.0, 0.0]])
    assert np.isclose(sole_gap(turned, SIZES), 0.2 - 0.5 * 0.211 - 0.5 * 0.124)
    assert sole_gap(np.zeros((2, 3)), SIZES) < 0.0


@pytest.mark.parametrize("bad", [(2, 0, 0, 0), (0, np.nan, 0, 0), (0, 0, 0, np.inf)])
def test_bad_footsteps_are_refused(bad):
    """Named errors: another foot, not finite."""
    with pytest.raises(InvalidInputError):
        Footstep(*bad)


def test_a_place_that_is_too_far_is_refused():
    """At once, and not where another way takes fewer: 12 m aside by turning first."""
    stride = replace(STRIDE, side_step=0.1)
    assert len(footsteps_to(np.array([0.0, 12.0, 0.0]), FEET, stride, SIZES)) <= 100
    with pytest.raises(WalkError, match=r"at most 100 steps, and 1000000\.0 m take more: go there in several walks"):
        footsteps_to(np.array([1e6, 0, 0]), FEET, STRIDE, SIZES)
