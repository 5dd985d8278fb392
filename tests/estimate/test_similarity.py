"""Silhouette scores against straightforward computation, and their bits in any batch."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import warp as wp
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from nuno.camera.image_region import Region
from nuno.camera.raster import MASK_BACKGROUND
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.estimate import similarity as module
from nuno.estimate.similarity import Silhouette, contour, score_masks, similarity

HEIGHT, WIDTH = 96, 128


def _blobs(count, seed, level=0.6):
    """Random smooth blobs, some of which touch the border."""
    noise = gaussian_filter(np.random.default_rng(seed).normal(size=(count, HEIGHT, WIDTH)), (0, 7, 7))
    return noise > level * noise.std()


def _contour_points(mask, ignore):
    """Pixels of a mask beside a pixel of background, one by one."""
    points = []
    for y, x in np.argwhere(mask & ~ignore):
        for j, i in ((y, x - 1), (y, x + 1), (y - 1, x), (y + 1, x)):
            if 0 <= j < HEIGHT and 0 <= i < WIDTH and not mask[j, i] and not ignore[j, i]:
                points.append((x, y))
                break
    return np.array(points)


@pytest.mark.parametrize("with_ignore", [False, True])
def test_scores_match_their_definitions(with_ignore):
    """Equation (1), overlap, contour distance, area and centroid of random blobs."""
    sims, real = _blobs(6, 1), _blobs(1, 2)[0]
    ignore = _blobs(1, 3, level=1.4)[0] if with_ignore else np.zeros_like(real)
    scores = similarity(sims, real, "all", ignore=ignore if with_ignore else None)
    counted = ~ignore
    pixels = counted.sum()
    real_points = _contour_points(real & counted, ignore)
    for k, sim in enumerate(sims):
        both = (sim & real & counted).sum()
        neither = (~sim & ~real & counted).sum()
        assert scores["eq1"][k] == pytest.approx(both / pixels + neither / pixels, abs=1e-14)
        assert scores["iou"][k] == pytest.approx(both / ((sim | real) & counted).sum(), abs=1e-14)
        assert scores["area"][k] == (sim & counted).sum()
        y, x = np.nonzero(sim & counted)
        np.testing.assert_allclose(scores["centroid"][k], (x.mean(), y.mean()), atol=1e-12)
        points = _contour_points(sim & counted, ignore)
        there, back = cKDTree(real_points).query(points)[0], cKDTree(points).query(real_points)[0]
        # distances are rounded to 1/1024 px each
        assert scores["chamfer"][k] == pytest.approx((there.mean() + back.mean()) / 2.0, abs=0.5 / 1024)


def test_contour_is_what_it_says():
    """The contour image holds the same pixels as the search one by one; the image's border makes none."""
    mask, ignore = _blobs(2, 4)
    np.testing.assert_array_equal(np.argwhere(contour(mask, ignore))[:, ::-1], _contour_points(mask, ignore))
    assert not contour(np.ones((5, 5), dtype=bool)).any()


def test_identical_masks_score_best():
    """A mask is perfectly similar to itself."""
    mask = _blobs(1, 5)[0]
    scores = similarity(mask, mask, "all")
    assert (scores["eq1"], scores["iou"], scores["chamfer"]) == (1.0, 1.0, 0.0)
    assert isinstance(scores["iou"], float)


def test_a_shift_is_as_far_as_it_is():
    """Two parallel half planes 5 px apart have a contour distance of 5 px."""
    left, right = np.zeros((2, 40, 60), dtype=bool)
    left[:, :20] = True
    right[:, :25] = True
    assert similarity(left, right, "chamfer") == 5.0


