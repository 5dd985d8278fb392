"""How far evidence is trusted: chance fits, bad fits and warnings make an answer less sure."""

import numpy as np
import pytest

from nuno.camera.focal_of_rectangle import FOCAL
from nuno.camera.rectangle import SQUARE, UNEVEN
from nuno.estimate.doubt import (
    BAD_SHARE,
    BADLY,
    ELSEWHERE,
    POOR,
    SHARES,
    TEMPERATURE,
    WARNED_SHARE,
    WELL,
    doubted,
    misfit,
    oddities,
    share_of_doubt,
)
from nuno.estimate.hypotheses import Hypothesis
from nuno.estimate.ranking import Comparison, rank


def comparison(chamfer, iou=1.0):
    """Guesses (g, c) at candidates, each at one turn only, with contour distances [px]."""
    chamfer = np.asarray(chamfer, dtype=float)[None]
    return Comparison(
        np.arange(chamfer.shape[2]), np.zeros(1), chamfer, np.full_like(chamfer, iou), 1.0 - chamfer / 100,
        np.ones(chamfer.shape[1:], dtype=bool),
    )  # fmt: skip


def at_temperature(scores):
    """Probabilities that are as exp of the scores over the temperature."""
    weights = np.exp(scores / TEMPERATURE)
    return weights / weights.sum()


def test_many_good_fits_are_trusted():
    """Where every guess says the same of fair futures, the probabilities are the evidence's at a temperature."""
    seen = comparison([[1.0, 9.0], [1.0, 9.0], [1.0, 9.0]])
    ranked = rank([seen], "evidence", 2)
    with_doubt = doubted([seen], "evidence", 2, None)
    np.testing.assert_array_equal(with_doubt.scores, ranked.scores)
    np.testing.assert_allclose(with_doubt.likely, at_temperature(ranked.scores), rtol=1e-9)


def test_a_single_chance_fit_does_not_decide():
    """Of two candidates one fits perfectly under one guess of four: without it the other is the better one."""
    seen = comparison([[0.0, 1.0], [9.0, 1.0], [9.0, 1.0], [9.0, 1.0]])
    ranked = rank([seen], "evidence", 2)
    # mean likelihoods: about 1/4 and 1/32; without the best guess 1e-5 and 1/32
    assert ranked.order[0] == 0 and ranked.probabilities[0] > 0.85
    with_doubt = doubted([seen], "evidence", 2, None)
    assert with_doubt.likely[0] < 0.5
    assert with_doubt.likely.sum() == pytest.approx(1.0, abs=1e-12)


def test_a_truth_that_one_guess_fits_is_looked_at_again():
    """It stays among the plausible ones, however sure the evidence without that guess is of another."""
    seen = comparison([[0.0, 3.0, 9.0], [40.0, 3.0, 9.0], [40.0, 3.0, 9.0]])
    assert set(doubted([seen], "evidence", 3, None).plausible(2)) == {0, 1}


def test_a_bad_fit_is_doubted():
    """The same ratios of likelihoods say less where even the best future is far off."""
    good = doubted([comparison([[1.0, 5.0]] * 3)], "evidence", 2, None)
    # chamfer 19 px and IoU 0.5: 5 ln 20 + 5 = 20, beyond BADLY
    bad = comparison([[19.0, 59.0]] * 3, iou=0.5)
    assert misfit([bad], 0) == pytest.approx(5.0 * np.log(20.0) + 5.0) and misfit([bad], 0) > BADLY
    doubt = doubted([bad], "evidence", 2, None)
    # (1 + 59) / (1 + 19) = (1 + 5) / (1 + 1) = 3, so the evidence alone is as sure of both
    np.testing.assert_allclose(at_temperature(rank([bad], "evidence", 2).scores), good.likely, rtol=1e-9)
    assert doubt.likely[0] < good.likely[0] - 0.1
    assert "looks little like the image" in oddities([bad], 0, "evidence", Hypothesis(1e-4))[0]
    assert oddities([bad], 0, "iou", Hypothesis(1e-4)) == ()


def test_a_fair_fit_is_trusted():
    """Below `WELL` the probabilities are the evidence's at a temperature, and nothing is told."""
    fair = comparison([[11.0, 110.0]] * 3)  # 5 ln 12 = 12.4
    assert 12.0 < misfit([fair], 0) < WELL
    likely = doubted([fair], "evidence", 2, None).likely
    np.testing.assert_allclose(likely, at_temperature(rank([fair], "evidence", 2).scores), rtol=1e-9)
    assert oddities([fair], 0, "evidence", Hypothesis(1e-4)) == ()


def test_warnings_lower_the_confidence():
    """Each by a share of what is left."""
    seen = comparison([[1.0, 3.0] + [9.0] * 20] * 3)
    sure, once, twice = (doubted([seen], "evidence", 22, None, ("odd",) * count).likely[0] for count in range(3))
    assert sure > 0.9 and sure > once > twice


@pytest.mark.parametrize(
    ("error", "warnings", "share"),
    [
        (0.0, (), 0.0), (WELL, (), 0.0), (0.5 * (WELL + BADLY), (), 0.5 * BAD_SHARE), (99.0, (), BAD_SHARE),
        (0.0, ("odd",), WARNED_SHARE), (99.0, ("odd", "odder"), 1.0 - (1.0 - BAD_SHARE) * (1.0 - WARNED_SHARE) ** 2),
        (0.0, (f"{SQUARE}0.4 m", f"{UNEVEN}: 1.6 px"), 0.0), (99.0, (POOR,), BAD_SHARE),
        (0.0, (f"{FOCAL}9 %",), SHARES[FOCAL]),
        (0.0, (f"{ELSEWHERE}5 cm", "odd"), 1.0 - (1.0 - SHARES[ELSEWHERE]) * (1.0 - WARNED_SHARE)),
    ],
)  # fmt: skip
def test_shares_of_doubt(error, warnings, share):
    """In proportion between a good and a bad fit; independent reasons leave the product of what each leaves."""
    assert share_of_doubt(error, warnings) == pytest.approx(share)


def test_a_hand_that_seems_to_be_elsewhere_is_told():
    """Where the future that fits best is of a guess that the hand's height is a mistake."""
    seen = [comparison([[1.0, 9.0]])]
    (told,) = oddities(seen, 0, "evidence", Hypothesis(1e-4, mistake=-0.05))
    assert "5 cm lower than it is told" in told
    assert oddities(seen, 0, "evidence", Hypothesis(1e-4)) == ()


def test_other_scores_are_left_alone():
    """They tell no probabilities."""
    ranked = doubted([comparison([[1.0, 9.0]])], "chamfer", 2, None, ("odd",))
    assert ranked.likely is None and ranked.probabilities is None
