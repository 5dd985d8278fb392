"""Ways of joints past what is in the way, on a plane of two joints whose third stays."""

import numpy as np
import pytest

from nuno.errors import ReachError
from nuno.tasks.free_way import check_lines, free_way

LIMITS = np.full(3, -2.0), np.full(3, 2.0)
BEGIN, END = np.array([-0.5, 0.0, 0.3]), np.array([0.5, 0.0, 0.3])


def disc(angles):
    """A disc of 0.2 rad about the middle is in the way."""
    return "it meets the disc" if np.hypot(*angles[:2]) < 0.2 else ""


def test_a_free_line_is_taken():
    """Nothing is in the way: straight to the end."""
    assert np.array_equal(free_way(BEGIN, END, [0, 1], LIMITS, lambda angles: "", "it cannot go"), END[None])


def test_a_stop_leads_past():
    """By one stop past the disc, the same each time, and the joint that is not to move does not."""
    way = free_way(BEGIN, END, [0, 1], LIMITS, disc, "it cannot go")
    assert way.shape == (2, 3) and np.array_equal(way[-1], END) and way[0, 2] == 0.3
    assert (np.abs(way) <= 2.0).all()
    for a, b in ((BEGIN, way[0]), (way[0], END)):
        away = [np.hypot(*(a + (b - a) * share)[:2]) for share in np.linspace(0.0, 1.0, 2001)]
        # the line is looked at every 0.04 rad at least, between which it comes nearer by 1 mm at most
        assert min(away) > np.sqrt(0.2**2 - 0.04**2 / 2.0)
    assert np.array_equal(way, free_way(BEGIN, END, [0, 1], LIMITS, disc, "it cannot go"))


def test_no_way_is_told():
    """A wall from limit to limit: what is in the way of the straight line is said."""
    with pytest.raises(ReachError, match="it cannot go: the wall"):
        free_way(BEGIN, END, [0, 1], LIMITS, lambda angles: "the wall" if abs(angles[0]) < 0.2 else "", "it cannot go")


def test_lines_are_looked_at_between_their_ends():
    """Both ends are free, and the disc between them is met; where the robot is already is not looked at."""
    with pytest.raises(ReachError, match="on the way: it meets the disc"):
        check_lines(np.stack([BEGIN, END]), disc, "on the way")
    check_lines(np.array([[0.0, 0.0, 0.0], [0.0, 0.25, 0.0]]), lambda a: "no" if a[1] == 0.0 else "", "on the way")
