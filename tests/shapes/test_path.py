"""Paths: interpolation, holding before and after, checks."""

import numpy as np
import pytest

from nuno import InvalidInputError, Path
from nuno.shapes import quaternion as quat

EXACT = 1e-12  # a few roundings of float64 at lengths of about 1


def test_linear():
    """Straight between the keys, still before and after."""
    path = Path([1.0, 2.0, 4.0], [(0, 0, 0), (1, 0, 0), (1, 2, 0)])
    np.testing.assert_allclose(path.at(0.0), (0, 0, 0))
    np.testing.assert_allclose(path.at(1.25), (0.25, 0, 0), atol=EXACT)
    np.testing.assert_allclose(path.at([2.0, 3.0, 9.0]), [(1, 0, 0), (1, 1, 0), (1, 2, 0)], atol=EXACT)


def test_minimum_jerk_is_the_quintic():
    """10 s^3 - 15 s^4 + 6 s^5 in each segment, with rest at the keys."""
    path = Path([0.0, 2.0, 3.0], [(0, 0, 0), (1, 0, 0), (0, 0, 0)], interpolation="minimum_jerk")
    s = 0.3
    np.testing.assert_allclose(path.at(0.6)[0], 10 * s**3 - 15 * s**4 + 6 * s**5, atol=EXACT)
    np.testing.assert_allclose(path.at(2.5)[0], 0.5, atol=EXACT)
    # the quintic leaves its key as 10 s^3: 1e-11 after 1e-4 of a segment
    assert abs(path.at(2.0001)[0] - 1.0) < 1.1e-11


def test_orientations_go_the_short_way():
    """Halfway between 0 and 90 degrees is 45, whatever the quaternions' signs."""
    turned = -np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    path = Path([0.0, 1.0], np.zeros((2, 3)), [(1, 0, 0, 0), turned])
    half = path.quaternion_at(0.5)
    np.testing.assert_allclose(half, (np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)), atol=EXACT)
    np.testing.assert_array_equal(Path([0.0], [(0, 0, 0)]).quaternion_at(3.0), (1, 0, 0, 0))


def test_by_world_and_sampled():
    """A path may differ by world, and its samples lie on it."""
    path = Path([0.0, 1.0], [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (0, 1, 0)]], interpolation="minimum_jerk")
    assert path.world_count == 2 and path.at(0.5).shape == (2, 3)
    times = np.linspace(0.0, 1.0, 5)
    samples = path.sampled(times)
    np.testing.assert_array_equal(samples.at(times), path.at(times))
    assert samples.at(times).shape == (2, 5, 3)


@pytest.mark.parametrize(
    "arguments",
    [
        ([0.0, 0.0], np.zeros((2, 3))),
        ([1.0, 0.0], np.zeros((2, 3))),
        ([0.0, np.nan], np.zeros((2, 3))),
        ([], np.zeros((0, 3))),
        ([0.0, 1.0], np.zeros((3, 3))),
        ([0.0, 1.0], [(0, 0, np.inf), (0, 0, 0)]),
        ([0.0, 1.0], np.zeros((2, 3)), np.zeros((2, 4))),
        ([0.0, 1.0], np.zeros((2, 3)), None, "cubic"),
        ([0.0], np.zeros((2, 1, 3)), np.ones((3, 1, 4))),
    ],
)
def test_bad_paths(arguments):
    """Times that do not increase, values that are not finite, shapes that do not fit."""
    with pytest.raises(InvalidInputError):
        Path(*arguments)


def test_at_its_ends_a_turn_keeps_the_bits():
    """Slerp at 0 and at 1 as a number, which needs no sines, is that of an array of such numbers."""
    random = np.random.default_rng(0)
    a, b = (part / np.linalg.norm(part, axis=1, keepdims=True) for part in random.normal(size=(2, 300, 4)))
    b[:30], b[30:60] = a[:30], -a[30:60]
    for end in (0.0, 1.0):
        np.testing.assert_array_equal(quat.slerp(a, b, np.array(end)), quat.slerp(a, b, np.full(300, end)))


def test_a_path_takes_arrays_as_they_are():
    """With the numbers of one that copies them, which nobody writes to any more; what it cannot be is told."""
    from nuno.shapes.path import path_through

    times, positions = np.array([0.0, 0.5, 1.0]), np.random.default_rng(0).normal(size=(3, 4, 3)).swapaxes(0, 1)
    copied, own = Path(times, positions), path_through(times, positions)
    assert own.positions is positions and own.world_count == copied.world_count == 4 and own.quaternions is None
    assert own.at([0.2, 2.0]).tobytes() == copied.at([0.2, 2.0]).tobytes()
    with pytest.raises(ValueError, match="read-only"):
        positions[0] = 0.0
    for wrong in ((times, np.full((3, 3), np.inf)), (times + 1e17, np.zeros((3, 3)))):
        with pytest.raises(InvalidInputError):
            path_through(*wrong)
