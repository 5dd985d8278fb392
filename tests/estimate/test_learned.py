"""What the learned likelihood looks at, and what it adds to which guesses."""

from dataclasses import replace

import numpy as np
import pytest

from nuno.camera.camera import Camera
from nuno.camera.table import Table
from nuno.estimate import learned
from nuno.estimate.futures import Futures
from nuno.estimate.hypotheses import Discretisation, Hypothesis
from nuno.estimate.learned import (
    FIRST_BEST,
    HAND_MADE_SHARE,
    LEARNED_SHARE,
    correction,
    described,
    outline_of,
)  # fmt: skip
from nuno.estimate.outline_net import SCALARS, SIZE
from nuno.estimate.ranking import Comparison, rank
from nuno.estimate.rotations import log_prior

POSE = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 1.5], [0.0, 0.0, 0.0, 1.0]])
CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5, POSE)
HAND = np.array((0.0, 0.15, 0.5))  # [m] 1 m below the camera, 75 px above the image's middle
TABLE = Table(0.0)


def cloth(right=0, down=0):
    """(480, 640) bool, a triangle that hangs from the hand's pixel, moved by so many pixels."""
    y, x = np.mgrid[:480, :640]
    return (np.abs(x - right - 320) < (y - down - 165) * 0.5) & (y - down < 345)


def nothing_hidden():
    """Return a mask (480, 640) without a pixel."""
    return np.zeros((480, 640), dtype=bool)


def test_the_picture_holds_the_whole_cloth():
    """A quarter more than its longer side: so 180 of 225 px, and as much of the picture's area as of that square."""
    outline = outline_of(cloth(), nothing_hidden(), CAMERA, HAND)
    assert outline.picture.shape == (SIZE, SIZE) and outline.picture[[0, -1]].max() == 0.0
    # the side is counted in pixels of 2.9 px, of which the cloth's tip does not fill one: of 63, twice in the area
    assert outline.picture.mean() == pytest.approx(cloth().sum() / (1.25 * 180) ** 2, rel=0.04)
    # the hand is 90 px above the middle, 0.4 of the side; a pixel is 3.5 px and 7 mm: to the same pixel of 63
    np.testing.assert_allclose(outline.place, (0.0, -0.4, 50 * 225 / 64 / 500, 225 / 64 / 5), rtol=0.02, atol=0.02)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_picture_does_not_hang_on_the_camera(scale):
    """Another resolution, and another place in the image: the same to a pixel of 63 in the side."""
    outline = outline_of(cloth(), nothing_hidden(), CAMERA, HAND)
    size = (round(480 * scale), round(640 * scale))
    at = tuple(np.clip(np.round((np.arange(n) + 0.5) / scale - 0.5).astype(int), 0, None) for n in size)
    other = outline_of(cloth()[np.ix_(*at)], np.zeros(size, dtype=bool), CAMERA.scaled(scale), HAND)
    # half a pixel at both ends, on the 7 % of pixels on the rim: less than a third of these
    assert np.abs(other.picture - outline.picture).mean() < 0.02
    np.testing.assert_allclose(other.place, outline.place, atol=0.02)
    moved = outline_of(cloth(60, 40), nothing_hidden(), CAMERA, HAND + np.array((60.0, -40.0, 0.0)) / 500)
    assert np.abs(moved.picture - outline.picture).mean() < 0.02
    np.testing.assert_allclose(moved.place, outline.place, atol=0.02)


