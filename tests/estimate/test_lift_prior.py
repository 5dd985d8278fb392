"""How far sideways a hand goes that lifts a cloth: the density, its shares, and what it does not hang on."""

import numpy as np
import pytest

from nuno.camera.rectangle import ClothRectangle
from nuno.estimate.lift_prior import FARTHER, LOWEST, TOUCH, log_prior_of_lift, log_prior_of_start, log_priors_of_ways

TOP = 0.72  # [m]


def rectangle(yaw=0.0, mirrored=False):
    """A cloth of 0.6 x 0.4 m whose first corner is above x = y = 0."""
    axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    if mirrored:
        axes[1] *= -1
    flat = np.array([[0, 0], [0.6, 0], [0.6, 0.4], [0, 0.4]]) @ axes
    corners = np.column_stack([flat, np.full(4, TOP)])
    return ClothRectangle(corners, 0.6, 0.4, corners.mean(axis=0), yaw, 0.0)


@pytest.mark.parametrize(("up", "share"), [(0.4, 0.5), (0.3, 1.0)])
def test_shares_of_hands_within_a_distance(up, share):
    """The density's integral in closed form: pi s^2 over all, and 1 - 1 / (1 + (r / s)^2) of it within r."""
    s = up * share
    # fine near 0, where half of it is; beyond 300 s there is 1e-5 of it
    r = s * np.sinh(np.linspace(0.0, np.arcsinh(300.0), 2001))
    density = [
        np.exp(log_prior_of_lift(rectangle(), [(0.0, 0.0)], (-x, 0.0, TOP + up), share)[0]) for x in r
    ]  # fmt: skip
    rings = np.array(density) * 2 * np.pi * r
    within = np.concatenate([[0.0], np.cumsum((rings[1:] + rings[:-1]) / 2 * np.diff(r))])
    # the trapezoid rule on steps of 0.3 % of r
    np.testing.assert_allclose(within, np.pi * s * s * (1 - 1 / (1 + (r / s) ** 2)), rtol=1e-4, atol=1e-7)
    for times, share_within in ((1, 0.5), (2, 0.8), (3, 0.9)):
        assert np.interp(times * s, r, within) / (np.pi * s * s) == pytest.approx(share_within, abs=1e-4)


@pytest.mark.parametrize("mirrored", [False, True])
def test_points_are_where_they_lie_on_the_table(mirrored):
    """By fractions of the sides, of a cloth at any yaw and labelled either way round; straight above is 0."""
    yaw = 0.7
    sign = -1.0 if mirrored else 1.0
    at = np.array((0.3 * 0.6, 0.9 * 0.4 * sign))  # [m] of (0.3, 0.9) along the cloth's axes
    turned = at @ [[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]
    points = np.array([(0.3, 0.9), (0.8, 0.9), (0.3, 0.4)])  # 0, 0.3 and 0.2 m from it
    found = log_prior_of_lift(rectangle(yaw, mirrored), points, (*turned, TOP + 0.5), 0.5)
    np.testing.assert_allclose(found, -2 * np.log1p((np.array((0.0, 0.3, 0.2)) / 0.25) ** 2), atol=1e-12)


@pytest.mark.parametrize("up", [LOWEST, 0.05, 0.0, -0.4])
def test_a_hand_that_is_low_counts_as_at_the_lowest(up):
    """Dragged over the table, or hung over its edge: the scale is not below that of a lift of 0.2 m."""
    found = log_prior_of_lift(rectangle(), [(0.5, 0.5)], (0.3 + 0.1, 0.2, TOP + up), 0.5)
    assert found[0] == pytest.approx(-2 * np.log(2.0), rel=1e-12)


def test_where_a_path_begins_tells_the_point():
    """At the cloth it is known to the hand's deviation, the density's scale there; higher up the lift's prior holds."""
    uv = [(0.0, 0.0), (1.0, 0.0)]
    touched = log_prior_of_start(rectangle(), uv, (0.0, 0.0, TOP), 0.03)
    np.testing.assert_allclose(touched, (0.0, -2.0 * np.log1p((0.6 / 0.03) ** 2)), rtol=1e-12)
    np.testing.assert_allclose(
        log_prior_of_start(rectangle(), uv, (0.0, 0.0, TOP), 0.0)[1], -2.0 * np.log1p((0.6 / TOUCH) ** 2)
    )
    high = log_prior_of_start(rectangle(), uv, (0.0, 0.0, TOP + 0.4), 0.0)
    # hypot(0.2, TOUCH) is 0.2 to 0.13 %
    np.testing.assert_allclose(high, log_prior_of_lift(rectangle(), uv, (0.0, 0.0, TOP + 0.4), 0.5), rtol=3e-3)


def test_who_goes_up_first_goes_farther_sideways():
    """The same density, wider: at 0 as much lower as its area is larger."""
    hand = (0.0, 0.0, TOP + 0.4)
    straight, up_first = log_priors_of_ways(rectangle(), [(0.0, 0.0), (1.0, 0.0)], hand, 0.5)
    np.testing.assert_array_equal(straight, log_prior_of_lift(rectangle(), [(0.0, 0.0), (1.0, 0.0)], hand, 0.5))
    assert up_first[0] == pytest.approx(-2.0 * np.log(FARTHER))
    # 0.6 m sideways of a lift of 0.4 m is 3 s of the one and 3 / FARTHER of the other
    assert up_first[1] - straight[1] == pytest.approx(
        2.0 * np.log(10.0 / (1.0 + (3.0 / FARTHER) ** 2)) - 2.0 * np.log(FARTHER)
    )
    np.testing.assert_array_equal(log_priors_of_ways(rectangle(), [(0.0, 0.0)], hand, None), np.zeros((2, 1)))
