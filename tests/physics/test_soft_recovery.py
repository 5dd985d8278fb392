"""A soft body comes back from anything: scrambled at random, flat, or all of it at a point."""

import numpy as np
import pytest
from soft_with import block, rigid_fit_error, solver

import nuno

EDGE, CELLS = 0.2, 4
CUBE = block((EDGE, EDGE, EDGE), (CELLS, CELLS, CELLS))


def left_after(start, substeps=None, seconds=2.0, poisson_ratio=0.3):
    """Return (worlds,) how far the farthest vertex is from the rest shape, in cells' edges."""
    material = nuno.Soft(density=1000.0, youngs_modulus=5e4, poisson_ratio=poisson_ratio, damping=0.01)
    made = solver(CUBE, material, start=start, substeps=substeps)
    made.run(0.0, seconds)
    return np.array([rigid_fit_error(CUBE.rest, x).max() for x in made.positions()]) / (EDGE / CELLS)


@pytest.mark.parametrize(("substeps", "poisson_ratio"), [(None, 0.0), (None, 0.3), (40, 0.3), (None, 0.45)])
def test_from_random_starts_and_flat(substeps, poisson_ratio):
    """Promise: within 2 s, to 1 % of a cell's edge, from 20 random starts and squashed along each axis."""
    start = np.random.default_rng(0).uniform(-EDGE / 2, EDGE / 2, (23, *CUBE.rest.shape))
    for axis in range(3):
        start[20 + axis] = CUBE.rest
        start[20 + axis, :, axis] = 0.0
    assert left_after(start, substeps, poisson_ratio=poisson_ratio).max() < 0.01


def test_from_a_point_and_from_a_line():
    """Promise: what has no direction to grow in is shaken, always alike."""
    start = np.zeros((2, *CUBE.rest.shape))
    start[..., 2] = 1.0
    start[1, :, 0] = CUBE.rest[:, 0]
    assert left_after(start).max() < 0.01
    np.testing.assert_array_equal(left_after(start, seconds=0.1), left_after(start, seconds=0.1))


def test_turned_inside_out():
    """Promise: a mirrored body, whose every element is inside out, finds back too."""
    assert left_after((CUBE.rest * [1.0, 1.0, -1.0])[None]).max() < 0.01


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("young", [5e4, 5e6, 5e8])
def test_no_stiffness_is_too_much(young, poisson_ratio):
    """Promise: what is stiffer than the substeps carry comes out softer, and never explodes."""
    material = nuno.Soft(density=1000.0, youngs_modulus=young, poisson_ratio=poisson_ratio)
    start = CUBE.rest[None] + [0.0, 0.0, 0.4]
    made = solver(CUBE, material, nuno.plane(), start=start, gravity=(0, 0, -9.81), substeps=10)
    made.run(0.0, 2.0)
    assert made.finite().all()
    # at rest or nearly: no vertex faster than a tenth of its impact at 2.4 m/s, none off by a quarter of a cell
    assert np.abs(made.velocities()).max() < 0.24
    assert rigid_fit_error(CUBE.rest, made.positions()[0]).max() < 0.25 * EDGE / CELLS
