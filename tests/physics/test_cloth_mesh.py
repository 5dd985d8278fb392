"""Cloth of any triangles against the sheet, and curved rest shapes."""

import numpy as np
import pytest
from elastica import cantilever, rigidity_ratio
from scipy.spatial import Delaunay
from triangles import KINDS
from world_with import GRAVITY, attached

import nuno


def irregular(size, cells, seed=2):
    """Return a rectangle (n, 2) in irregular triangles (m, 3): a staggered grid, jittered."""
    random = np.random.default_rng(seed)
    nx, ny = cells
    h = np.array([size[0] / nx, size[1] / ny])
    points = []
    for j in range(ny + 1):
        inner = (np.arange(nx) + 0.5 if j % 2 else np.arange(1, nx)) * h[0]
        points += [(x, j * h[1]) for x in np.r_[0.0, inner, size[0]]]
    points = np.array(points)
    jitter = random.uniform(-0.15, 0.15, points.shape) * h
    on_x = (points[:, 0] < 1e-9) | (points[:, 0] > size[0] - 1e-9)
    on_y = (points[:, 1] < 1e-9) | (points[:, 1] > size[1] - 1e-9)
    jitter[on_x, 0] = jitter[on_y, 1] = 0.0
    jitter[on_x & on_y] = 0.0
    points += jitter
    faces = Delaunay(points).simplices
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(area[:, None] > 0, faces, faces[:, ::-1])[np.abs(area) > 0.02 * h.prod()]
    return points, faces


def test_two_cloth_meshes_keep_their_own_elements():
    """Each mesh is simulated with its own vertices and faces, also where one came before it."""
    for n in (2, 3):
        points, faces = irregular((0.1 * n, 0.1), (n, 2))
        body = nuno.cloth_mesh(np.column_stack([points, np.ones(len(points))]), faces)
        world, body = attached(body, nuno.Cloth(air_drag=0.0))
        world.run(0.1)
        assert body.vertices.shape == (len(points), 3)
        # free fall, and the Euler step's g t dt / 2
        np.testing.assert_allclose(body.vertices[:, 2], 1 - 0.5 * GRAVITY * 0.01, atol=1e-3)


LOADS = [1.0, 3.0, 10.0, 30.0]


def rigidities(kind, cells, across=2):
    """Return effective over nominal rigidity of strips of triangles, one for each of `LOADS`."""
    # one world for each load, or the stiffest would set the substeps of all
    found = [cantilever([load] * 2, cells, across=across, kind=kind) for load in LOADS]
    ratios = [rigidity_ratio(felt[0], measured[0]) for measured, felt, _ in found]
    return np.array(ratios)


@pytest.mark.long
@pytest.mark.parametrize(
    "kind", [kind if kind in ("crossed", "jittered") else pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS]
)
def test_a_strip_of_any_triangles_has_its_nominal_rigidity_at_default_substeps(kind):
    """Elastica within 10 %, what Nuno promises for G from 1 to 30."""
    # squares cut both ways come out up to 11 % too stiff (docs/reports/performance.md)
    np.testing.assert_allclose(rigidities(kind, 10), 1.0, atol=0.12 if kind == "crossed" else 0.10)


@pytest.mark.slow
@pytest.mark.parametrize("across", [1, 4])
@pytest.mark.parametrize("cells", [10, 20])
@pytest.mark.parametrize("kind", KINDS)
def test_a_strip_of_any_width_has_its_nominal_rigidity_at_default_substeps(kind, cells, across):
    """Elastica within 10 %, also on finer meshes, and one cell wide."""
    # a ladder of squares cut at random, all of it rim, comes out up to 11 % too soft
    rough = kind == "crossed" or (kind == "scattered" and across == 1)
    np.testing.assert_allclose(rigidities(kind, cells, across), 1.0, atol=0.13 if rough else 0.10)


@pytest.mark.long
def test_an_irregular_mesh_hangs_like_a_sheet():
    """Invariance: a square hung by two corners has the same outline in irregular triangles as in a grid."""
    size, n = 0.4, 16
    material = nuno.Cloth(air_drag=3.0, thickness=0.002, bending_rigidity=5e-5)
    reach = []
    points, faces = irregular((size, size), (n, n))
    for body in (
        nuno.sheet((size, size), cells=(n, n), position=(size / 2, size / 2, 1)),
        nuno.cloth_mesh(np.column_stack([points, np.ones(len(points))]), faces),
    ):
        world, body = attached(body, material)
        x = body.vertices
        corners = [
            int(np.argmin(np.linalg.norm(x[:, :2] - c, axis=1))) for c in [(0, 0), (size, 0), (0, size), (size, size)]
        ]
        for corner, goal in zip(corners[:2], [(0.06, 0, 1), (size - 0.06, 0, 1)], strict=True):
            path = nuno.Path([0.0, 1.0], [x[corner], goal], interpolation="minimum_jerk")
            world.grip(body, corner, to=path)
        world.run(8.0)
        x = body.vertices
        reach.append([1 - x[corners[2], 2], 1 - x[corners[3], 2], 1 - x[:, 2].mean()])
    # strain of up to 1 % at default substeps in each, and folds that the two meshes lay differently
    np.testing.assert_allclose(reach[0], reach[1], rtol=0.05)


@pytest.mark.long
def test_a_curved_rest_shape_is_kept_without_gravity():
    """A half cylinder that is nowhere strained stays as it is, and comes back after a knock."""
    radius, n, m = 0.1, 16, 8
    angle = np.linspace(0, np.pi, n + 1)
    i, j = (c.ravel() for c in np.meshgrid(np.arange(n + 1), np.arange(m + 1), indexing="xy"))
    x = np.stack([radius * np.cos(angle[i]), 0.02 * j, radius * np.sin(angle[i])], axis=1)
    a, b = (c.ravel() for c in np.meshgrid(np.arange(n), np.arange(m), indexing="xy"))
    a = b * (n + 1) + a
    faces = np.concatenate([np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)])
    material = nuno.Cloth(bending_rigidity=1e-3, air_drag=3.0, thickness=0.002)
    world, body = attached(nuno.cloth_mesh(x, faces), material, gravity=(0, 0, 0), substeps=40)
    world.run(1.0)
    # a free body drifts by rounding, 2e-4 m after 2400 substeps; its shape is kept to float32 rest curvatures
    drift = (body.vertices - x).mean(axis=0)
    np.testing.assert_allclose(body.vertices - drift, x, atol=1e-4)
    assert np.abs(drift).max() < 3e-4
    force = np.zeros_like(x)
    force[:, 2] = -2e-4 * np.sin(angle[i])
    world.push(body, force, duration=0.2)
    world.run(0.2)
    assert np.abs(body.vertices - x).max() > 2e-3
    world.run(8.0)
    # drag has stopped it somewhere: compare the shape, the distances from end to end and from crown to ends
    end = body.vertices
    for p, q in ((0, n), (0, n // 2), (n // 2, n)):
        row = m // 2 * (n + 1)
        assert np.linalg.norm(end[row + p] - end[row + q]) == pytest.approx(
            np.linalg.norm(x[row + p] - x[row + q]), rel=0.01
        )  # bending alone brings it back, and drag slows the last per cent of it
