"""A cloth's elastic energy against the integrals that it stands for, element by element."""

import numpy as np
import pytest

import nuno
from nuno.bodies.cloth_measures import elastic_energy
from nuno.topology.cloth_topology import ClothTopology

CELLS, SIZE = (6, 4), (0.3, 0.2)
AREA = SIZE[0] * SIZE[1]
SOFTEST = 1e-12


def topology(kind):
    """A sheet, or a cloth mesh of the same vertices and faces."""
    sheet = ClothTopology.sheet(CELLS, SIZE)
    return sheet if kind == "sheet" else ClothTopology.mesh(sheet.rest[:, :2], sheet.faces)


def only(**stiffness):
    """A cloth with one stiffness alone; nothing may be zero but the bending rigidity."""
    none = {"stretch_stiffness": SOFTEST, "shear_stiffness": SOFTEST, "bending_rigidity": 0.0}
    return nuno.Cloth(**{**none, **stiffness})


@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_stretch(kind):
    """1/2 K e^2 over the area, along warp and weft by their own stiffness, exactly: strain is uniform."""
    own = topology(kind)
    x = own.rest * (1.1, 0.8, 1.0)
    expected = 0.5 * AREA * (700.0 * 0.1**2 + 300.0 * 0.2**2)
    assert elastic_energy(own, x[None], only(stretch_stiffness=(700.0, 300.0)))[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_shear(kind):
    """1/2 S sin^2 of the shear angle over the area, of a sheet whose weft leans."""
    own, angle = topology(kind), 0.3
    x = own.rest[:, :1] * (1.0, 0.0, 0.0) + own.rest[:, 1:2] * (np.sin(angle), np.cos(angle), 0.0)
    expected = 0.5 * 250.0 * AREA * np.sin(angle) ** 2
    assert elastic_energy(own, x[None], only(shear_stiffness=250.0))[0] == pytest.approx(expected, rel=1e-6)


def test_bending_of_a_twisted_sheet():
    """1/2 B 2 k_xy^2 over the area, of the saddle z = k x y, exactly."""
    own, k = topology("sheet"), 0.01
    x = own.rest + np.outer(k * own.rest[:, 0] * own.rest[:, 1], (0.0, 0.0, 1.0))
    energy = elastic_energy(own, x[None], only(bending_rigidity=1e-4))[0]
    assert energy == pytest.approx(1e-4 * k**2 * AREA, rel=1e-5)


def test_bending_of_a_twisted_mesh():
    """As of the sheet, but for triangles at the rim, which lack neighbours: of cells half as long half as much."""
    off = []
    for times in (1, 2, 4):
        sheet, k = ClothTopology.sheet((times * CELLS[0], times * CELLS[1]), SIZE), 0.01
        own = ClothTopology.mesh(sheet.rest[:, :2], sheet.faces)
        x = own.rest + np.outer(k * own.rest[:, 0] * own.rest[:, 1], (0.0, 0.0, 1.0))
        off.append(elastic_energy(own, x[None], only(bending_rigidity=1e-4))[0] / (1e-4 * k**2 * AREA) - 1.0)
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 2.0, rtol=0.05)
    assert 0.0 < off[-1] < 0.03


@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_bending_of_a_cylinder(kind):
    """1/2 B k^2, of z = k x^2 / 2, over the area without half a cell at the two ends, exactly."""
    own, k = topology(kind), 0.01
    x = own.rest + np.outer(0.5 * k * own.rest[:, 0] ** 2, (0.0, 0.0, 1.0))
    expected = 0.5 * 1e-4 * k**2 * AREA * (CELLS[0] - 1) / CELLS[0]
    assert elastic_energy(own, x[None], only(bending_rigidity=1e-4))[0] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("kind", ["sheet", "mesh"])
def test_motion_and_shape_at_rest(kind):
    """A turned and moved rest shape stores nothing, also one of a mesh that is not flat."""
    own = topology(kind)
    rest = own.rest
    if kind == "mesh":
        rest = np.column_stack([rest[:, :2], 5.0 * rest[:, 0] ** 2])
        own = ClothTopology.mesh(rest, own.faces)
    turn = nuno.shapes.quaternion.from_axis_angle(np.array([0.6, 0.0, 0.8]), 1.0)
    x = nuno.shapes.quaternion.rotate(turn, rest) + np.array([1.0, 2.0, 3.0])
    # weights and rests are exact to float32's last digit, or to rounding
    assert elastic_energy(own, x[None], nuno.Cloth())[0] < 1e-12


def test_stiffness_by_element_and_world():
    """Values by cell are averaged as the solver does it, and each world has its own."""
    own = topology("sheet")
    x = np.repeat(own.rest[None] * (1.1, 1.0, 1.0), 2, axis=0)
    cells = np.full((2, 24), 100.0)
    cells[1] *= 3.0
    energy = elastic_energy(own, x, only(stretch_stiffness=cells), 2)
    np.testing.assert_allclose(energy, 0.5 * AREA * 0.01 * np.array([100.0, 300.0]), rtol=1e-6)
