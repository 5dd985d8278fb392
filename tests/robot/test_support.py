"""Outlines of soles, and distances to their edges."""

import numpy as np

from nuno.robot.support import convex_outline, distance_inside, edges_of


def test_the_outline_of_two_soles_is_their_hull():
    """Closed form: two rectangles side by side have the outline of one, counterclockwise, without inner points."""
    soles = [(x, y) for x in (-0.1, 0.1) for y in (-0.15, -0.05, 0.05, 0.15)]
    outline = convex_outline(np.array(soles))
    assert sorted(map(tuple, outline)) == [(-0.1, -0.15), (-0.1, 0.15), (0.1, -0.15), (0.1, 0.15)]
    x, y = outline.T
    assert 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) == np.float64(0.06)  # counterclockwise is > 0


def test_distances_to_the_edges():
    """Closed form, of a rectangle and of a triangle; negative outside."""
    outline = convex_outline(np.array([(0, 0), (0.4, 0), (0.4, 0.2), (0, 0.2)]))
    assert np.isclose(distance_inside(outline, np.array([0.1, 0.07])), 0.07)
    assert np.isclose(distance_inside(outline, np.array([0.45, 0.1])), -0.05)
    triangle = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    assert np.isclose(distance_inside(triangle, np.array([0.4, 0.4])), 0.2 / np.sqrt(2))
    normals, offsets = edges_of(triangle)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose(offsets, [0.0, 1.0 / np.sqrt(2), 0.0], atol=1e-15)
