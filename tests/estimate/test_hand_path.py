"""The path of a hand: where it is, and when it holds."""

import numpy as np

import nuno

PLACES = np.arange(15.0).reshape(5, 3)


def test_holds_are_between_the_times_that_are_known():
    """Half-way between a time without and one with; from the first time on, where it holds then; without an end."""
    path = nuno.HandPath([2.0, 3.0, 4.0, 5.0, 6.0], PLACES, [True, False, False, True, True])
    assert path.holds == [(2.0, 2.5), (4.5, np.inf)]
    never = nuno.HandPath([2.0, 3.0, 4.0, 5.0, 6.0], PLACES, [False] * 5)
    assert never.holds == [] and not never.holds_at(3.0)


def test_a_hold_begins_at_its_begin_and_has_ended_at_its_end():
    """Half open: of two holds that meet, one holds."""
    path = nuno.HandPath([2.0, 3.0, 4.0, 5.0, 6.0], PLACES, [False, True, True, False, False])
    assert path.holds == [(2.5, 4.5)]
    assert [path.holds_at(time) for time in (2.49, 2.5, 4.49, 4.5)] == [False, True, True, False]


def test_it_rests_before_and_after():
    """In between it goes straight."""
    path = nuno.HandPath([2.0, 3.0, 4.0, 5.0, 6.0], PLACES, [False] * 5)
    np.testing.assert_array_equal(path.at([0.0, 2.5, 9.0]), [PLACES[0], (PLACES[0] + PLACES[1]) / 2, PLACES[-1]])
