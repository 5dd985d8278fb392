"""Least squares with NumPy alone, beside SciPy's."""

import numpy as np
import pytest
from scipy.optimize import least_squares as by_scipy

from nuno.camera.gauss_newton import least_squares


def test_a_linear_problem_takes_one_step():
    """The normal equations' solution, to rounding of the differences (1e-16 / `STEP`)."""
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((12, 4)), rng.standard_normal(12)
    at, cost = least_squares(lambda x: a @ x - b, np.zeros(4), steps=1)
    expected = np.linalg.solve(a.T @ a, a.T @ b)
    np.testing.assert_allclose(at, expected, atol=1e-9)
    assert cost == pytest.approx(float(((a @ expected - b) ** 2).sum()), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_curved_problems_end_where_scipy_does(seed):
    """A circle through noisy points, with priors: the same numbers to 1e-5, where the sum differs by less than 1e-8."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.0, 2.0, 20)
    points = 1.5 * np.column_stack([np.cos(angle), np.sin(angle)]) + (0.3, -0.2) + 0.02 * rng.standard_normal((20, 2))

    def residuals(x):
        return np.concatenate([(np.linalg.norm(points - x[:2], axis=1) - 1.0 - x[2]) / 0.02, 0.1 * x])

    at, cost = least_squares(residuals, np.zeros(3))
    found = by_scipy(residuals, np.zeros(3), xtol=1e-12, ftol=1e-12)
    np.testing.assert_allclose(at, found.x, atol=1e-5)
    assert cost == pytest.approx(2.0 * found.cost, rel=1e-7)


def test_a_step_that_is_too_long_is_halved():
    """Newton's method for atan diverges from 2; halved steps reach its zero."""
    at, cost = least_squares(np.arctan, np.array([2.0]))
    assert abs(at[0]) < 1e-6 and cost < 1e-12
