"""Ways of hands that lift a cloth: as they were seen, and guesses at them."""

import numpy as np
import pytest

import nuno
from nuno.estimate.hypotheses import Hypothesis
from nuno.estimate.lift_path import checked_path, paths_of_hands

BEGIN = np.array([(0.0, 0.0, 0.7), (0.3, 0.1, 0.7)])  # [m]
HAND = np.array((0.2, 0.0, 1.1))  # [m]


def test_a_straight_way_is_of_least_jerk():
    """From rest to rest, in pieces of a frame: between keys a chord of 10 s^3 - 15 s^4 + 6 s^5.

    Its second derivative is at most 5.8, so a chord over 1 / 90 is off by 5.8 / 8 / 90^2 = 9e-5 of the way at most.
    """
    path = paths_of_hands(BEGIN, HAND, [Hypothesis(1e-4)] * 2, 1.5, 0.01, None)
    exact = nuno.Path((0.0, 1.5), np.stack([BEGIN[0], HAND]), None, "minimum_jerk")
    times = np.linspace(0.0, 1.5, 200)
    away = float(np.linalg.norm(HAND - BEGIN[0]))
    for world in (0, 2):
        assert np.abs(path.at(times)[world] - exact.at(times)).max() < 9e-5 * away
    alone = paths_of_hands(BEGIN, HAND, [Hypothesis(1e-4), Hypothesis(1e-4, up_first=True)], 1.5, 0.01, None)
    np.testing.assert_array_equal(alone.positions[:2], path.positions[:2])


def test_up_first_and_sideways_then():
    """Halfway in time it is straight above where the cloth lay, as high as the hand; the straight one is halfway."""
    path = paths_of_hands(BEGIN, HAND, [Hypothesis(1e-4, up_first=True), Hypothesis(1e-4)], 1.5, 0.01, None)
    halfway = path.at(0.75)
    np.testing.assert_allclose(halfway[:2], np.column_stack([BEGIN[:, :2], (1.1, 1.1)]), atol=1e-12)
    np.testing.assert_allclose(halfway[2:], 0.5 * (BEGIN + HAND), atol=1e-12)
    np.testing.assert_allclose(path.at(1.5), np.tile(HAND, (4, 1)), atol=1e-12)


def test_a_way_that_was_seen_is_bent_to_each_candidate():
    """It begins at the candidate and ends at the hand; its own candidate goes exactly as it was seen."""
    seen = np.array([(0.0, 0.0, 0.7), (0.0, 0.3, 0.9), (0.2, 0.0, 1.1)])
    path = paths_of_hands(BEGIN, HAND, [Hypothesis(1e-4)], 2.0, 0.01, seen)
    np.testing.assert_allclose(path.positions[0], seen, atol=1e-12)
    np.testing.assert_allclose(path.positions[1, 0], BEGIN[1])
    np.testing.assert_allclose(path.positions[1, 1], seen[1] + 0.5 * (BEGIN[1] - seen[0]))
    np.testing.assert_allclose(path.positions[1, 2], HAND)


def test_hands_are_off_by_deviations_and_mistakes():
    """By so many standard deviations, and by a mistake's metres up."""
    guesses = [Hypothesis(1e-4, hand=(0.0, 1.0, -2.0)), Hypothesis(1e-4, mistake=0.05)]
    path = paths_of_hands(BEGIN[:1], HAND, guesses, 1.5, 0.03, None)
    np.testing.assert_allclose(path.positions[:, -1] - HAND, [(0.0, 0.03, -0.06), (0.0, 0.0, 0.05)], atol=1e-12)


def test_a_hand_path_counts_from_its_last_hold():
    """A hand that came down, took the cloth at 1 s and had lifted it at 3 s: even times in between."""
    times = np.array((0.0, 1.0, 2.0, 3.0))
    positions = np.array([(0, 0, 1.0), (0, 0, 0.7), (0, 0, 0.9), HAND])
    path = nuno.HandPath(times, positions, np.array((False, True, True, True)))
    points = checked_path(path, HAND, 0.01)
    # it holds from halfway between the times at which it did not and did
    np.testing.assert_allclose(points[0], (0, 0, 0.85), atol=1e-12)
    np.testing.assert_allclose(points[-1], HAND)
    with pytest.raises(nuno.InvalidInputError, match="never held"):
        checked_path(nuno.HandPath(times, positions, np.zeros(4, bool)), HAND, 0.01)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ([(0, 0, 1.1)], "two points"), ([(0, 0, 0.7), (0, 0, 1.1)], "must end where the hand is"),
        ([(0, 0, np.nan), HAND], "finite"), ("up", "hand_path"), ([(0.0, 1.0)] * 2, "hand_path"),
    ],
)  # fmt: skip
def test_bad_paths_are_named(path, message):
    """Too short, elsewhere at the end, or no places."""
    with pytest.raises(nuno.InvalidInputError, match=message):
        checked_path(path, HAND, 0.01)
