"""Turns about the hand's vertical: geometry, prior, and what they do to the evidence."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nuno import Camera, InvalidInputError
from nuno.estimate.ranking import Comparison, rank
from nuno.estimate.rotations import DEVIATION, TURNS, checked_turns, log_prior, turn, view_of_turned

HAND = np.array((0.1, -0.2, 1.05))


def make_camera(distortion=None):
    """A camera 0.9 m before the origin, looking down, rolled by 3 degrees."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", (-120, 3, -90), degrees=True).as_matrix()
    pose[:3, 3] = (-0.9, 0.1, 1.4)
    return Camera(640, 480, 510.0, 505.0, 319.5, 239.5, pose, distortion)


def test_a_turn_is_about_the_vertical_through_the_hand():
    """As SciPy turns it; heights and the hand stay."""
    points = np.random.default_rng(1).normal(size=(4, 7, 3))
    turned = turn(points, HAND, 0.4)
    expected = Rotation.from_rotvec((0, 0, 0.4)).apply((points - HAND).reshape(-1, 3)).reshape(4, 7, 3) + HAND
    np.testing.assert_allclose(turned, expected, atol=1e-14)
    np.testing.assert_allclose(turn(HAND, HAND, 0.4), HAND, atol=1e-15)


@pytest.mark.parametrize("distortion", [None, (-0.2, 0.05, 1e-3, -5e-4)])
def test_the_turned_view_sees_what_the_camera_sees_of_a_turned_cloth(distortion):
    """Pixels and depths, to rounding; a turn of 0 is the camera itself."""
    camera = make_camera(distortion)
    points = HAND + np.random.default_rng(2).uniform(-0.3, 0.3, (50, 3))
    turned = view_of_turned(camera, HAND, -0.3)
    np.testing.assert_allclose(turned.project(points), camera.project(turn(points, HAND, -0.3)), atol=1e-9)
    np.testing.assert_allclose(turned.depth_of(points), camera.depth_of(turn(points, HAND, -0.3)), atol=1e-12)
    assert view_of_turned(camera, HAND, 0.0) is camera


def test_the_prior_adds_up_to_one():
    """It is normal, and certain where there is one turn only."""
    logs = log_prior(TURNS)
    assert np.exp(logs).sum() == pytest.approx(1.0, abs=1e-15)
    at, none = TURNS[0], TURNS.index(0.0)
    assert logs[none] - logs[0] == pytest.approx(0.5 * (at / DEVIATION) ** 2)
    assert log_prior([0.0]) == [0.0]


@pytest.mark.parametrize("turns", [(), (0.1, -0.1), (0.0, np.nan), [[0.0]], "none"])
def test_turns_must_hold_none(turns):
    """Numbers, 0 among them."""
    with pytest.raises(InvalidInputError, match="turns"):
        checked_turns(turns)


def comparison(turns, chamfer):
    """One guess at two candidates whose overlap is perfect."""
    chamfer = np.asarray(chamfer, dtype=float)
    return Comparison(
        np.arange(2), np.asarray(turns, dtype=float), chamfer, np.ones_like(chamfer), 1 - chamfer / 100,
        np.ones(chamfer.shape[1:], dtype=bool),
    )  # fmt: skip


def test_the_evidence_is_averaged_over_turns():
    """Likelihood 1 / (1 + chamfer)^5, weighed by the prior; contour distance and eq. (1) look at no turn alone."""
    turns = (-DEVIATION, 0.0, DEVIATION)
    seen = comparison(turns, [[[0.0, 9.0]], [[9.0, 1.0]], [[9.0, 9.0]]])
    side = np.exp(-0.5)
    prior = np.array((side, 1.0, side)) / (1 + 2 * side)
    expected = prior @ (np.array([(1, 10), (10, 2), (10, 10)], dtype=float) ** -5)
    ranked = rank([seen], "evidence", 2)
    np.testing.assert_allclose(np.exp(ranked.scores), expected, rtol=1e-12)
    assert ranked.order[0] == 0  # turned, the first fits perfectly
    assert rank([seen], "chamfer", 2).order[0] == 1
    np.testing.assert_allclose(rank([seen], "chamfer", 2).scores, (-9.0, -1.0))
    np.testing.assert_allclose(ranked.eq1, (0.91, 0.99))


def test_one_turn_is_no_turn():
    """The evidence is then that of the futures as they are, as the formula says."""
    ranked = rank([comparison([0.0], [[[3.0, 1.0]]])], "evidence", 2)
    np.testing.assert_allclose(ranked.scores, -5.0 * np.log1p((3.0, 1.0)), rtol=1e-12)
