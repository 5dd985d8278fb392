"""The network that looks at two silhouettes: its layers, its weights, and what it tells apart."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import correlate2d
from threadpoolctl import threadpool_info, threadpool_limits

from nuno.estimate import outline_net
from nuno.estimate.learned import HAND_MADE_SHARE, LEARNED_SHARE
from nuno.estimate.outline_net import LEVELS, SCALARS, SIZE, _convolved, log_ratios, weights

TYPICAL = (np.log(8.0), 0.8, 0.0, 0.0, -0.4, 0.5, 1.0, 0.0, 0.5, 0.5, 0.3, 0.0)
"""8 px off, four fifths in common, not turned, held at the top, pixels of 1 cm; a guess in the middle of all."""


def pictures(*widths):
    """Cloths (n, SIZE, SIZE) that hang from a point, as wide at the bottom as is said [px]."""
    y, x = np.mgrid[:SIZE, :SIZE]
    inside = (y >= 8) & (y < 56)
    return np.stack([inside & (np.abs(x - 31.5) <= 2 + w / 2 * (y - 8) / 48) for w in widths]).astype(float)


@pytest.mark.parametrize(("side", "stride"), [(5, 2), (3, 1), (3, 2)])
def test_a_layer_is_a_correlation(side, stride):
    """As SciPy has it with a rim of zeros; float32 sums of 75 products keep six digits."""
    rng = np.random.default_rng(side + stride)
    x, layer = rng.normal(size=(2, 12, 16, 3)), rng.normal(size=(4, side, side, 3))
    found = _convolved(x.astype(np.float32), layer.reshape(4, -1).astype(np.float32), stride)
    for n in range(2):
        for k in range(4):
            sums = sum(correlate2d(x[n, ..., c], layer[k, ..., c], mode="same") for c in range(3))
            np.testing.assert_allclose(found[n, ..., k], sums[::stride, ::stride], atol=2e-5)


def test_the_weights_fit_the_layers():
    """Each reads what the one before gives; the file is below 1 MB, as a package may hold it."""
    net, channels = weights(), 2
    for k, side in enumerate((5, 3, 3, 3, 3)):
        assert net[f"conv{k}"].shape == (len(net[f"conv{k}.bias"]), side * side * channels)
        channels = len(net[f"conv{k}.bias"])
    assert net["dense"].shape[1] == channels * (SIZE // 16) ** 2
    assert net["mix"].shape[1] == len(net["dense"]) + SCALARS and net["narrow"].shape[1] == len(net["mix"])
    assert net["ratio"].shape == (1, len(net["narrow"])) and net["mean"].shape == net["deviation"].shape == (SCALARS,)
    assert all(value.dtype == np.float32 and np.isfinite(value).all() for value in net.values())
    assert len((files("nuno.estimate") / "outline_net.npz").read_bytes()) < 1e6


def test_a_pair_is_judged_alike_in_any_company():
    """The same bits when asked again; alone or among 40 the same to float32's rounding in sums of 1,536."""
    imagined, scalars = pictures(*range(40)), np.tile(TYPICAL, (40, 1))
    found = log_ratios(pictures(20)[0], imagined, scalars)
    assert found.shape == (40,) and np.isfinite(found).all()
    np.testing.assert_array_equal(found, log_ratios(pictures(20)[0], imagined, scalars))
    np.testing.assert_allclose(log_ratios(pictures(20)[0], imagined[7:8], scalars[7:8])[0], found[7], atol=1e-3)
    assert log_ratios(pictures(20)[0], imagined[:0], scalars[:0]).shape == (0,)


def unpacked(packed):
    """Pictures (..., SIZE, SIZE) from two pixels a byte."""
    levels = np.stack([packed >> 4, packed & 15], axis=-1)
    return levels.reshape(*packed.shape[:-1], SIZE, SIZE) / LEVELS


def mean_log_probability(learned=LEARNED_SHARE, by_hand=HAND_MADE_SHARE, order=slice(None)):
    """Of the true candidates of the silhouettes in outlines.npz; the pairs' pictures in another order, if asked."""
    with np.load(Path(__file__).with_name("outlines.npz")) as stored:
        data = {name: stored[name] for name in stored.files}
    found = []
    for k, true in enumerate(data["true"]):
        shape = data["imagined"].shape[1:3]
        told = [np.broadcast_to(data[name][k], (*shape, data[name].shape[-1])) for name in ("pair", "place", "guess")]
        pairs = unpacked(data["imagined"][k]).reshape(-1, SIZE, SIZE)[order]
        scalars = np.concatenate(told, axis=-1).reshape(-1, SCALARS).astype(float)
        logs = by_hand * data["likelihood"][k].astype(float)
        logs[data["candidates"][k]] += learned * log_ratios(unpacked(data["real"][k]), pairs, scalars).reshape(shape)
        of_candidates = np.logaddexp.reduce(logs.T, axis=0)
        found.append(of_candidates[true] - np.logaddexp.reduce(of_candidates))
    return float(np.mean(found))


@pytest.mark.long
def test_silhouettes_of_scenes_held_out_are_explained_better():
    """One each of 17 scenes that it was not trained on and that chose nothing: four guesses at the eight best.

    By hand -0.84, and by the network -0.47; with pictures of others it would be -2: it is by what they show.
    """
    alone = mean_log_probability(0.0, 1.0)
    assert alone == pytest.approx(-0.84, abs=0.01)
    assert mean_log_probability() > alone + 0.3
    assert mean_log_probability(order=np.random.default_rng(0).permutation(32)) < alone - 0.5


def test_small_products_are_one_threads_work(monkeypatch):
    """While the network is asked one thread multiplies matrices, and afterwards as many as before."""

    def threads():
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    asked = []
    monkeypatch.setattr(outline_net, "_forward", lambda *_: asked.append(threads()) or np.zeros(1))
    with threadpool_limits(2, user_api="blas"):
        log_ratios(np.zeros((SIZE, SIZE)), np.zeros((1, SIZE, SIZE)), np.zeros((1, SCALARS)))
        assert set(threads()) == {2}
    assert len(asked) == 1 and set(asked[0]) == {1}
