"""What the elements of a soft body say: volumes, strains, stresses."""

import numpy as np
import pytest

import nuno


def test_a_stretched_bar_says_so():
    """Uniform stretch by 1 % along x: Green's strain is 0.01005, the volume 1 % more, the rest zero, exactly."""
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    bar = world.add(nuno.soft_box((0.2, 0.1, 0.1), cells=(2, 1, 1)))
    assert nuno.elements(bar).stresses is None
    world.attach(bar, nuno.Soft(youngs_modulus=1e5, poisson_ratio=0.0))
    bar._dynamics.solver.set_state(bar.vertices[None] * (1.01, 1.0, 1.0), 0 * bar.vertices[None])
    state = nuno.elements(bar)
    assert state.rest_volumes.sum() == pytest.approx(0.002, rel=1e-12)
    np.testing.assert_allclose(state.volumes, 1.01 * state.rest_volumes, rtol=1e-5)  # positions are float32
    np.testing.assert_allclose(state.strains[:, 0, 0], 0.01005, atol=2e-5)
    # without a Poisson effect the stress is E times the strain to first order
    np.testing.assert_allclose(state.stresses[:, 0, 0], 1e3, rtol=0.03)
    np.testing.assert_allclose(state.stresses[:, 1, 1], 0.0, atol=15.0)


def test_elements_by_world():
    """In a batch all arrays start with the worlds."""
    world = nuno.World(device="cpu")
    body = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(1, 1, 1)))
    world.attach(body)
    futures = world.imagine(3)
    state = nuno.elements(futures.find(body.name))
    assert state.volumes.shape == (3, 5) and state.stresses.shape == (3, 5, 3, 3)


def test_a_cloth_has_no_tetrahedra():
    """The error names the body."""
    with pytest.raises(nuno.InvalidInputError, match="'sheet' is a sheet"):
        nuno.elements(nuno.sheet((1, 1), cells=(2, 2)))
