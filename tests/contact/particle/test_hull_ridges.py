"""Where an edge is nearest to a convex hull, beside formulas of two lines and beside trying all of its points."""

import numpy as np
import pytest
import trimesh
import warp as wp

from nuno.contact.particle.feature_pose import FeatureFloat
from nuno.contact.particle.hull_ridges import FLAT, hull_edge_point
from nuno.numbers.vec3 import vec3
from nuno.shapes.shape import Box, Hull
from nuno.state.cloth_state import Shapes
from nuno.tables.hull_tables import corner_scales, hull_table, put_hulls

CELL, REACH = 0.04, 0.005
ROUNDING = 2e-7  # [m] of floats of 0.2 m, a few of them added


@wp.kernel(enable_backward=False, module="test_hull_ridges")
def touch_edges(
    shapes: Shapes,
    start: wp.array(dtype=wp.vec3),
    way: wp.array(dtype=wp.vec3),
    half: wp.vec3,
    which: int,
    numbers: wp.array(dtype=wp.vec4),
    normals: wp.array(dtype=wp.vec3),
):
    """Of each edge: on, part, gap and near; the normal."""
    k = wp.tid()
    h = FeatureFloat()
    h.size = vec3(half[0], half[1], half[2])
    h.radius = 0.0
    h.reach = float(REACH)
    a = start[k]
    w = way[k]
    touch = hull_edge_point(
        h, shapes, 0, vec3(a[0], a[1], a[2]), vec3(w[0], w[1], w[2]), which, float(CELL)
    )  # fmt: skip
    numbers[k] = wp.vec4(touch.on, touch.at, touch.gap, touch.near)
    normals[k] = wp.vec3(touch.normal.x, touch.normal.y, touch.normal.z)


def touched(hull, start, way, which=0):
    """Return what is found of edges (n, 3): (n, 4) and (n, 3), in the frame of the hull's table."""
    table, shapes = hull_table(hull), Shapes()
    put_hulls(shapes, {0: table}, 1, "cpu")
    count = len(start)
    numbers, normals = (wp.zeros(count, dtype=kind, device="cpu") for kind in (wp.vec4, wp.vec3))
    edges = [wp.array(each.astype(np.float32), dtype=wp.vec3, device="cpu") for each in (start, way)]
    wp.launch(
        touch_edges, dim=count, inputs=[shapes, *edges, wp.vec3(*table.half), which, numbers, normals], device="cpu"
    )  # fmt: skip
    return numbers.numpy(), normals.numpy()


def random_edges(rng, hull, count=400):
    """Return edges that pass by a hull's corners and faces, a little outside or inside."""
    middle = hull_table(hull).middle
    corners = hull.mesh()[0] - middle
    pick = corners[rng.integers(len(corners), size=(count, 3))]
    weights = rng.dirichlet(np.ones(3), count)
    through = np.einsum("nk,nkx->nx", weights, pick) * rng.uniform(0.98, 1.1, (count, 1))
    way = rng.normal(size=(count, 3))
    way *= CELL / np.linalg.norm(way, axis=1)[:, None]
    return through - rng.uniform(0.2, 0.8, (count, 1)) * way, way


