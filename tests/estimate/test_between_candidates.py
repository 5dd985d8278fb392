"""How likely each candidate of an outline is the nearest to where the cloth was picked."""

import numpy as np

from nuno.estimate.between_candidates import REACH, cells_of
from nuno.estimate.ranking import Ranked

SQUARE = np.array([(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)])
GRID = np.stack(np.meshgrid(np.arange(4) * 0.1, np.arange(4) * 0.1), axis=-1).reshape(-1, 2)


def nearest(likely, candidates=GRID, spacing=0.1):
    """The probabilities of candidates on a square."""
    likely = np.asarray(likely, dtype=float)
    with np.errstate(divide="ignore"):
        return cells_of(SQUARE, candidates, spacing).nearest(Ranked("log_evidence", np.log(likely), likely, likely))


def test_even_evidence_tells_no_candidate_from_another():
    """The mean of equal logarithms is that logarithm, and cells count alike, however large: 1/16 each, by rounding."""
    found = nearest(np.full(16, 1.0 / 16.0))
    np.testing.assert_allclose(found.likely, 1.0 / 16.0, rtol=1e-12)


def test_two_candidates_share_by_the_mean_over_their_cells():
    """By the formula itself, integrated along the line between two candidates to 1e-3: the points are a tenth apart.

    Weights are exp(-d^2 / 2 s^2); on a square with candidates at the middles of two sides they depend on x alone.
    """
    pair, likely = np.array([(0.0, 0.15), (0.3, 0.15)]), np.array([0.9, 0.1])
    found = nearest(likely, pair, spacing=0.3).likely
    x = (np.arange(4000) + 0.5) / 4000
    first = 1.0 / (1.0 + np.exp((x**2 - (1.0 - x) ** 2) / (2.0 * REACH**2)))
    density = np.exp(first * np.log(0.9) + (1.0 - first) * np.log(0.1))
    expected = density[x < 0.5].sum() / density.sum()
    assert abs(found[0] - expected) < 0.02  # a tenth of a spacing of points is a few per cent of a cell's edge
    assert found[0] < 0.9 and abs(found.sum() - 1.0) < 1e-12


def test_a_neighbour_gains_more_than_one_that_is_far():
    """Between a sure candidate and its neighbours evidence is high too, so these are likelier than those beyond."""
    likely = np.full(16, 1e-3)
    likely[5] = 1.0 - likely.sum() + 1e-3
    found = nearest(likely).likely
    assert found.argmax() == 5 and found[5] < likely[5]
    assert min(found[[1, 4, 6, 9]]) > 2.0 * found[15]


def test_scores_stay_and_a_candidate_without_a_future_does_not_rule_its_cell_out():
    """The order is that of the evidence, bit for bit; a probability of nothing becomes little, and all add up to 1."""
    likely = np.full(16, 1.0 / 15.0)
    likely[7] = 0.0
    found = nearest(likely)
    with np.errstate(divide="ignore"):
        np.testing.assert_array_equal(found.scores, np.log(likely))
    assert 0.0 < found.likely[7] < 1.0 / 15.0 and abs(found.likely.sum() - 1.0) < 1e-12


def test_where_no_evidence_ranks_nothing_changes():
    """The very object."""
    ranked = Ranked("iou", np.arange(16.0), np.arange(16.0))
    assert cells_of(SQUARE, GRID, 0.1).nearest(ranked) is ranked


def test_many_candidates_take_little_memory():
    """Of 1024 candidates only those around a point are weighed: 24 columns."""
    many = np.stack(np.meshgrid(np.linspace(0, 0.3, 32), np.linspace(0, 0.3, 32)), axis=-1).reshape(-1, 2)
    cells = cells_of(SQUARE, many, 0.3 / 31)
    assert cells.around.shape[1] == 24 and cells.around.shape == cells.weights.shape
    assert (np.bincount(cells.around[:, 0], minlength=1024) > 0).all()
