"""Where the hand may be instead of where it is told: shifts and their priors."""

import numpy as np
import pytest

import nuno
from nuno.estimate.hand_error import STEP, poses_of
from nuno.estimate.rotations import TURNS, log_prior, view_of_turned

CAMERA = nuno.Camera(64, 48, 60.0, 60.0, 31.5, 23.5, np.diag([1.0, -1.0, -1.0, 1.0]))


def test_shifts_lie_across_the_view_and_up_and_down():
    """By 1.5 standard deviations either way, none of them turned."""
    poses = poses_of(CAMERA, np.array(TURNS), 0.02)
    still = len(TURNS)
    np.testing.assert_array_equal(poses.turns, [*TURNS, 0.0, 0.0, 0.0, 0.0])
    assert not poses.shifts[:still].any()
    far = STEP * 0.02
    np.testing.assert_allclose(poses.shifts[still:], [(far, 0, 0), (-far, 0, 0), (0, 0, far), (0, 0, -far)])


def test_priors_are_normal_and_add_up_to_one():
    """Beside no turn and no shift, a shift by s standard deviations has exp(-s^2 / 2)."""
    poses = poses_of(CAMERA, np.array(TURNS), 0.02)
    assert np.exp(poses.log_priors).sum() == pytest.approx(1.0, abs=1e-12)
    none = TURNS.index(0.0)
    np.testing.assert_allclose(poses.log_priors[len(TURNS) :] - poses.log_priors[none], -0.5 * STEP**2)
    np.testing.assert_allclose(np.diff(poses.log_priors[: len(TURNS)]), np.diff(log_prior(TURNS)))


def test_a_hand_that_is_known_exactly_has_no_shifts():
    """Then the turns alone are left, with their priors as they are."""
    poses = poses_of(CAMERA, np.array(TURNS), 0.0)
    assert len(poses.turns) == len(TURNS) and not poses.shifts.any()
    np.testing.assert_array_equal(poses.log_priors, log_prior(TURNS))


def test_a_shifted_body_is_seen_from_a_shifted_camera():
    """What is turned and shifted then projects to where the other camera sees it before."""
    point, hand, shift = np.array((0.1, -0.05, -0.8)), np.array((0.05, 0.0, -0.9)), (0.01, 0.02, -0.03)
    angle = 0.4
    c, s = np.cos(angle), np.sin(angle)
    moved = hand + np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ (point - hand) + shift
    seen = view_of_turned(CAMERA, hand, angle, shift).project(point)
    np.testing.assert_allclose(seen, CAMERA.project(moved), atol=1e-9)