@pytest.mark.long
def test_an_edge_meets_a_ridge_at_the_distance_of_two_lines():
    """Formula: at an edge's lowest point two planes meet in a line; the gap is its distance from the edge's line."""
    rng = np.random.default_rng(5)
    tried = 0
    for corners in 10 * (8, 30):
        hull = Hull.of(rng.normal(scale=0.04, size=(corners, 3)))
        assert (hull_table(hull).cells.sum() > 0) == (corners == 30)
        planes = hull_table(hull).planes.astype(float)
        start, way = random_edges(rng, hull)
        numbers, normals = touched(hull, start, way)
        parts = np.linspace(0.0, 1.0, 801)
        heights = (start @ planes[:, :3].T - planes[:, 3])[:, :, None] + (way @ planes[:, :3].T)[:, :, None] * parts
        tops = heights.max(axis=1)
        turns = np.take_along_axis(way @ planes[:, :3].T, heights[:, :, [0, -1]].argmax(axis=1), axis=1)
        for k in np.flatnonzero((numbers[:, 0] > 0.0) & (numbers[:, 2] > 0.0)):
            # nowhere is it nearer than there
            at = numbers[k, 1]
            there = start[k] + at * way[k]
            over = planes[:, :3] @ there - planes[:, 3]
            assert over.max() <= tops[k].min() + ROUNDING
            assert turns[k, 1] - turns[k, 0] > (FLAT - 1e-5) * CELL
            left, right = planes[np.argsort(-over)[:2]]
            slopes = np.array([left[:3] @ way[k], right[:3] @ way[k]])
            third = np.sort(over)[-3]
            if slopes.prod() > 0.0 or over.max() - third < 1e-5:
                continue
            # the line of both planes, through the point of least norm; its distance from the edge
            ridge = np.cross(left[:3], right[:3])
            on_it = np.linalg.lstsq(np.stack([left[:3], right[:3]]), np.array([left[3], right[3]]), rcond=None)[0]
            across = np.cross(way[k], ridge)
            if np.linalg.norm(across) < 0.05 * CELL * np.linalg.norm(ridge):
                continue
            across /= np.linalg.norm(across)
            across *= np.sign(across @ (left[:3] + right[:3]))
            assert numbers[k, 2] == np.float32(numbers[k, 2])
            np.testing.assert_allclose((start[k] - on_it) @ across, numbers[k, 2], atol=2e-6)
            np.testing.assert_allclose(normals[k], across, atol=2e-3)
            tried += 1
    assert tried > 300


def test_a_sleeping_edge_is_as_far_away_as_it_says():
    """Definition: moved by less than what it sleeps for, in any direction, an edge touches nothing."""
    rng = np.random.default_rng(6)
    hull = Hull.of(rng.normal(scale=0.04, size=(30, 3)))
    start, way = random_edges(rng, hull, 2000)
    start *= rng.uniform(1.0, 1.6, (len(start), 1))
    near = touched(hull, start, way)[0][:, 3]
    asleep = near < -1e-4
    assert 200 < asleep.sum() < 1900
    for _ in range(20):
        a, b = (rng.normal(size=(asleep.sum(), 3)) for _ in range(2))
        far = -0.999 * near[asleep, None]
        a, b = (far * each / np.linalg.norm(each, axis=1)[:, None] for each in (a, b))
        numbers, _ = touched(hull, start[asleep] + a, way[asleep] + b - a)
        assert not ((numbers[:, 0] > ROUNDING) & (numbers[:, 2] < REACH - ROUNDING)).any()


def test_an_edge_over_a_bar_lies_on_both_of_its_edges():
    """Geometry: a level edge over a bar of half its length meets it at a quarter and three quarters, upright."""
    corners = Box((0.2, 0.5 * CELL, 0.02)).mesh()[0]
    start, way = np.array([[0.01, -0.5 * CELL, 0.011]]), np.array([[0.0, CELL, 0.0]])
    found = []
    for which in range(2):
        numbers, normals = touched(Hull.of(corners), start, way, which)
        assert numbers[0, 0] > 0.0
        np.testing.assert_allclose(normals[0], [0.0, 0.0, 1.0], atol=1e-6)
        np.testing.assert_allclose(numbers[0, 2], 0.001, atol=ROUNDING)
        found.append(numbers[0, 1])
    # the planes of face and side are equally near 1 mm outside of the side
    np.testing.assert_allclose(np.sort(found), [0.25 - 0.001 / CELL, 0.75 + 0.001 / CELL], atol=1e-5)


def test_corners_are_sharp_to_cells_that_are_not_small_beside_their_curvature():
    """Rule: those of a box to all cells, of a ball with many faces from a third of its radius on, flat ones never."""
    box = hull_table(Hull.of(Box((0.3, 0.1, 0.1)).mesh()[0])).corners
    assert (box[:, 3] < 0.0011).all()
    ball = Hull.of(trimesh.creation.icosphere(subdivisions=4, radius=0.12).vertices)
    # its faces meet at 4 degrees; the sides of cells that are looked at are half as long again each time
    far = corner_scales(ball.mesh()[0][:100], ball.planes)
    assert 0.04 / 1.5 < far.min() <= far.max() < 0.04 * 1.5
    planes = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.1]])
    # beside the corner in the middle of a face nothing falls before the box does
    assert corner_scales(np.zeros((1, 3)), planes)[0] >= 0.19
