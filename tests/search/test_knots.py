"""Knots: motions through knots, against lines, bounds and their own rest."""

import numpy as np
import pytest

import nuno
from nuno.errors import InvalidInputError


def test_knots_on_a_line_give_the_line():
    """Three knots on a straight line: the motion is uniform, and rests before and after."""
    motion = nuno.Knots([1.0, 0.0], [[2.0, -1.0], [3.0, -2.0], [4.0, -3.0]], 1.5)
    times = np.array([-1.0, 0.0, 0.2, 0.75, 1.5, 9.0])
    held = np.clip(times, 0.0, 1.5) / 0.5
    np.testing.assert_allclose(motion.at(times), np.stack([1.0 + held, -held], axis=1), atol=1e-12)


def test_a_motion_passes_its_knots_and_stays_within_them():
    """At (j + 1) / k of the time it is at knot j; between it leaves no pair's range, so that bounds hold."""
    random = np.random.default_rng(3)
    now, values = random.normal(size=4), random.normal(size=(5, 7, 4))
    motion = nuno.Knots(now, values, 2.0)
    assert motion.world_count == 5
    np.testing.assert_allclose(motion.at(np.linspace(0.0, 2.0, 8)[1:]), values, atol=1e-12)
    keys = np.concatenate([np.broadcast_to(now, (5, 1, 4)), values], axis=1)
    for k in range(7):
        piece = motion.at(np.linspace(2.0 * k / 7, 2.0 * (k + 1) / 7, 30))
        low, high = np.minimum(keys[:, k], keys[:, k + 1]), np.maximum(keys[:, k], keys[:, k + 1])
        assert (piece >= low[:, None] - 1e-12).all() and (piece <= high[:, None] + 1e-12).all()
    alone = nuno.Knots(now, values[2], 2.0)
    assert np.array_equal(alone.at([0.3, 1.1]), motion.at([0.3, 1.1])[2])


def test_what_is_left_goes_on_where_the_motion_is():
    """A rest begins where the motion is then, is the same line on, ends with it (shrink) or rests at its end."""
    motion = nuno.Knots([0.0], [[1.0], [2.0], [3.0], [4.0]], 4.0)
    shrunk, kept = motion.later(1.5, shrink=True), motion.later(1.5)
    times = np.array([0.0, 0.7, 2.5])
    np.testing.assert_allclose(shrunk.at(times)[:, 0], 1.5 + times, atol=1e-12)
    assert shrunk.seconds == 2.5 and kept.seconds == 4.0 and kept.values.shape == (4, 1)
    assert kept.now == pytest.approx(1.5) and kept.values[-1] == 4.0
    np.testing.assert_allclose(kept.values[:, 0], [2.5, 3.5, 4.0, 4.0], atol=1e-12)
    with pytest.raises(InvalidInputError, match="nothing is left"):
        motion.later(4.0, shrink=True)


def test_paths_are_samples_of_the_motion():
    """A path begins at the world's time; it has an axis of worlds where the motion has, and takes the columns."""
    random = np.random.default_rng(4)
    motion = nuno.Knots(random.normal(size=6), random.normal(size=(2, 3, 6)), 0.5)
    path, fine = motion.path(7.0, slice(3, 6)), motion.at(np.linspace(0.0, 0.5, 31))
    assert path.world_count == 2 and path.times[0] == 7.0 and path.times[-1] == 7.5 and len(path.times) == 31
    np.testing.assert_array_equal(path.positions, fine[..., 3:])
    np.testing.assert_array_equal(
        motion.path(0.0, [5, 1, 0]).positions, motion.at(np.linspace(0.0, 0.5, 31))[..., [5, 1, 0]]
    )
    for wrong in (slice(4, 7), [0, 1], 2, [0, 1, 9]):
        with pytest.raises(InvalidInputError, match="columns"):
            motion.path(0.0, wrong)


def test_shapes_that_do_not_fit_are_named():
    """Places of other numbers, worlds without knots of their own, times that are none."""
    for now, values, seconds, named in (
        ([0.0], [[0.0, 1.0]], 1.0, "now"), ([[0.0], [1.0]], [[0.0]], 1.0, "each of them"),
        ([0.0], [0.0], 1.0, "values"),
        ([0.0], [[np.nan]], 1.0, "values"), ([0.0], [[1.0]], 0.0, "seconds"), ([0.0], [[1.0]], 1e9, "seconds"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=named):
            nuno.Knots(now, values, seconds)
