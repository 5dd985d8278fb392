"""Convex parts of rigid bodies are worked out once for the same points."""

import numpy as np

from nuno.rigid.convex_parts import REMEMBERED, convex_part


def test_a_part_is_kept_for_the_same_points_and_thickness():
    """The same points are the same hull; one number more, and it is another, with the corner that was moved."""
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 3))
    part = convex_part(points)
    assert convex_part(points.copy()) is part
    moved = points.copy()
    moved[0] = (2.0, 2.0, 2.0)
    other = convex_part(moved)
    assert other is not part and (other.corners == 2.0).all(axis=1).any()
    assert not (part.corners == 2.0).any()


def test_large_hulls_are_not_kept():
    """Memory: what has more points than are kept is worked out anew, and alike."""
    points = np.random.default_rng(0).normal(size=(REMEMBERED + 1, 3))
    one, other = convex_part(points), convex_part(points)
    assert one is not other
    np.testing.assert_array_equal(one.corners, other.corners)
