"""Convergence: smaller cells, and shorter substeps, move the answer toward the closed form."""

import numpy as np
import pytest
from elastica import cantilever, drop_over_reach
from triangles import rectangle
from world_with import GRAVITY, attached, rows

import nuno


def cantilever_error(kind, cells, substeps, load=3.0):
    """Return how far the drop over reach of a cantilever is off the elastica's, relative."""
    measured, felt, _ = cantilever([load] * 2, cells, kind=kind, substeps=substeps, across=2)
    return abs(measured[0] / drop_over_reach(felt[0]) - 1.0)


def hang_errors(kind, cells, substeps, length=0.4, drag=10.0):
    """Return how far the extensions of hung strips (20 and 40 N/m) are off w L^2 / (2 Et), relative."""
    stiffness = np.array([20.0, 40.0])
    h = length / cells
    points, faces = rectangle(kind, (length, 2 * h), h)
    shape = np.column_stack([0.0 * points[:, 0], points[:, 1], 1.0 - points[:, 0]])
    material = nuno.Cloth(
        stretch_stiffness=stiffness, shear_stiffness=stiffness, bending_rigidity=1e-6, air_drag=drag, thickness=1e-3
    )
    world, body = attached(nuno.cloth_mesh(shape, faces, points), material, worlds=2, substeps=substeps)
    top, tip = np.flatnonzero(points[:, 0] < 1e-9), points[:, 0] > length - 1e-9
    world.grip(body, top, to=rows(body)[0, top].mean(axis=0))
    world.run(4.0)
    extension = 1.0 - rows(body)[:, tip, 2].mean(axis=1) - length
    weight = 0.2 * GRAVITY / (1.0 + drag / (60 * substeps))  # implicit drag takes c dt off it
    return np.abs(extension / (weight * length**2 / (2 * stiffness)) - 1.0)


@pytest.mark.parametrize("kind", ["sheet", "right-angled"])
def test_smaller_cells_bend_more_like_the_elastica(kind):
    """Elastica at G = 3: half the cell takes the error, of second order in it, to less than a half."""
    coarse, fine = (cantilever_error(kind, cells, 60) for cells in (4, 8))
    assert fine < 0.5 * coarse  # a quarter, beside what 60 substeps leave


@pytest.mark.parametrize("kind", ["sheet", "right-angled", "equilateral"])
def test_shorter_substeps_bend_more_like_the_elastica(kind):
    """Elastica at G = 3: the error falls with the substep, until that of the mesh is left."""
    errors = [cantilever_error(kind, 8, substeps) for substeps in (10, 20, 40)]
    assert max(errors[1:]) < errors[0] and errors[2] < 0.5 * errors[0]
    assert errors[2] < 0.02  # the polygon's (h / L)^2


@pytest.mark.parametrize("kind", ["right-angled", "jittered"])
def test_shorter_substeps_stretch_more_as_the_stiffness_says(kind):
    """Closed form w L^2 / (2 Et): half the substep takes the error, Et dt^2 / (rho h^2), to a quarter."""
    coarse, fine = (hang_errors(kind, 10, substeps).mean() for substeps in (20, 40))
    assert fine < 0.35 * coarse  # of 4.5 %; float32's share is up to 0.5 %
