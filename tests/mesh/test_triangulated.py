"""Triangles inside polygons: they fill them, hold their sides, and are of good shape."""

import numpy as np
import pytest
import trimesh

from nuno import MeshError
from nuno.mesh.polygon import along_outline, contains, corners_of, crosses_itself, perimeter, signed_area
from nuno.mesh.triangulated import quality, triangulate

L = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.2), (0.2, 0.2), (0.2, 0.5), (0.0, 0.5)])  # 0.16 m2, 2 m around
ANGLES = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
DISC = 0.2 * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
STAR = np.stack([np.cos(ANGLES[::9]), np.sin(ANGLES[::9])], axis=1) * np.tile([0.25, 0.1], 5)[:, None]
NEEDLE = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.005), (0.0, 0.005)])  # thinner than an edge
BOW = np.array([(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 2.0)])


def area_of(points, faces):
    """Sum of the triangles' signed areas [m2]."""
    return sum(signed_area(points[face]) for face in faces)


@pytest.mark.parametrize("polygon", [L, L[::-1], DISC, STAR, NEEDLE], ids=["L", "clockwise", "disc", "star", "needle"])
@pytest.mark.parametrize("edge", [0.02, 0.035])
def test_triangles_fill_the_polygon(polygon, edge):
    """Their areas add up to that of the outline they have, to rounding; all look up; they are one disc (Euler: 1)."""
    points, faces, rim = triangulate(polygon, edge)
    assert area_of(points, faces) == pytest.approx(signed_area(points[:rim]), rel=1e-12)
    assert min(signed_area(points[face]) for face in faces) > 0.0
    assert trimesh.Trimesh(np.c_[points, np.zeros(len(points))], faces, process=False).euler_number == 1
    assert len(np.unique(faces)) == len(points)


def test_straight_outlines_are_kept():
    """An L's area and length are its own, to rounding: points of its outline lie on its sides."""
    points, faces, rim = triangulate(L, 0.02)
    assert area_of(points, faces) == pytest.approx(0.16, rel=1e-12)
    assert perimeter(points[:rim]) == pytest.approx(2.0, rel=1e-12)


def test_sides_of_the_outline_are_sides_of_triangles():
    """Each side is in one triangle, each inner edge in two, also in a star's sharp tips."""
    _, faces, rim = triangulate(STAR, 0.02)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    pairs, count = np.unique(edges, axis=0, return_counts=True)
    outer = {tuple(pair) for pair in pairs[count == 1].tolist()}
    assert outer == {(k, k + 1) for k in range(rim - 1)} | {(0, rim - 1)} and count.max() == 2


@pytest.mark.parametrize("polygon", [L, DISC], ids=["L", "disc"])
def test_cells_are_even(polygon):
    """No triangle is flat, most are nearly equilateral, and edges are about as long as asked for.

    0.5 is the mean ratio of a triangle with angles of 30, 30 and 120 degrees; 1 that of an equilateral one.
    """
    points, faces, _ = triangulate(polygon, 0.02)
    shape = quality(points, faces)
    assert shape.min() > 0.6 and np.median(shape) > 0.93
    lengths = np.linalg.norm(points[faces] - points[np.roll(faces, -1, axis=1)], axis=2)
    assert 0.016 < np.median(lengths) < 0.024  # a fifth either way: rims divide by whole numbers


def test_quality_has_the_textbook_values():
    """The mean ratio (Liu and Joe 1994): equilateral 1, half a square sqrt(3) / 2, a flat one 0."""
    points = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, np.sqrt(0.75)), (0.0, 1.0), (2.0, 0.0)])
    faces = np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    np.testing.assert_allclose(quality(points, faces), (1.0, np.sqrt(0.75), 0.0), atol=1e-12)


def test_what_has_no_inside_is_refused():
    """A bow crosses itself, a line has no area."""
    assert crosses_itself(BOW) and not crosses_itself(L)
    with pytest.raises(MeshError, match="crosses itself"):
        triangulate(BOW, 0.1)
    with pytest.raises(MeshError, match="no inside"):
        triangulate(np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]), 0.1)


def test_points_inside_and_along():
    """By counting: of the L's unit squares of 0.1 m, 16 middles are inside; its six corners are sharp."""
    x, y = np.meshgrid(np.arange(0.05, 0.5, 0.1), np.arange(0.05, 0.5, 0.1))
    assert contains(L, np.stack([x.ravel(), y.ravel()], axis=1)).sum() == 16
    assert corners_of(L).tolist() == list(range(6))
    along = along_outline(L, 0.1)
    assert len(along) == 20 and {tuple(p) for p in L} <= {tuple(p) for p in along}  # 2 m of outline
