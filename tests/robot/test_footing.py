"""Footing: which feet bear, by what they press on and when."""

import numpy as np

from nuno.robot.footing import Footing, Soles, found_footings, planned_footings

WEIGHT, SPAN = 900.0, 1 / 60


def soles(actual, wanted, pressed, sinking=(0.0, 0.0)):
    """Soles at heights [m], as they are and as they are wanted, in one world."""

    def placed(heights):
        return np.array([[(0.0, side, z) for side, z in zip((0.1, -0.1), heights, strict=True)]])

    upright = np.tile(np.eye(3), (1, 2, 1, 1))
    return Soles(
        placed(actual), upright, placed(wanted), upright, np.array([sinking]), np.array([pressed], dtype=float)
    )


def found_footing(before, there, lean=(0.0, 0.0, 0.0)):
    """The footing of one robot after a frame."""
    return found_footings([before], there, WEIGHT, np.array([SPAN]), np.array([lean]))[0]


def start(bears=(True, True)):
    """Both feet where they are wanted."""
    return Footing(bears, np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(3))


def test_what_is_planned_bears_before_anything_is_known():
    """At first, and only the foot that is wanted on the ground."""
    assert planned_footings(np.array([[0.0, 0.05]]))[0].bears == (True, False)


def test_a_foot_that_lands_early_bears_from_then_on():
    """On a board of 1 cm, while it is wanted down: it bears, and the height is kept; on its way up it does not."""
    met = found_footing(start((True, False)), soles((0, 0.01), (0, 0.004), (450, 450), (0, -0.1)))
    assert met.bears == (True, True)
    np.testing.assert_allclose(met.offsets[1], (0, 0, 0.006))
    left = found_footing(start((True, False)), soles((0, 0.01), (0, 0.004), (450, 450), (0, 0.1)))
    assert left.bears == (True, False)


def test_a_foot_over_a_hole_does_not_bear():
    """It was to land, meets nothing and is above where it stood: it does not bear until it presses."""
    before = start((True, False))
    air = found_footing(before, soles((0, 0), (0, 0), (900, 0)))
    assert air.bears == (True, False)
    assert found_footing(air, soles((0, -0.01), (0, 0), (450, 450))).bears == (True, True)


def test_a_foot_without_weight_still_stands():
    """The weight is on the other, as in a push aside; lifted by a centimetre it stands no more."""
    assert found_footing(start(), soles((0, 0.001), (0, 0), (900, 0))).bears == (True, True)
    assert found_footing(start(), soles((0, 0.01), (0, 0), (900, 0))).bears == (True, False)


def test_the_centre_of_mass_goes_along_with_the_feet():
    """Both feet 1 cm up: it follows with a time constant of 0.2 s; a load's lean adds to that."""
    footing, both = start(), soles((0.01, 0.01), (0, 0), (450, 450))
    for _ in range(12):
        footing = found_footing(footing, both)
    np.testing.assert_allclose(footing.centre[2], 0.01 * (1 - np.exp(-1.0)))
    for _ in range(300):
        footing = found_footing(footing, both, (-0.02, 0.0, 0.0))
    np.testing.assert_allclose(footing.centre, (-0.02, 0.0, 0.01), atol=1e-6)
