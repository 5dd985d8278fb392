"""From comparisons to a ranking: what the evidence, the probabilities and the confidence are."""

from dataclasses import replace

import numpy as np
import pytest

from nuno.estimate.lift_prior import UP_FIRST
from nuno.estimate.ranking import Comparison, Ranked, confidence, probabilities, rank, tempered


def looked_at(candidates, chamfer):
    """One unturned guess or more (guesses, c) at some candidates whose overlap is perfect."""
    chamfer = np.atleast_2d(np.asarray(chamfer, dtype=float))[None]
    return Comparison(
        np.asarray(candidates), np.zeros(1), chamfer, np.ones_like(chamfer), 1 - chamfer / 100,
        np.ones(chamfer.shape[1:], dtype=bool),
    )  # fmt: skip


def test_the_evidence_is_the_mean_over_the_guesses_that_looked():
    """Likelihood 1 / (1 + chamfer)^5; a candidate that a stage passed over keeps the mean of those before."""
    first = looked_at([0, 1, 2], [[0.0, 1.0, 3.0], [1.0, 1.0, 3.0]])
    second = looked_at([0, 1], [[3.0, 0.0]])
    expected = [(1 + 2.0**-5 + 4.0**-5) / 3, (2.0**-5 + 2.0**-5 + 1) / 3, 4.0**-5]
    np.testing.assert_allclose(np.exp(rank([first, second], "evidence", 3).scores), expected, rtol=1e-12)


def test_a_guess_counts_by_its_weight():
    """Half a guess of likelihood 1 beside one of 1/32: (1/32 + 1/2) / 1.5; without this best, 1/32. No other score."""
    first = looked_at([0, 1], [[1.0, 1.0]])
    half = replace(looked_at([0], [[0.0]]), weights=np.full((1, 1), 0.5))
    found = rank([first, half], "evidence", 2)
    np.testing.assert_allclose(np.exp(found.scores), ((2.0**-5 + 0.5) / 1.5, 2.0**-5), rtol=1e-12)
    np.testing.assert_array_equal(found.eq1, rank([first], "evidence", 2).eq1)
    without = rank([first, half], "evidence", 2, without_best=True)
    np.testing.assert_allclose(np.exp(without.scores), 2.0**-5, rtol=1e-12)
    nothing = replace(half, weights=np.zeros((1, 1)), finite=np.zeros((1, 1), dtype=bool))
    np.testing.assert_array_equal(rank([first, nothing], "evidence", 2).scores, rank([first], "evidence", 2).scores)


def test_a_part_is_of_some_candidates():
    """Columns of every array that there is."""
    both = replace(looked_at([3, 5], [[1.0, 2.0], [3.0, 4.0]]), weights=np.array([[0.5, 0.0], [0.5, 0.5]]))
    part = both.part(np.array([False, True]))
    np.testing.assert_array_equal(part.candidates, [5])
    np.testing.assert_array_equal(part.chamfer[0], [[2.0], [4.0]])
    np.testing.assert_array_equal(part.weights, [[0.0], [0.5]])
    assert part.pattern is None


def test_a_prior_multiplies_the_evidence_alone():
    """Twice as likely before is twice the evidence; other scores, and eq. (1), do not ask for it."""
    comparisons = [looked_at([0, 1, 2], [[0.0, 1.0, 3.0], [1.0, 1.0, 3.0]])]
    prior = np.log((1.0, 2.0, 0.5))
    plain = rank(comparisons, "evidence", 3)
    for score in ("evidence", "silhouette"):
        found = rank(comparisons, score, 3, prior)
        np.testing.assert_array_equal(found.scores, plain.scores + prior)
        np.testing.assert_array_equal(found.eq1, plain.eq1)
    for score in ("chamfer", "iou", "eq1"):
        one, other = rank(comparisons, score, 3, prior), rank(comparisons, score, 3)
        np.testing.assert_array_equal(one.scores, other.scores)


def test_each_way_of_the_hand_counts_by_its_own_prior():
    """The mean of each way's guesses, however many there are; a candidate of one way alone has that one's."""
    # likelihoods 1 / (1 + chamfer)^5: straight 1/32 thrice, up first 1 once; the second candidate is seen straight only
    straight = looked_at([0, 1], [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]])
    up_first = replace(looked_at([0], [[0.0]]), up_first=np.ones(1, dtype=bool))
    priors = np.log([[1.0, 0.5], [0.25, 1.0]])
    found = rank([straight, up_first], "evidence", 2, priors)
    both = (1.0 - UP_FIRST) * 2.0**-5 + UP_FIRST * 0.25
    np.testing.assert_allclose(np.exp(found.scores), (both, 0.5 * 2.0**-5), rtol=1e-12)
    assert found.up_first == pytest.approx(UP_FIRST * 0.25 / both, rel=1e-12)
    more = rank([straight, straight, up_first], "evidence", 2, priors)
    np.testing.assert_allclose(more.scores, found.scores, rtol=1e-12)
    # the best guess of all is left out of its own way, if that has others
    two = replace(looked_at([0], [[0.0], [1.0]]), up_first=np.ones(2, dtype=bool))
    without = rank([straight, two], "evidence", 2, priors, without_best=True)
    left = (1.0 - UP_FIRST) * 2.0**-5 + UP_FIRST * 0.25 * 2.0**-5
    np.testing.assert_allclose(np.exp(without.scores), (left, 0.5 * 2.0**-5), rtol=1e-12)
    assert rank([straight], "evidence", 2, priors).up_first == 0.0


