"""Joint trajectories: what they refuse, and their splines."""

import numpy as np
import pytest

from nuno.errors import InvalidInputError, UnknownNameError
from nuno.robot.trajectory import JointTrajectory, Spline

REST = np.zeros(2)


def spline(times, positions, velocities=None, accelerations=None, first=None, start=0.0):
    """Return the spline of a trajectory of two joints."""
    begin = (REST, REST, REST) if first is None else first
    return Spline(start, start, begin, JointTrajectory(("a", "b"), times, positions, velocities, accelerations))


def test_positions_alone_are_joined_by_lines():
    """From where the joints are, at the slopes' velocities, and at rest after the end."""
    own = spline([1.0, 3.0], [[1.0, -2.0], [2.0, 0.0]])
    position, velocity, acceleration = own.at(0.25)
    np.testing.assert_allclose(position, (0.25, -0.5))
    np.testing.assert_allclose(velocity, (1.0, -2.0))
    np.testing.assert_allclose(acceleration, 0.0)
    np.testing.assert_allclose(own.at(2.0)[0], (1.5, -1.0))
    np.testing.assert_allclose(own.at(2.0)[1], (0.5, 1.0))
    np.testing.assert_allclose(own.at(5.0)[0], (2.0, 0.0))
    np.testing.assert_allclose(own.at(5.0)[1], 0.0)


@pytest.mark.parametrize("with_accelerations", [False, True])
def test_splines_meet_their_points(with_accelerations):
    """Positions, velocities (and accelerations) at the points and at the start, from either side."""
    random = np.random.default_rng(0)
    times = np.array([0.7, 1.5, 1.9])
    p, v, a = random.normal(size=(3, 3, 2))
    first = tuple(random.normal(size=(3, 2)))
    own = spline(times, p, v, a if with_accelerations else None, first, start=2.0)
    wanted = [(2.0, *first), *((2.0 + t, *motion) for t, *motion in zip(times, p, v, a, strict=True))]
    for k, (time, position, velocity, acceleration) in enumerate(wanted):
        for side in (-1e-9, 1e-9):
            if (k == 0 and side < 0) or (k == 3 and side > 0):
                continue
            found = own.at(time + side)
            np.testing.assert_allclose(found[0], position, atol=1e-7)  # 1e-9 s at up to 10 rad/s
            np.testing.assert_allclose(found[1], velocity, atol=1e-6)
            if with_accelerations:
                np.testing.assert_allclose(found[2], acceleration, atol=1e-5)


def test_velocities_and_accelerations_are_derivatives():
    """Central differences of positions and of velocities; third derivatives of up to 1e3 leave 1e-6."""
    random = np.random.default_rng(1)
    p, v, a = random.normal(size=(3, 2, 2))
    for accelerations in (None, a):
        own = spline([0.8, 1.7], p, v, accelerations)
        for t in (0.1, 0.5, 1.2, 1.6):
            (before, speed_before, _), (after, speed_after, _) = own.at(t - 1e-5), own.at(t + 1e-5)
            _, velocity, acceleration = own.at(t)
            np.testing.assert_allclose((after - before) / 2e-5, velocity, atol=1e-6)
            np.testing.assert_allclose((speed_after - speed_before) / 2e-5, acceleration, atol=1e-5)


def test_rest_to_rest_is_the_known_polynomial():
    """3 s^2 - 2 s^3 with velocities, 10 s^3 - 15 s^4 + 6 s^5 with accelerations."""
    still = np.zeros((1, 2))
    for s in (0.2, 0.5, 0.9):
        cubic = spline([2.0], [[1.0, 1.0]], still).at(2.0 * s)[0]
        np.testing.assert_allclose(cubic, 3 * s**2 - 2 * s**3)
        quintic = spline([2.0], [[1.0, 1.0]], still, still).at(2.0 * s)[0]
        np.testing.assert_allclose(quintic, 10 * s**3 - 15 * s**4 + 6 * s**5)


def test_a_piece_holds_until_the_next():
    """What it says of a time is what the spline says, and it tells when it ends."""
    own = spline([1.0, 2.0], [[1.0, 0.0], [0.0, 1.0]], np.zeros((2, 2)), start=1.0)
    piece = own.piece(1.2)
    assert (piece.start, piece.end) == (1.0, 2.0)
    np.testing.assert_array_equal(piece.at(1.7)[0], own.at(1.7)[0])
    assert own.piece(2.0).end == 3.0
    assert own.piece(3.0).end == np.inf
    assert own.end == 3.0


def test_part_of_the_joints():
    """In another order, with all that belongs to them."""
    own = JointTrajectory(("a", "b", "c"), [1.0], [[1.0, 2.0, 3.0]], [[4.0, 5.0, 6.0]], [[7.0, 8.0, 9.0]])
    part = own.of(("c", "a"))
    assert part.names == ("c", "a")
    np.testing.assert_array_equal(part.positions, [[3.0, 1.0]])
    np.testing.assert_array_equal(part.velocities, [[6.0, 4.0]])
    np.testing.assert_array_equal(part.accelerations, [[9.0, 7.0]])
    with pytest.raises(UnknownNameError, match="tail"):
        own.of(("tail",))


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"names": ()}, "names"),
        ({"names": ("a", "a")}, "twice"),
        ({"names": ("a",)}, "positions"),
        ({"times": [1.0, 1.0]}, "increase"),
        ({"times": [2.0, 1.0]}, "increase"),
        ({"times": [-1.0, 1.0]}, "at least 0"),
        ({"times": [1.0, np.nan]}, "finite"),
        ({"times": []}, "times"),
        ({"positions": [[0.0, np.inf], [0.0, 0.0]]}, "finite"),
        ({"positions": [[0.0, 0.0]]}, "positions"),
        ({"velocities": [[0.0, 0.0]]}, "velocities"),
        ({"accelerations": np.zeros((2, 2))}, "velocities"),
    ],
)
def test_what_is_refused(change, what):
    """Each with what is wrong."""
    good = {"names": ("a", "b"), "times": [1.0, 2.0], "positions": np.zeros((2, 2))}
    JointTrajectory(**good)
    with pytest.raises(InvalidInputError, match=what):
        JointTrajectory(**(good | change))


def test_numbers_are_kept_from_changes():
    """The arrays are copies, and read-only."""
    given = np.zeros((1, 1))
    own = JointTrajectory(("a",), [1.0], given)
    given[:] = 5.0
    assert own.positions[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        own.positions[0, 0] = 1.0
