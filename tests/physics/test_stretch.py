"""Stretch and shear of a sheet, against the closed forms of a linear membrane without Poisson effect."""

import numpy as np
import pytest
from world_with import GRAVITY, attached, rows

import nuno

QUARTER = np.sqrt(0.5)
DOWN = {"warp": (QUARTER, 0.0, QUARTER, 0.0), "weft": (QUARTER, -QUARTER, 0.0, 0.0)}  # x, or y, points down


def hung(along, stiffness, *, length=0.4, cells=20, across=1, substeps=None, seconds=2.5, drag=30.0):
    """Return rest distances from the top (cells + 1,) and the sunk rows (worlds, cells + 1) [m]."""
    h = length / cells
    size, grid = ((length, across * h), (cells, across)) if along == "warp" else ((across * h, length), (across, cells))
    worlds = np.size(stiffness[0])
    material = nuno.Cloth(stretch_stiffness=stiffness, air_drag=drag, bending_rigidity=1e-6, thickness=1e-3)
    sheet = nuno.sheet(size, cells=grid, position=(0, 0, 1), quaternion=DOWN[along])
    world, body = attached(sheet, material, worlds=worlds, substeps=substeps)
    start = rows(body)[0]
    top = np.flatnonzero(start[:, 2] > start[:, 2].max() - 0.5 * h)
    world.grip(body, top, to=start[top].mean(axis=0))
    world.run(seconds)
    level = np.rint((start[:, 2].max() - start[:, 2]) / h).astype(int)
    end = rows(body)
    z = np.stack([end[:, level == k, 2].mean(axis=1) for k in range(cells + 1)], axis=1)
    return np.arange(cells + 1) * h, z[:, :1] - z


@pytest.mark.parametrize("along", ["warp", "weft"])
def test_a_hung_strip_stretches_as_its_stiffness_says(along):
    """Closed form strain(y) = w (L - y) / Et and tip extension w L^2 / (2 Et), warp and weft apart."""
    soft = np.array([20.0, 40.0, 80.0])
    stiffness = (soft, np.full(3, 1000.0)) if along == "warp" else (np.full(3, 1000.0), soft)
    y, z = hung(along, stiffness, substeps=120)
    weight = 0.2 * GRAVITY
    extension = z[:, -1] - y[-1]
    expected = weight * y[-1] ** 2 / (2 * soft)
    # one pass a substep adds dt^2 / (rho h^2) to 1 / Et, at most 1.9 % of it here (Et = 80)
    np.testing.assert_allclose(extension, expected, rtol=0.02)
    strain = np.diff(z, axis=1) / y[1] - 1
    middle = 0.5 * (y[1:] + y[:-1])
    np.testing.assert_allclose(strain, weight * (y[-1] - middle) / soft[:, None], rtol=0.02, atol=2e-4)


def test_a_wide_sheet_stretches_like_a_narrow_strip():
    """Closed form w L^2 / (2 Et): without Poisson effect the width does not matter."""
    y, z = hung("warp", (np.array([20.0, 40.0]), np.array([20.0, 40.0])), across=10, substeps=120)
    expected = 0.2 * GRAVITY * y[-1] ** 2 / (2 * np.array([20.0, 40.0]))
    np.testing.assert_allclose(z[:, -1] - y[-1], expected, rtol=0.02)  # as above


@pytest.mark.parametrize("cells", [10, 20, 40])
def test_a_stiff_strip_stretches_as_its_stiffness_says_at_default_substeps(cells):
    """Closed form w L^2 / (2 Et) for 1000 N/m, 0.4 mm in 0.4 m."""
    stiffness = np.array([300.0, 1000.0])
    y, z = hung("warp", (stiffness, stiffness), cells=cells, seconds=3.0, drag=10.0)
    # implicit drag takes c dt off the weight, 1.4 % at the 12 substeps of 10 cells
    expected = 0.2 * GRAVITY * y[-1] ** 2 / (2 * stiffness)
    np.testing.assert_allclose(z[:, -1] - y[-1], expected, rtol=0.02)


def test_pure_shear_follows_the_shear_stiffness():
    """Closed form gamma = tau / S of a square under equal shear tractions along its four sides."""
    stiffness = np.array([50.0, 100.0, 300.0])
    n, side = 8, 0.16
    material = nuno.Cloth(shear_stiffness=stiffness, air_drag=20.0, bending_rigidity=1e-4)
    sheet = nuno.sheet((side, side), cells=(n, n), position=(0, 0, 1))
    world, body = attached(sheet, material, worlds=3, gravity=(0, 0, 0), substeps=240)
    traction = 1.0  # [N/m]
    share = np.full(n + 1, traction * side / n)
    share[[0, -1]] *= 0.5
    force = np.zeros((n + 1, n + 1, 3))
    force[:, -1, 1] += share
    force[:, 0, 1] -= share
    force[-1, :, 0] += share
    force[0, :, 0] -= share
    world.push(body, force.reshape(-1, 3))
    world.run(2.0)
    x = rows(body).reshape(3, n + 1, n + 1, 3)
    h = side / n
    u = 0.5 * (x[:, :-1, 1:] - x[:, :-1, :-1] + x[:, 1:, 1:] - x[:, 1:, :-1]) / h
    v = 0.5 * (x[:, 1:, :-1] - x[:, :-1, :-1] + x[:, 1:, 1:] - x[:, :-1, 1:]) / h
    shear = (u * v).sum(axis=-1)
    # one pass a substep adds up to dt^2 / (rho h^2) to 1 / S, 1.8 % of it at S = 300; the second order in
    # gamma is 4e-4
    np.testing.assert_allclose(shear.mean(axis=(1, 2)), traction / stiffness, rtol=0.02)
    np.testing.assert_allclose(shear.std(axis=(1, 2)), 0.0, atol=0.02 * traction / stiffness.min())
