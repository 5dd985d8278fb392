"""Steps that catch a robot: the inverted pendulum's closed forms, and where the foot goes."""

import math

import numpy as np
import pytest

from nuno.robot.capture_step import PAST, CaptureStep, Pendulum, carried_on, lifted, nearest_in, outside

HALF = np.array([[-0.1, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.1, 0.06]])  # half sizes of a sole [m]
FEET = np.array([[0.0, 0.085, 0.0, 0.0], [0.0, -0.085, 0.0, 0.0]])


def pendulum(point, speed=(0.0, 0.0)):
    """A robot of 0.88 m with its capture point somewhere."""
    outlines = tuple(HALF + foot[:2] for foot in FEET)
    rate = math.sqrt(9.81 / 0.88)
    return Pendulum(np.array(point), np.array(speed), rate, 0.88, FEET.copy(), outlines, 0.17)


def test_the_capture_point_moves_as_a_pendulum_s():
    """C'' = w^2 (c - p), integrated in steps of 10 us, has its capture point where ``after`` says."""
    own, support = pendulum((0.12, 0.02)), np.array([0.05, -0.03])
    centre, speed = np.array([0.02, 0.01]), None
    speed = own.rate * (own.point - centre)
    for _ in range(30000):
        speed = speed + 1e-5 * own.rate**2 * (centre - support)
        centre = centre + 1e-5 * speed
    # symplectic Euler of a step h is off by some w h of the way
    np.testing.assert_allclose(own.after(0.3, support), centre + speed / own.rate, rtol=2e-4)


def test_over_the_capture_point_it_comes_to_rest():
    """Over a zero moment point that is the capture point it stays: the definition."""
    own = pendulum((0.3, 0.1))
    np.testing.assert_allclose(own.after(1.0, own.point), own.point)


@pytest.mark.parametrize(
    ("point", "nearest"),
    [((0.02, 0.03), (0.02, 0.03)), ((0.2, 0.0), (0.1, 0.0)), ((0.3, 0.4), (0.1, 0.06)), ((0.0, -1.0), (0.0, -0.06))],
)
def test_the_nearest_point_of_a_sole(point, nearest):
    """Itself inside, on an edge, at a corner."""
    np.testing.assert_allclose(nearest_in(HALF, np.array(point)), nearest)


def test_it_steps_past_where_the_pendulum_goes():
    """Pushed ahead: the sole's middle lands ``PAST`` beyond the capture point that there will be, beside the other."""
    own = pendulum((0.13, 0.0))
    step = lifted(own, (True, True), 2.0)
    other = 1 - step.foot
    inner = nearest_in(own.inner(other), own.point)
    ahead = own.after(step.air, inner)[0]
    assert step.goal[0] == pytest.approx(ahead, abs=PAST + 1e-9) and step.goal[0] > ahead
    assert abs(step.goal[1] - FEET[other, 1]) >= 0.17 - 1e-9
    assert step.time == 2.0 and step.landed is None


def test_a_foot_in_the_air_is_the_one_that_steps():
    """Its next landing is all that can still be chosen."""
    for foot in (0, 1):
        assert lifted(pendulum((0.12, 0.0)), tuple(k != foot for k in (0, 1)), 0.0).foot == foot


def test_where_no_foot_comes_near_none_is_lifted():
    """Pushed hard aside, past the outer sole: both feet stay, and trunk and arms do what they can."""
    assert lifted(pendulum((0.0, 0.6)), (True, True), 0.0) is None


def test_a_step_lands_and_ends():
    """It goes from start to goal, lands when it touches in the second half only, and is over at rest."""
    own = pendulum((0.13, 0.0))
    step = lifted(own, (True, True), 0.0)
    np.testing.assert_allclose(step.pose(0.0, 0.0), [*FEET[step.foot]], atol=1e-12)
    end = step.pose(step.air, 0.01)
    np.testing.assert_allclose(end, [*step.goal[:2], 0.01, step.goal[2]], atol=1e-12)
    assert step.pose(0.5 * step.air, 0.0)[2] > 0.03
    assert carried_on(step, own, True, 0.2 * step.air).landed is None
    landed = carried_on(step, own, True, 0.9 * step.air)
    assert landed.landed == pytest.approx(0.9 * step.air)
    moving = pendulum((0.1, 0.0), (0.3, 0.0))
    assert not carried_on(landed, moving, True, 10.0).is_finished
    assert carried_on(landed, own, True, 10.0).is_finished
    assert isinstance(landed, CaptureStep) and landed.foot == step.foot


def test_outside_is_beyond_the_edge():
    """By more than is allowed."""
    assert not outside(HALF, np.array([0.105, 0.0]), 0.01)
    assert outside(HALF, np.array([0.115, 0.0]), 0.01)
    assert outside(HALF, np.array([0.095, 0.0]), -0.01)
