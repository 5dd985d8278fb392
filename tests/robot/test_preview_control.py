"""Preview control: its gains solve the Riccati equation, and the zero moment point goes where it is to go."""

import numpy as np
import pytest

from nuno.errors import InvalidInputError
from nuno.robot.preview_control import ERROR_WEIGHT, GRAVITY, JERK_WEIGHT, PreviewControl

HEIGHT = 0.87


@pytest.fixture(scope="module")
def control():
    """A controller at the height of Talos."""
    return PreviewControl(HEIGHT)


def test_the_gains_solve_the_riccati_equation(control):
    """P = A'PA - A'Pb (r + b'Pb)^-1 b'PA + Q, and the gains are those of its solution."""
    a, b, p = control.augmented, control.augmented_entry, control.riccati
    scale = JERK_WEIGHT + (b.T @ p @ b)[0, 0]
    q = np.diag([ERROR_WEIGHT, 0.0, 0.0, 0.0])
    residual = a.T @ p @ a - a.T @ p @ b @ b.T @ p @ a / scale + q - p
    assert np.abs(residual).max() < 1e-8 * np.abs(p).max()  # of doubles; the entries span six decades
    gains = (b.T @ p @ a)[0] / scale
    np.testing.assert_allclose([control.error_gain, *control.state_gains], gains, rtol=1e-12)
    assert np.abs(np.linalg.eigvals(a - b @ gains[None])).max() < 1.0


def test_the_cart_obeys_its_equation(control):
    """Exact for a constant jerk: x = t^3/6, and p = x - h/g x'' (Kajita et al. 2003, eq. 8)."""
    state = np.zeros(3)
    for _ in range(100):
        state = control.transition @ state + control.entry
    np.testing.assert_allclose(state, [0.5**3 / 6, 0.5**2 / 2, 0.5], rtol=1e-12)
    assert np.isclose(control.output @ state, 0.5**3 / 6 - HEIGHT / GRAVITY * 0.5, rtol=1e-12)


def test_a_cart_at_rest_stays(control):
    """Wherever the origin is: the gains on the reference sum up to that on the position."""
    state = np.zeros((3, 2))
    state[0] = 7.0, -3.0
    states, sums = control.follow(np.tile([7.0, -3.0], (200, 1)), state)
    assert np.abs(states - state).max() < 1e-9  # rounding of gains of 1e5
    assert np.abs(sums).max() < 1e-9


def test_the_point_follows_steps_and_the_centre_moves_before_it(control):
    """Two steps of 0.1 m, blended over 0.2 s: the error stays under 3 mm, and the centre of mass sets off early."""
    time = 0.005 * np.arange(1400)
    share = np.clip((time[:, None] - [2.5, 4.0]) / 0.2, 0.0, 1.0)
    reference = np.repeat((0.1 * share).sum(axis=1)[:, None], 2, axis=1)
    states, _ = control.follow(reference, np.zeros((3, 2)))
    point = np.einsum("k,nkj->nj", control.output, states)
    assert np.abs(point - reference).max() < 3e-3  # corners of the reference: a jerk weighs something
    before = states[np.searchsorted(time, 2.4), 0, 0]
    # closed form: ahead of a step, the bounded solution is half the step times exp(-w t)
    closed = 0.05 * np.exp(-np.sqrt(GRAVITY / HEIGHT) * 0.2)
    assert abs(before - closed) < 0.1 * closed  # of the blend, the later step and the horizon


def test_joining_a_reference_asks_for_no_jolt(control):
    """A step 0.5 s after the start: without the detour the point would be thrown about."""
    reference = np.zeros((800, 2))
    reference[100:] = 0.05
    still = np.zeros((3, 2))
    thrown = np.einsum("k,nkj->nj", control.output, control.follow(reference, still)[0])
    joined = np.einsum("k,nkj->nj", control.output, control.follow(control.joined(reference, still), still)[0])
    assert np.abs(thrown[:50]).max() > 0.2
    assert np.abs(joined[:50]).max() < 0.06
    np.testing.assert_array_equal(control.joined(reference, still)[100:], reference[100:])


@pytest.mark.parametrize("height", [0.0, -1.0, np.nan])
def test_a_height_must_be_positive(height):
    """Named errors."""
    with pytest.raises(InvalidInputError, match="height must be > 0"):
        PreviewControl(height)


def test_a_joined_reference_asks_for_the_state_that_there_is(control):
    """Its divergent component, the integral of w exp(-w t) p(t), is x + x'/w of the state (Takenaka et al. 2009)."""
    n = 4000
    reference = np.where(np.arange(n)[:, None] * control.tick < 1.0, (0.0, 0.0), (0.05, -0.02))
    state = np.array([[0.01, 0.02], [0.03, -0.05], [0.0, 0.0]])
    joined = control.joined(reference, state)
    w = np.sqrt(GRAVITY / HEIGHT)
    times = np.arange(n) * control.tick
    asked = np.trapezoid(w * np.exp(-w * times)[:, None] * joined, times, axis=0) + np.exp(-w * times[-1]) * joined[-1]
    # the trapezium rule over ticks of 5 ms, of a function whose time constant is 0.3 s
    np.testing.assert_allclose(asked, state[0] + state[1] / w, atol=2e-5)
    np.testing.assert_array_equal(joined[times > 0.5], reference[times > 0.5])
