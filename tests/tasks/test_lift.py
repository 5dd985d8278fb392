"""Lifting a soft cube between two hands: the least squeeze, by Coulomb."""

import numpy as np
import pytest

import nuno
from nuno.tasks.lift import lift_soft_cube


@pytest.mark.parametrize("mu", [pytest.param(0.3, marks=pytest.mark.long), 0.6])
def test_the_least_squeeze_is_coulombs(mu):
    """Closed form: 2 mu N >= m g; the issue asks for 10 %, of which the search's own steps are 1 %."""
    material = nuno.Soft(density=200.0, youngs_modulus=2e4, poisson_ratio=0.3, friction=mu, damping=0.01)
    found = lift_soft_cube(cells=4, material=material, device="cpu")
    assert found.closed_form == pytest.approx(0.2 * 9.81 / (2.0 * mu))
    assert found.least_force == pytest.approx(found.closed_form, rel=0.1)
    first = int(np.flatnonzero(found.held)[0])
    assert found.least_squeeze == found.squeezes[first] and found.least_force == found.forces[first]
    assert 0 < first and found.held[first:].all()  # one threshold, below which all are dropped
    assert (found.sunk[:first] > 0.05).all()  # on the floor, while the hands rose by 0.06 m
    assert np.isnan(found.forces[:first]).all()


def test_what_cannot_be_lifted_is_refused():
    """Too soft or too smooth a cube would be crushed before it is held."""
    with pytest.raises(nuno.InvalidInputError, match="crushes"):
        lift_soft_cube(material=nuno.Soft(youngs_modulus=500.0), device="cpu")
    with pytest.raises(nuno.InvalidInputError, match="friction above 0"):
        lift_soft_cube(material=nuno.Soft(friction=0.0), device="cpu")
    with pytest.raises(nuno.InvalidInputError, match="edge"):
        lift_soft_cube(edge=-0.1, device="cpu")


def test_a_squeeze_too_weak_holds_nothing():
    """Where no squeeze that was tried holds the cube, the result says so."""
    found = lift_soft_cube(cells=3, most=1e-4, tries=4, rounds=1, device="cpu")
    assert not found.held.any()
    with pytest.raises(nuno.EstimationError, match="no squeeze"):
        _ = found.least_force