def test_empty_masks_have_defined_scores():
    """Empty masks never give NaN: nothing against nothing agrees, nothing against something is far."""
    empty, full, blob = np.zeros((30, 40), bool), np.ones((30, 40), bool), np.zeros((30, 40), bool)
    blob[10:20, 10:30] = True
    scores = score_masks(np.stack([empty, blob, full]), Silhouette(empty))
    np.testing.assert_array_equal(scores["eq1"], [1.0, 1.0 - 200 / 1200, 0.0])
    np.testing.assert_array_equal(scores["iou"], [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(scores["chamfer"], [0.0, 50.0, 0.0])  # the diagonal of 30 x 40
    np.testing.assert_array_equal(scores["centroid"], [[-1, -1], [19.5, 14.5], [19.5, 14.5]])
    assert similarity(empty, blob, "chamfer") == 50.0
    everything_ignored = score_masks(blob[None], Silhouette(blob, full))
    assert np.isfinite(np.concatenate([np.ravel(value) for value in everything_ignored.values()])).all()


def test_nothing_to_compare_with_is_refused():
    """Two empty masks are no likeness, and probabilities no masks."""
    blob, empty = np.eye(8, dtype=bool), np.zeros((8, 8), bool)
    for masks, real, ignore in ((empty, empty, None), (blob, empty, None), (blob, blob, ~empty)):
        with pytest.raises(InvalidInputError, match="real mask is empty"):
            similarity(masks, real, ignore=ignore)
    chances = np.full((8, 8), 0.1)
    for masks, real, ignore in ((chances, blob, None), (blob, chances, None), (blob, blob, chances)):
        with pytest.raises(InvalidInputError, match=r"threshold=0\.5"):
            similarity(masks, real, ignore=ignore)
    assert similarity(blob.astype(np.uint8) * 255, blob) == 1.0


def test_region_counts_the_background_outside_exactly():
    """Scores of a cutout are, bit for bit, those of the whole image."""
    real = _blobs(1, 6)[0]
    sims = _blobs(5, 7)
    region = Region(31, 22, 57, 41)
    inside = np.zeros((HEIGHT, WIDTH), dtype=bool)
    inside[22 : 22 + 41, 31 : 31 + 57] = True
    sims &= inside
    whole = score_masks(sims, Silhouette(real))
    part = score_masks(sims[:, 22 : 22 + 41, 31 : 31 + 57].copy(), Silhouette(real), region=region)
    assert whole.keys() == part.keys()
    for name in whole:
        np.testing.assert_array_equal(part[name], whole[name], err_msg=name)


def test_batches_threads_and_kinds_have_the_same_bits():
    """Alone, in a batch, on several threads, as keys, bools or bytes: the same numbers."""
    sims, real = _blobs(8, 8), Silhouette(_blobs(1, 9)[0], _blobs(1, 10, level=1.5)[0])
    expected = score_masks(sims, real)
    module.load("cpu")
    keys = wp.array(np.where(sims, 2468, MASK_BACKGROUND), dtype=wp.int32, device="cpu")
    with ThreadPoolExecutor(4) as pool:
        slices = list(pool.map(lambda k: score_masks(keys[k : k + 2], real), range(0, 8, 2)))
    for name, values in expected.items():
        np.testing.assert_array_equal(np.concatenate([s[name] for s in slices]), values)
        np.testing.assert_array_equal(score_masks(sims[3:4], real)[name][0], values[3])
        np.testing.assert_array_equal(score_masks(wp.array(sims, dtype=wp.bool, device="cpu"), real)[name], values)
        np.testing.assert_array_equal(score_masks(sims.astype(np.uint8) * 255, real)[name], values)
    without = score_masks(sims, real, with_contour=False)
    assert "chamfer" not in without
    np.testing.assert_array_equal(without["eq1"], expected["eq1"])
    np.testing.assert_array_equal(similarity(wp.array(sims, dtype=wp.bool, device="cpu"), real), expected["eq1"])


@pytest.mark.cuda
@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device")
def test_cuda_repeats_its_bits_and_agrees_with_the_cpu():
    """Counts are the CPU's exactly; every run on CUDA has the same bits."""
    sims, real = _blobs(16, 11), Silhouette(_blobs(1, 12)[0])
    here = score_masks(sims, real)
    masks = wp.array(sims, dtype=wp.bool, device="cuda")
    first, second = score_masks(masks, real), score_masks(masks, real)
    for name in here:
        np.testing.assert_array_equal(first[name], second[name])
        # a square root may round to another 1/1024 px
        np.testing.assert_allclose(first[name], here[name], atol=1 / 1024 if name == "chamfer" else 0.0, rtol=0.0)


def test_bad_arguments_are_refused():
    """Shapes, kinds and names that do not fit are named."""
    masks, real = np.zeros((2, 10, 12), bool), np.ones((10, 12), bool)
    with pytest.raises(UnknownNameError, match="chamfer"):
        similarity(masks, real, "dice")
    with pytest.raises(InvalidInputError, match="12 x 10"):
        similarity(np.zeros((2, 5, 6), bool), real)
    with pytest.raises(InvalidInputError, match="do not fit"):
        score_masks(masks, Silhouette(real), region=Region(1, 0, 12, 10))
    with pytest.raises(InvalidInputError, match="mask must be"):
        similarity(masks, np.zeros((3, 10, 12), bool))
    with pytest.raises(InvalidInputError, match="ignore mask has shape"):
        similarity(masks, real, ignore=np.zeros((9, 12), bool))
    with pytest.raises(InvalidInputError, match="ignore"):
        similarity(masks, Silhouette(real), ignore=real)
    with pytest.raises(InvalidInputError, match="masks must be"):
        similarity(np.zeros(12, bool), real)
    with pytest.raises(InvalidInputError, match="bool or uint8"):
        similarity(wp.zeros((2, 10, 12), dtype=wp.int32, device="cpu"), real)


@pytest.mark.parametrize("on_device", [False, True])
def test_masks_of_real_numbers_are_refused_or_cut_at_a_threshold(on_device):
    """Probabilities are no masks: without a threshold they are refused, with one they are what is above it."""
    chances = np.random.default_rng(3).uniform(size=(2, HEIGHT, WIDTH)).astype(np.float32)
    real = _blobs(1, 2)[0]
    given = wp.array(chances, dtype=wp.float32, device="cpu") if on_device else chances
    with pytest.raises(InvalidInputError, match=r"threshold=0\.5"):
        similarity(given, real)
    for level in (0.25, 0.75):
        np.testing.assert_array_equal(similarity(given, real, threshold=level), similarity(chances > level, real))
        assert similarity(given[0], real, threshold=level) == similarity(chances[0] > level, real)
    with pytest.raises(InvalidInputError, match="real_mask"):
        similarity(chances > 0.5, real.astype(float))
    assert similarity(real, real.astype(float), threshold=0.5) == 1.0
    with pytest.raises(InvalidInputError, match="whole numbers"):
        similarity(chances > 0.5, real, threshold=0.5)
    with pytest.raises(InvalidInputError, match="ignore"):
        similarity(chances > 0.5, real, ignore=chances[0])
    with pytest.raises(InvalidInputError, match="finite"):
        similarity(np.full((4, 5), np.nan), np.ones((4, 5), bool), threshold=0.5)