def test_probabilities_are_shares_of_the_evidence():
    """They add up to 1 and are in proportion to the mean likelihoods; one without a finite future gets 0."""
    scores = np.log([0.5, 0.25, 1.25, 0.0 + 1e-300]) - 4000.0  # far below what exp can hold
    scores[3] = -np.inf
    np.testing.assert_allclose(probabilities("log_evidence", scores), (0.25, 0.125, 0.625, 0.0), rtol=1e-12)
    assert confidence("log_evidence_with_pattern", scores) == pytest.approx(0.625, rel=1e-12)


@pytest.mark.parametrize("name", ["negative_chamfer_px", "iou", "eq1"])
def test_other_scores_tell_no_probability(name):
    """The confidence is 1 - the ratio of the best and the second error then, here 2 and 8 px or their hundredths."""
    scores = {"negative_chamfer_px": np.array((-8.0, -2.0, -9.0))}.get(name, np.array((0.92, 0.98, 0.91)))
    assert probabilities(name, scores) is None
    assert confidence(name, scores) == pytest.approx(0.75, rel=1e-9)


def test_nothing_finite_has_no_probability():
    """Without a single finite future there is nothing to share out, and no second to compare with."""
    assert probabilities("log_evidence", np.full(3, -np.inf)) is None
    assert confidence("log_evidence", np.full(3, -np.inf)) == 1.0


def test_a_ranking_is_settled_by_a_sure_candidate():
    """By likelihoods of 1 and 2^-5 the first has 0.97; 1 asks for all stages, and other scores are never settled."""
    comparisons = [looked_at([0, 1], [0.0, 1.0])]
    ranked = rank(comparisons, "evidence", 2)
    assert ranked.settled(0.96) and not ranked.settled(0.98)
    assert not ranked.settled(1.0)
    assert not rank(comparisons, "chamfer", 2).settled(0.01)


def test_what_is_plausible_holds_most_of_the_probability():
    """95 % of it or another share, in two candidates at least, no more than asked for; other scores tell no shares."""
    flat = Ranked("log_evidence", np.log([0.3, 0.1, 0.48, 0.06, 0.06]), np.zeros(5))
    assert list(flat.plausible(9)) == [0, 1, 2, 3, 4]
    assert list(flat.plausible(3)) == [0, 1, 2]
    assert list(flat.plausible(9, 0.7)) == [0, 2] and list(flat.plausible(9, 1.0)) == [0, 1, 2, 3, 4]
    steep = Ranked("log_evidence", np.log([0.25, 0.73, 0.01, 0.01]), np.zeros(4))
    assert list(steep.plausible(4)) == [0, 1]
    sure = Ranked("log_evidence", np.log([0.01, 0.98, 0.01]), np.zeros(3))
    assert list(sure.plausible(3)) == [0, 1]
    assert list(Ranked("iou", np.array((0.9, 0.1, 0.8)), np.zeros(3)).plausible(2)) == [0, 2]


def test_a_future_that_is_no_number_is_never_the_best():
    """Whatever its silhouette says, its error is infinite, and its evidence none."""
    comparison = replace(looked_at([0, 1], [[0.0, 1.0]]), finite=np.array([[False, True]]))
    for score in ("evidence", "chamfer", "iou", "eq1"):
        assert comparison.error(score)[0, 0, 0] == np.inf and np.isfinite(comparison.error(score)[0, 0, 1])
        assert rank([comparison], score, 2).order[0] == 1


def test_probabilities_are_tempered_to_what_is_trusted():
    """The best one's is what is trusted, more or less than it was; the others' order and shares of logarithms stay."""
    scores = np.array((0.0, -1.0, -3.0, -np.inf))
    plain = np.exp(scores) / np.exp(scores).sum()
    np.testing.assert_allclose(tempered(scores, plain[0]), plain, rtol=1e-9)
    assert plain[0] < 0.75 and tempered(scores, 0.9)[0] == pytest.approx(0.9, abs=1e-9)
    alike = np.array((0.0, 0.0))
    np.testing.assert_array_equal(tempered(alike, 0.9), (0.5, 0.5))
    cooled = tempered(scores, 0.5)
    assert cooled[0] == pytest.approx(0.5, abs=1e-9) and cooled.sum() == pytest.approx(1.0)
    ratios = np.log(cooled[:3] / cooled[0])
    assert ratios[2] / ratios[1] == pytest.approx(3.0) and cooled[3] == 0.0
    np.testing.assert_allclose(tempered(scores, 0.1), (1 / 3, 1 / 3, 1 / 3, 0.0), atol=1e-4)
