"""Futures that are reflected for other candidates: where these lie, which count, and that they are what is imagined."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate.futures import imagine_picks
from nuno.estimate.hypotheses import Discretisation, Hypothesis
from nuno.estimate.mirrored import WEIGHT, counterparts, mirrored, share_lying

GRID = np.stack(np.meshgrid(np.arange(6), np.arange(6), indexing="ij"), axis=-1).reshape(-1, 2) / 5.0
CORNERS = np.array([(-0.2, -0.1, 0.0), (0.2, -0.1, 0.0), (0.2, 0.1, 0.0), (-0.2, 0.1, 0.0)])
RECTANGLE = ClothRectangle(CORNERS, 0.4, 0.2, np.zeros(3), 0.0, 0.0)
TABLE = Table(-0.0025)
CORNER, OPPOSITE = 0, 35


def test_a_grid_is_an_image_of_itself_and_other_points_are_not():
    """(i, j) comes to (5 - i, j), (i, 5 - j), or both; a point at 0.3 along the side has none at 0.7."""
    i, j = np.divmod(np.arange(36), 6)
    np.testing.assert_array_equal(counterparts(GRID, (True, False)), 6 * (5 - i) + j)
    np.testing.assert_array_equal(counterparts(GRID, (False, True)), 6 * i + 5 - j)
    np.testing.assert_array_equal(counterparts(GRID, (True, True)), 35 - np.arange(36))
    np.testing.assert_array_equal(counterparts(np.array([(0.3, 0.5), (0.5, 0.0)]), (True, False)), [-1, 1])


def test_what_lies_is_near_the_table_and_above_it():
    """Of four points one is high and one beside the table; an endless one has no side."""
    points = np.array([(0.0, 0.0, 0.71), (0.1, 0.0, 0.7), (0.0, 0.0, 0.9), (2.0, 0.0, 0.5)])
    assert share_lying(points, Table(0.7, (0.5, 0.5))) == 0.5
    assert share_lying(points, Table(0.7)) == 0.75


def futures_at(points: np.ndarray) -> Any:
    """Futures (guesses, candidates, n, 3) that are not of a world."""
    guesses, count = points.shape[:2]
    flat = points.reshape(guesses * count, -1, 3).astype(np.float32)
    return SimpleNamespace(
        discretisation=SimpleNamespace(hypotheses=[Hypothesis(1e-4)] * guesses), candidates=count,
        positions=wp.array(flat, dtype=wp.vec3, device="cpu"), finite=np.ones((guesses, count), dtype=bool),
        world=None, body=None, origin=None,
    )  # fmt: skip


def test_a_reflection_is_about_the_hand_and_counts_where_the_cloth_hangs_free():
    """x, y or both change their sign about the hand (0.3, 0.1); the second guess lies on the table, and counts not."""
    hand = np.array([0.3, 0.1, 0.5])
    points = np.array([[[(0.31, 0.12, 0.4)] * 2], [[(0.31, 0.12, 0.0)] * 2]])
    found = mirrored(futures_at(points), np.array([CORNER]), GRID, RECTANGLE, TABLE, hand, 0.01)
    assert found is not None
    np.testing.assert_array_equal(found.chosen, [30, 5, OPPOSITE])
    np.testing.assert_array_equal(found.kinds, [0, 1, 2])
    np.testing.assert_array_equal(found.weights, [[WEIGHT] * 3, [0.0] * 3])
    free = found.positions.numpy().reshape(2, 3, 2, 3)[0, :, 0]
    np.testing.assert_allclose(free, [(0.29, 0.12, 0.4), (0.31, 0.08, 0.4), (0.29, 0.08, 0.4)], atol=1e-6)  # float32
    assert mirrored(futures_at(points[1:]), np.array([CORNER]), GRID, RECTANGLE, TABLE, hand, 0.01) is None


def test_candidates_that_were_imagined_themselves_need_no_reflection():
    """All four corners are images of each other, so nothing is left."""
    corners = np.array([0, 5, 30, 35])
    points = np.full((1, 4, 2, 3), 0.4)
    assert mirrored(futures_at(points), corners, GRID, RECTANGLE, TABLE, np.array([0.3, 0.1, 0.5]), 0.0) is None


def test_above_the_middle_half_a_turn_is_what_is_imagined_of_the_opposite_point():
    """A hand that ends above the cloth's centre: the cloth's mesh, too, is the same after half a turn.

    What is left is the order in which constraints are solved: under a tenth of a cell of 4 cm at any vertex of a stiff
    cloth, which hangs free.
    """
    hand = np.array([0.0, 0.0, 0.5])
    mesh = Discretisation(10, 10, (Hypothesis(2e-3),))
    given: Any = dict(table=TABLE, hand=hand, rest_height=0.0025, device="cpu")
    of = np.array([CORNER, CORNER + 5])
    imagined = imagine_picks(RECTANGLE, GRID[of], (6, 6), mesh, **given)
    there = imagine_picks(RECTANGLE, GRID[35 - of], (6, 6), mesh, **given).positions.numpy()
    found = mirrored(imagined, of, GRID, RECTANGLE, TABLE, hand, 0.01)
    assert found is not None
    half_turned = found.positions.numpy()[found.kinds == 2]
    np.testing.assert_array_equal(found.chosen[found.kinds == 2], 35 - of)
    apart = np.linalg.norm(half_turned[:, ::-1] - there, axis=-1)  # half a turn reverses the vertices
    assert apart.max() < 0.004
