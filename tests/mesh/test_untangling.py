"""Meshes that pass through themselves are taken apart."""

import numpy as np
import pytest

from nuno.mesh.crossings import crossing_faces
from nuno.mesh.untangling import untangle

CELL = 0.02


def grid(cells):
    """Return the places (n, 2) [m] of a square grid's vertices, and its triangles."""
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (corner.ravel() for corner in (i[:-1, :-1], i[:-1, 1:], i[1:, :-1], i[1:, 1:]))
    places = np.stack(np.meshgrid(*2 * [np.arange(cells + 1)]), axis=-1).reshape(-1, 2) * CELL
    return places, np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])


def pressed_through(depth, wide):
    """Return a sheet folded to two layers 8 mm apart, of which the upper dips through the lower."""
    places, faces = grid(20)
    x = np.column_stack([places, np.zeros(len(places))])
    upper = x[:, 0] > 0.2
    x[upper, 0] = 0.4 - x[upper, 0]
    dip = depth * np.exp(-((x[:, :2] - (0.1, 0.2)) ** 2).sum(axis=1) / (2.0 * wide**2))
    x[upper, 2] = 0.008 - dip[upper]
    return x, faces


@pytest.mark.parametrize(("depth", "wide"), [(0.012, 0.02), (0.02, 0.03), (0.03, 0.03)])
def test_a_layer_that_was_pressed_through_another_is_drawn_back(depth, wide):
    """Exact: no face passes through another afterwards; nothing moves by more than the dip is deep."""
    x, faces = pressed_through(depth, wide)
    assert len(crossing_faces(x, faces)) > 0
    moved, left = untangle(x, faces, np.ones(len(x), dtype=bool), 0.1 * CELL)
    assert left == len(crossing_faces(moved, faces)) == 0
    assert np.linalg.norm(moved - x, axis=1).max() <= depth


def test_what_is_held_stays_and_the_rest_gives_way():
    """Promise: vertices that are not free stay where they are, to the bit."""
    x, faces = pressed_through(0.012, 0.02)
    free = ~((x[:, 2] != 0.0) & (x[:, 2] < 0.0))
    assert not free.all()
    moved, left = untangle(x, faces, free, 0.1 * CELL)
    assert left == 0
    np.testing.assert_array_equal(moved[~free], x[~free])


def test_what_does_not_cross_stays_where_it_is():
    """Promise: a mesh that does not pass through itself keeps every bit."""
    x, faces = pressed_through(0.0, 0.02)
    moved, left = untangle(x, faces, np.ones(len(x), dtype=bool), 0.1 * CELL)
    assert left == 0
    np.testing.assert_array_equal(moved, x)