def test_masks_are_cut_as_the_seen_cloth_is():
    """A mask that is the seen cloth gives its picture but for shares on the rim; hidden pixels count in neither."""
    hidden = nothing_hidden()
    hidden[150:200] = True
    outline = outline_of(cloth(), hidden, CAMERA, HAND)
    small = outline.camera
    rows, columns = (np.round((np.arange(n) + 0.5) / 0.35 - 0.5).astype(int) for n in (small.height, small.width))
    cut = outline.cut(np.stack([cloth()[np.ix_(rows, columns)], np.ones((small.height, small.width), dtype=bool)]))
    assert np.abs(cut[0] - outline.picture).mean() < 0.02  # a fifth of the 7 % of pixels on the rim
    assert cut[1, :5].min() == 0.0  # what is hidden, at the top, though this mask covers all
    assert outline_of(cloth(), np.ones((480, 640), dtype=bool), CAMERA, HAND) is None


def compared(count):
    """Two guesses at candidates that fit less and less well; the last future is not finite."""
    chamfer = np.tile(np.linspace(1.0, 30.0, count), (3, 2, 1))
    chamfer[0] *= 0.5  # they fit best as they are turned first
    finite = np.ones((2, count), dtype=bool)
    finite[1, -1] = False
    return Comparison(np.arange(count), np.radians((-10.0, 0.0, 10.0)), chamfer, chamfer * 0 + 0.8, chamfer * 0, finite)


@pytest.mark.parametrize("count", [5, 20])
def test_the_best_candidates_are_looked_at(count, monkeypatch):
    """Twelve at most, each guess as it is turned where it fits best; nothing is added where a future is not finite."""
    asked = {}

    def masks_of_turned(futures, worlds, turns, camera, table, hand):
        asked.update(worlds=worlds, turns=turns)
        return np.zeros((len(worlds), camera.height, camera.width), dtype=bool)

    monkeypatch.setattr(learned, "masks_of_turned", masks_of_turned)

    def log_ratios(real, imagined, scalars):
        asked.update(scalars=scalars)
        return 2.0 + np.arange(len(imagined))

    monkeypatch.setattr(learned, "log_ratios", log_ratios)
    spread = (Hypothesis(1e-4), Hypothesis(1e-3))
    futures = Futures(None, None, None, count, Discretisation(10, 10, spread))
    seen = compared(count)
    added = correction(outline_of(cloth(), nothing_hidden(), CAMERA, HAND), futures, seen, TABLE, HAND)
    best = min(count, FIRST_BEST)
    expected = [(g, c) for g in range(2) for c in range(best) if seen.finite[g, c]]
    np.testing.assert_array_equal(asked["worlds"], [g * count + c for g, c in expected])
    np.testing.assert_allclose(asked["turns"], np.radians(-10.0))
    told = described(spread, 10)
    assert told.shape == (2, 5) and told[0, 0] < told[1, 0]  # limp and stiff
    np.testing.assert_array_equal(asked["scalars"][:, -5:], told[[g for g, _ in expected]])
    assert asked["scalars"].shape == (len(expected), SCALARS)
    error = 5 * np.log1p(seen.chamfer) + 10 * 0.2 - log_prior(seen.turns)[:, None, None]
    by_hand = np.log(np.exp(-error).sum(axis=0))
    wanted = np.where(seen.finite, (HAND_MADE_SHARE - 1) * by_hand, 0.0)
    for k, (g, c) in enumerate(expected):
        wanted[g, c] += LEARNED_SHARE * (2.0 + k)
    np.testing.assert_allclose(added, wanted, rtol=1e-12, atol=1e-12)


def test_what_is_added_counts_in_the_evidence_alone():
    """Twice the likelihood of a guess at one candidate; contour distances and eq. (1) stay as they are."""
    seen = compared(3)
    twice = np.zeros((2, 3))
    twice[:, 1] = np.log(2.0)
    changed = replace(seen, correction=twice)
    before, after = (rank([c], "silhouette", 3) for c in (seen, changed))
    np.testing.assert_allclose(after.scores - before.scores, (0.0, np.log(2.0), 0.0), atol=1e-12)
    np.testing.assert_array_equal(after.eq1, before.eq1)
    np.testing.assert_array_equal(rank([changed], "chamfer", 3).scores, rank([seen], "chamfer", 3).scores)
