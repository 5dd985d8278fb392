"""Validation: numbers that no float of 32 bits holds are named before anything changes."""

import warnings

import numpy as np
import pytest

import nuno
from nuno import InvalidInputError
from nuno.validation import GREATEST, finite_array, number

BEYOND = 1e40  # the greatest float is 2^128 - 2^104 = 3.4e38


def test_the_greatest_float_is_taken():
    """The bound is IEEE 754's, in both signs; infinities and NaN are not finite."""
    assert GREATEST == 2.0**128 - 2.0**104
    for value in (GREATEST, -GREATEST, 0.0, 5e-324):
        assert number("x", value) == value and finite_array("x", [value], (1,))[0] == value
    for value in (2.0**128, -BEYOND, np.inf, -np.inf, np.nan):
        with pytest.raises(InvalidInputError):
            number("x", value)
        with pytest.raises(InvalidInputError):
            finite_array("x", [0.0, value], (2,))


def test_numbers_beyond_floats_are_named():
    """Forces, velocities, places and materials of 1e40, without NumPy's warnings; the world goes on as it was."""
    world = nuno.World(device="cpu", gravity=(0.0, 0.0, 0.0))
    body, cloth = world.add(nuno.box((0.1,) * 3)), world.add(nuno.sheet((0.1, 0.1), (2, 2), position=(1.0, 0.0, 0.0)))
    world.attach(body, nuno.Rigid(mass=1.0))
    world.attach(cloth)
    places = body.position, cloth.vertices
    far = (BEYOND, 0.0, 0.0)
    calls = [
        lambda: world.push(body, far), lambda: world.push(cloth, far), lambda: world.set_velocity(body, far),
        lambda: world.set_velocity(cloth, far), lambda: world.grip(cloth, [0], to=far), lambda: body.locate(far),
        lambda: world.push(body, (0.0, 0.0, 0.0), torque=far), lambda: nuno.Rigid(mass=BEYOND),
        lambda: nuno.Cloth(area_density=[1.0, BEYOND]), lambda: world.set_friction(body, cloth, BEYOND),
    ]  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for call in calls:
            with pytest.raises(InvalidInputError, match="greatest float"):
                call()
        world.run(0.05)
    np.testing.assert_array_equal(body.position, places[0])
    np.testing.assert_array_equal(cloth.vertices, places[1])
