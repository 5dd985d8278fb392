"""Deformation's energy, and the search against every place there is."""

import itertools

import numpy as np
import pytest

from nuno.camera.edge_field import DIRECTIONS, EdgeField, edge_field
from nuno.camera.template_refinement import energy_of, refine_candidate
from nuno.camera.template_search import TemplateSearch, Weights
from nuno.camera.triangle_deformation import SCALE_WEIGHT, deformation, to_unit
from nuno.camera.triangulated_polygon import triangulate_polygon

TRIANGLE = np.array([[0.0, 0.0], [3.0, 0.5], [1.0, 2.0]])


def energy(matrix, scale=1.0):
    """The deformation of TRIANGLE by a matrix (2, 2)."""
    moved = TRIANGLE @ np.asarray(matrix).T
    return float(deformation(to_unit(TRIANGLE), moved[1] - moved[0], moved[2] - moved[0], scale))


def test_deformation_is_that_of_the_singular_values():
    """log^2 of their ratio, and of their geometric mean over the scale; float32's rounding is 1e-6 or so."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        matrix = rng.normal(size=(2, 2)) + 2 * np.eye(2)
        if np.linalg.det(matrix) < 0.2:
            continue
        large, small = np.linalg.svd(matrix)[1]
        expected = np.log(large / small) ** 2 + SCALE_WEIGHT * np.log(np.sqrt(large * small) / 1.5) ** 2
        assert energy(matrix, 1.5) == pytest.approx(expected, rel=1e-4, abs=1e-5)


def test_similarities_cost_nothing():
    """A turn with the scale that is looked for is no deformation; a triangle turned over is not allowed."""
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]])
    assert energy(0.7 * turn, 0.7) == pytest.approx(0.0, abs=1e-6)
    assert energy(np.diag([1.0, -1.0])) == np.inf


def test_edges_have_directions():
    """A step up along x supports a segment along y, one that runs along x not at all, and either way round alike."""
    image = np.zeros((40, 40, 1), np.float32)
    image[:, 20:] = 50.0
    field = edge_field(image, np.ones((40, 40), bool))
    up = field.support(np.array([19.5, 8.0]), np.array([19.5, 32.0]), 12)
    assert up > 0.5
    assert field.support(np.array([19.5, 32.0]), np.array([19.5, 8.0]), 12) == up
    assert field.support(np.array([8.0, 20.0]), np.array([32.0, 20.0]), 12) < 0.1 * up
    assert field.support(np.array([10.0, 8.0]), np.array([10.0, 32.0]), 12) < 0.01
    wide = field.widened(4)
    assert wide.support(np.array([16.5, 8.0]), np.array([16.5, 32.0]), 12) == pytest.approx(up, rel=0.05)


def test_dynamic_programming_finds_the_least_energy():
    """A quadrilateral on a grid of 5 x 5: the best of all 25^4 places, tried one by one within its limits."""
    rng = np.random.default_rng(3)
    maps = rng.uniform(0, 1, (DIRECTIONS, 20, 20)).astype(np.float32)
    maps[:, [0, -1]] = maps[:, :, [0, -1]] = 0.0
    field = EdgeField(maps)
    spacing = 4
    polygon = triangulate_polygon(np.array([[0.0, 0.0], [9.0, 1.0], [8.0, 8.0], [-1.0, 7.0]]))
    weights = Weights(1.0, 1.0, (0.7, 1.3))
    search = TemplateSearch(polygon, field, spacing, weights)
    best = search.best(1)[0]
    sides, lengths = polygon.sides, [np.linalg.norm(polygon.points[j] - polygon.points[i]) for i, j in polygon.sides]
    offset = (np.array([20, 20]) - 1 - spacing * 4) / 2.0
    places = np.stack(np.meshgrid(np.arange(5), np.arange(5)), axis=-1).reshape(-1, 2) * spacing + offset
    support = {}
    for (i, j), length in zip(sides, lengths, strict=True):
        samples = max(4, round(1.5 * length / spacing))
        support[i, j] = field.support(places[:, None], places[None], samples) * (length / sum(lengths))
    least = np.inf
    a, b = (tuple(map(int, triangle)) for triangle in polygon.triangles)
    costs = {}
    for triangle in (a, b):
        corners = polygon.points[list(triangle)]
        first, second = places[None, :, None] - places[:, None, None], places[None, None] - places[:, None, None]
        cost = deformation(to_unit(corners), first, second)
        costs[triangle] = np.where(cost < 0.6, cost, np.inf)  # the coarse search's limit
    for f in itertools.product(range(25), repeat=4):
        bent = costs[a][f[a[0]], f[a[1]], f[a[2]]]
        if not np.isfinite(bent):
            continue
        bent = 0.5 * (bent + costs[b][f[b[0]], f[b[1]], f[b[2]]])
        if np.isfinite(bent):
            least = min(least, bent - sum(support[i, j][f[i], f[j]] for i, j in sides))
    assert best.energy == pytest.approx(least, abs=1e-5)  # float32 sums
    shown, bent = energy_of(polygon, best.points, field, weights)
    assert np.isfinite(shown) and bent < 0.6


def test_refining_never_makes_it_worse():
    """Moves are taken as long as the energy falls, and none is always among them."""
    rng = np.random.default_rng(4)
    field = EdgeField(rng.uniform(0, 1, (DIRECTIONS, 40, 40)).astype(np.float32))
    polygon = triangulate_polygon(np.array([[10.0, 10.0], [28.0, 12.0], [27.0, 27.0], [11.0, 25.0]]))
    weights = Weights(1.0, 1.0, (0.6, 1.1))
    energies = [refine_candidate(polygon, polygon.points, field, 1.0, weights, rounds).energy for rounds in (1, 2, 4)]
    assert energies[0] >= energies[1] >= energies[2]
