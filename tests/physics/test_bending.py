"""Bending: strips under their own weight against the elastica, its directions, and its small-deflection limit."""

import numpy as np
import pytest
from elastica import cantilever, drop_over_reach, rigidity_ratio
from world_with import GRAVITY, attached, rows

import nuno


def ratios(loads, cells, **options):
    """Return effective over nominal rigidity of each strip."""
    measured, felt, _ = cantilever(list(loads), cells, **options)
    return np.array([rigidity_ratio(g, r) for g, r in zip(felt, measured, strict=True)])


def test_the_master_curve_is_the_published_one():
    """Solved here against Peirce's rule: at G = 8 the chord falls by 41.5 degrees (Peirce 1930)."""
    assert np.degrees(np.arctan(drop_over_reach(8.0))) == pytest.approx(41.5, abs=0.05)  # as he rounds it
    assert drop_over_reach(0.1) == pytest.approx(0.1 / 8, rel=1e-3)  # small deflection G / 8, next order G^2


@pytest.mark.parametrize("along", ["warp", "weft"])
def test_a_resolved_strip_has_its_nominal_rigidity(along):
    """Elastica at G = 3, 10, 30, with substeps that resolve the stiffness (see the comment)."""
    # one pass a substep adds dt^2 3 / (rho h^4) to 1 / B: at G = 3 and 120 substeps 4 %; the mesh of 10 cells 4 %
    np.testing.assert_allclose(ratios((3.0, 10.0, 30.0), 10, along=along, substeps=120), 1.0, atol=0.08)


@pytest.mark.parametrize(("cells", "load"), [(10, 30.0), (20, 30.0), (20, 10.0)])
def test_a_strip_has_its_nominal_rigidity_at_default_substeps(cells, load):
    """Elastica within 10 %, what Nuno promises for G from 1 to 30."""
    assert ratios((load,) * 2, cells)[0] == pytest.approx(1.0, abs=0.10)


@pytest.mark.slow
@pytest.mark.parametrize("cells", [10, 20, 40])
@pytest.mark.parametrize("load", [1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0])
def test_any_strip_has_its_nominal_rigidity_at_default_substeps(cells, load):
    """Elastica within 10 %, what Nuno promises for G from 1 to 30."""
    assert ratios((load,) * 2, cells)[0] == pytest.approx(1.0, abs=0.10)


def test_a_wide_strip_bends_like_a_narrow_one():
    """Elastica at G = 10: without Poisson effect a strip's shape does not depend on its width."""
    narrow, *_ = cantilever([10.0, 20.0], 10, across=1, substeps=60)
    wide, *_ = cantilever([10.0, 20.0], 10, across=6, substeps=60)
    np.testing.assert_allclose(wide, narrow, rtol=0.02)  # what a pass leaves undone depends on the order, 2 %


def test_a_small_deflection_is_that_of_a_beam():
    """Closed form w L^4 / (8 B) at G = 0.1 and 0.2, H / L = G / 8."""
    # 5 cells so that few substeps resolve so stiff a strip: the mesh's own error is then (h / L)^2 = 4 %, and what
    # one pass adds to 1 / B 3 dt^2 / (rho h^4) = 3 %
    measured, felt, _ = cantilever([0.1, 0.2], 5, substeps=300)
    np.testing.assert_allclose(measured, felt / 8, rtol=0.10)


def test_warp_and_weft_bend_by_their_own_rigidity():
    """Elastica: a strip cut along the weft answers to the second of two rigidities, whatever the first is."""
    length, cells, load = 0.2, 10, 10.0
    h = length / (cells + 0.5)
    nominal = 0.2 * GRAVITY * length**3 / load
    for axis, rigidity in enumerate([(nominal, 7 * nominal), (7 * nominal, nominal)]):
        size, grid = ((cells + 1) * h, h), (cells + 1, 1)
        material = nuno.Cloth(bending_rigidity=rigidity, air_drag=10.0, thickness=1e-3)
        sheet = nuno.sheet(size[:: 1 - 2 * axis], cells=grid[:: 1 - 2 * axis], position=(0, 0, 1))
        world, body = attached(sheet, material, substeps=60)
        start = body.vertices
        held = np.flatnonzero(start[:, axis] < start[:, axis].min() + 1.5 * h)
        world.grip(body, held, to=start[held].mean(axis=0))
        world.run(3.0)
        tip = body.vertices[start[:, axis] > start[:, axis].max() - 0.5 * h].mean(axis=0)
        ratio = (1.0 - tip[2]) / (tip[axis] - start[held, axis].mean())
        assert rigidity_ratio(load, ratio) == pytest.approx(1.0, abs=0.08)  # mesh and pass, as above


