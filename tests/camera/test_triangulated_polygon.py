"""Polygons as triangles: constrained Delaunay, and the order in which vertices go."""

import numpy as np
import pytest

import nuno
from nuno.camera.triangulated_polygon import check_outline, signed_area, triangulate_polygon, with_vertices

SHIRT = np.array(
    [[0.12, 0], [0.36, 0], [0.36, 0.26], [0.48, 0.26], [0.48, 0.40], [0, 0.40], [0, 0.26], [0.12, 0.26]]
)  # fmt: skip
STAR = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 14, endpoint=False)])
STAR[1::2] *= 0.4


@pytest.mark.parametrize("outline", [SHIRT, STAR, with_vertices(SHIRT, 20), with_vertices(STAR, 30)])
def test_triangles_fill_the_polygon(outline):
    """There are n - 2 triangles, anticlockwise, whose areas add up to the polygon's."""
    polygon = triangulate_polygon(outline)
    areas = [signed_area(outline[triangle]) for triangle in polygon.triangles]
    assert len(areas) == len(outline) - 2
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(signed_area(outline), rel=1e-9)


@pytest.mark.parametrize("outline", [SHIRT, STAR])
def test_it_is_delaunay(outline):
    """Opposite a diagonal the two angles add up to at most pi."""
    polygon = triangulate_polygon(outline)

    def angle(i, apex, j):
        a, b = outline[i] - outline[apex], outline[j] - outline[apex]
        return np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))

    shared = {}
    for triangle in polygon.triangles:
        for k in range(3):
            i, j, apex = np.roll(triangle, k)
            shared.setdefault(frozenset((int(i), int(j))), []).append(angle(i, apex, j))
    assert max(sum(angles) for angles in shared.values() if len(angles) == 2) <= np.pi + 1e-6


@pytest.mark.parametrize("outline", [SHIRT, STAR])
def test_each_vertex_goes_with_its_last_triangle(outline):
    """In the order each vertex is in one triangle alone when it goes, and of the rest j goes before i."""
    polygon = triangulate_polygon(outline)
    left = [frozenset(map(int, triangle)) for triangle in polygon.triangles]
    gone = {k: number for number, (k, _, _) in enumerate(polygon.order)}
    for k, i, j in polygon.order:
        own = [triangle for triangle in left if k in triangle]
        assert own == [frozenset((k, i, j))]
        assert gone.get(j, len(gone)) <= gone.get(i, len(gone))
        left.remove(own[0])
    assert not left


def test_vertices_are_evened_out():
    """A side divided keeps the outline; a circle of 200 points becomes a polygon of 12 with 95 % of its area.

    A regular polygon of 12 in a circle has 12 / (2 pi) sin(2 pi / 12) = 95.5 % of its area.
    """
    assert signed_area(with_vertices(SHIRT, 20)) == pytest.approx(signed_area(SHIRT), rel=1e-6)
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    few = with_vertices(np.stack([np.cos(angles), np.sin(angles)], axis=1), 12)
    assert 8 <= len(few) <= 12
    assert signed_area(few) > 0.88 * np.pi  # an octagon has 90 %


def test_outlines_that_are_none():
    """Crossing or touching sides, no area, two points, and numbers that are none."""
    for outline, words in (
        ([[0, 0], [1, 1], [1, 0], [0, 1]], "hardly any area|cross"),
        ([[0, 0], [2, 0], [2, 2], [1, 0], [0, 2]], "cross or touch"),
        ([[0, 0], [4, 0], [4, 3], [1, -1], [0, 3]], "cross"),
        ([[0, 0], [1, 0], [2, 0]], "hardly any area"),
        ([[0, 0], [1, 0]], "n >= 3"),
        ([[0, 0], [1, np.nan], [1, 1]], "finite"),
    ):
        with pytest.raises(nuno.InvalidInputError, match=words):
            check_outline(outline)


def test_either_way_round():
    """A clockwise outline comes back anticlockwise, and repeated points go."""
    given = np.concatenate([SHIRT[:1], SHIRT])[::-1]
    np.testing.assert_array_equal(np.sort(check_outline(given), axis=0), np.sort(SHIRT, axis=0))
    assert signed_area(check_outline(given)) > 0
