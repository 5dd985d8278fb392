"""Hulls of few faces: how near they are to the true ones, by another measure than their own."""

import numpy as np
import pytest

from few_variants import few
from nuno.shapes.shape import Hull
from nuno.tasks.simple_hull import simple_hull


def apart(a, b, directions):
    """Return the Hausdorff distance of two convex sets: the most that their support functions differ."""
    return np.abs((a @ directions.T).max(axis=0) - (b @ directions.T).max(axis=0)).max()


@pytest.mark.parametrize("error", few([1e-3, 3e-3], 3e-3))
@pytest.mark.parametrize("form", ["ball", "rod", "box"])
def test_a_simple_hull_is_as_near_as_it_says(form, error):
    """Support functions in 20,000 directions are apart by no more than the error, which the answer states."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(3000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    if form == "rod":
        points = points * 0.04 + rng.uniform(-0.1, 0.1, size=(3000, 1)) * np.array([1.0, 0.2, 0.0])
    elif form == "ball":
        points = points * 0.07
    else:
        points = rng.uniform(-1.0, 1.0, size=(3000, 3)) * (0.1, 0.05, 0.03)
    hull, stated = simple_hull(points, error)
    directions = rng.normal(size=(20000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = apart(hull.vertices, points, directions)
    assert found <= stated + 1e-9 <= error + 1e-9
    assert len(hull.planes) < len(Hull.of(points).planes)
    assert found > 0.2 * stated  # a bound that says something


def test_a_box_stays_a_box():
    """Nothing is simpler than six faces, and nothing is moved."""
    points = np.array(np.meshgrid([-0.1, 0.1], [-0.2, 0.2], [-0.3, 0.3])).reshape(3, -1).T
    hull, stated = simple_hull(points, 1e-3)
    assert len(hull.planes) == 6 and stated < 1e-12
    np.testing.assert_allclose(np.abs(hull.mesh()[0]), np.abs(points), atol=1e-9)