def diagonal_wings(body, material, corner_axis, substeps):
    """Return the height that the two free corners fall when a square is held along its diagonal."""
    world, body = attached(body, material, worlds=np.size(material.bending_rigidity), substeps=substeps)
    start = rows(body)[0]
    off = start @ corner_axis
    held = np.flatnonzero(np.abs(off) < 1e-6)
    world.grip(body, held, to=start[held].mean(axis=0))
    world.run(3.0)
    far = np.abs(off) > np.abs(off).max() - 1e-6
    return (start[0, 2] - rows(body)[:, far, 2]).mean(axis=1)


def test_bending_is_isotropic():
    """Invariance: a square held along its diagonal droops the same whether its grid runs with it or at 45 degrees.

    Aligned with the grid only second differences along its lines act, at 45 degrees half of the energy is the
    twist of its cells: without it the corners would fall about twice as far.
    """
    side, n = 0.2, 12
    b = np.array([0.2, 0.4]) * 0.2 * GRAVITY * (side * np.sqrt(0.5)) ** 3
    material = nuno.Cloth(bending_rigidity=b, air_drag=12.0, shear_stiffness=1000.0, thickness=1e-3)
    across = np.array([1.0, 1.0, 0.0]) * np.sqrt(0.5)
    turned = diagonal_wings(nuno.sheet((side, side), cells=(n, n), position=(0, 0, 1)), material, across, 150)
    # the same square cut out of cloth whose grid is parallel to the diagonal; triangles along its sides
    half, m = side * np.sqrt(0.5), 8
    t = np.linspace(-1, 1, 2 * m + 1)
    u, v = (c.ravel() for c in np.meshgrid(t, t, indexing="xy"))
    keep = np.abs(u) + np.abs(v) < 1 + 1e-9
    number = np.cumsum(keep) - 1
    i, j = (c.ravel() for c in np.meshgrid(np.arange(2 * m), np.arange(2 * m), indexing="xy"))
    a = j * (2 * m + 1) + i
    quad = np.stack([a, a + 1, a + 2 * m + 2, a + 2 * m + 1], axis=1)
    # diagonals of the cells run along the nearest side of the square
    alike = (i - m + 0.5) * (j - m + 0.5) < 0
    faces = np.concatenate(
        [quad[alike][:, [0, 1, 2]], quad[alike][:, [0, 2, 3]], quad[~alike][:, [0, 1, 3]], quad[~alike][:, [1, 2, 3]]]
    )
    faces = number[faces[keep[faces].all(axis=1)]]
    vertices = np.stack([u, v, 0 * u], axis=1)[keep] * half + [0, 0, 1]
    aligned = diagonal_wings(nuno.cloth_mesh(vertices, faces), material, np.array([0.0, 1.0, 0.0]), 150)
    # two meshes of about 1/12 and 1/8 of the wing's length: their own errors are a few per cent each
    np.testing.assert_allclose(turned, aligned, rtol=0.10)
    assert (turned > 0.02 * side).all()


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0])
def test_a_bias_strip_of_a_mesh_bends_by_the_same_rigidity(angle):
    """Elastica at G = 10 for a strip cut at an angle to the warp, which the pattern says."""
    length, cells, across, load = 0.2, 10, 2, 10.0
    h = length / (cells + 0.5)
    nx, ny = cells + 1, across
    i, j = (c.ravel() for c in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="xy"))
    a, b = (c.ravel() for c in np.meshgrid(np.arange(nx), np.arange(ny), indexing="xy"))
    a = b * (nx + 1) + a
    faces = np.concatenate([np.stack([a, a + 1, a + nx + 2], 1), np.stack([a, a + nx + 2, a + nx + 1], 1)])
    flat = np.stack([i * h, j * h], axis=1)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    pattern = flat @ np.array([[c, s], [-s, c]])
    cut = nuno.cloth_mesh(np.column_stack([flat, np.ones(len(flat))]), faces, pattern)
    nominal = 0.2 * GRAVITY * length**3 / load
    # a shear as stiff as the stretch: in-plane strain is not what is measured
    material = nuno.Cloth(bending_rigidity=nominal, air_drag=10.0, shear_stiffness=1000.0, thickness=1e-3)
    world, body = attached(cut, material, substeps=100)
    held, tip = np.flatnonzero(i <= 1), i == nx
    world.grip(body, held, to=body.vertices[held].mean(axis=0))
    world.run(3.0)
    x = body.vertices
    ratio = (1.0 - x[tip, 2].mean()) / (x[tip, 0].mean() - 0.5 * h)
    assert rigidity_ratio(load, ratio) == pytest.approx(1.0, abs=0.10)  # one mesh, hinges at one diagonal: 10 %
