"""Newton's hinges: their energy is that of a cloth's rigidity."""

import numpy as np
import pytest

import nuno
from nuno.engines.newton.hinges import mesh_hinges, sheet_hinges

RIGIDITY = 2e-4  # [N m]


def energy(hinges, stiffness, rest, height):
    """Return the sum of k L theta^2 / 2 over hinges of a nearly flat surface z, by its triangles' normals."""
    points = np.column_stack([rest[:, :2], height])
    whole = (hinges >= 0).all(axis=1)
    a, b, c, d = (points[hinges[whole, k]] for k in range(4))
    normals = [np.cross(d - c, a - c), -np.cross(d - c, b - c)]
    one, other = (n / np.linalg.norm(n, axis=1, keepdims=True) for n in normals)
    angle = np.linalg.norm(np.cross(one, other), axis=1)
    length = np.linalg.norm(rest[hinges[whole, 2]] - rest[hinges[whole, 3]], axis=1)
    return 0.5 * (stiffness[whole] * length * angle**2).sum()


@pytest.mark.parametrize("shape", ["x", "y", "twist", "diagonal", "other diagonal"])
def test_a_sheet_bends_alike_in_all_directions(shape):
    """The plate's energy per area, B / 2 (kxx^2 + kyy^2 + 2 kxy^2), in every direction."""
    cells, size = (40, 30), (0.4, 0.36)
    sheet = nuno.sheet(size, cells).shape
    x, y = np.meshgrid(np.linspace(0, size[0], 41), np.linspace(0, size[1], 31))
    rest = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    u, v = 0.01 * rest[:, 0], 0.01 * rest[:, 1]  # a shallow surface: small slopes, as the closed form has
    x, y = rest[:, 0], rest[:, 1]
    kxx, kyy, kxy, z = {
        "x": (0.01, 0, 0, 0.5 * u * x), "y": (0, 0.01, 0, 0.5 * v * y), "twist": (0, 0, 0.01, u * y),
        "diagonal": (0.005, 0.005, 0.005, 0.25 * 0.01 * (x + y) ** 2),
        "other diagonal": (0.005, 0.005, -0.005, 0.25 * 0.01 * (x - y) ** 2),
    }[shape]  # fmt: skip
    found = energy(*sheet_hinges(sheet, RIGIDITY), rest, z)
    expected = 0.5 * RIGIDITY * (kxx**2 + kyy**2 + 2 * kxy**2) * size[0] * size[1]
    # exact inside; the outermost half cells along a line have no second difference: 1 / 40 and 1 / 30 of it
    assert found == pytest.approx(expected, rel=0.035)


def test_a_mesh_has_in_the_mean_the_energy_of_its_rigidity():
    """A flat mesh that is rolled up along x or y: their mean is the plate's energy, by the scale that is chosen."""
    cells = 12
    x, y = np.meshgrid(np.linspace(0, 0.3, cells + 1), np.linspace(0, 0.3, cells + 1))
    rest = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    k = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + cells + 2], 1), np.stack([k, k + cells + 2, k + cells + 1], 1)])
    hinges, stiffness = mesh_hinges(rest, faces, RIGIDITY)
    rolled = [energy(hinges, stiffness, rest, 0.005 * rest[:, axis] ** 2) for axis in (0, 1)]
    assert np.mean(rolled) == pytest.approx(0.5 * RIGIDITY * 0.01**2 * 0.09, rel=1e-3)
    assert len(hinges) == 3 * cells**2 + 2 * cells, "every edge once"


def test_every_grid_edge_of_a_sheet_is_a_hinge():
    """Contact of layers goes by the same edges: each side of a cell and both diagonals are there."""
    hinges, stiffness = sheet_hinges(nuno.sheet((0.3, 0.2), (3, 2)).shape, RIGIDITY)
    edges = {tuple(sorted(pair)) for pair in hinges[:, 2:].tolist()}
    assert len(edges) == 3 * 3 + 4 * 2 + 2 * 3 * 2
    assert (stiffness >= 0.0).all() and (stiffness[(hinges[:, :2] < 0).any(axis=1)] == 0.0).all()
