"""Candidates on an outline, and which cloths are taken as rectangles."""

from dataclasses import replace

import numpy as np
import pytest

import nuno
from nuno import EstimationError, InvalidInputError
from nuno.camera.cloth_outline import ClothOutline, fit_outline
from nuno.camera.rectangle import fit_rectangle
from nuno.estimate.outline_body import EDGE, edge_of, grips_on, outline_body
from nuno.estimate.outline_candidates import (
    USUAL,
    nearest_on_outline,
    outline_points,
    usual_spacing,
    with_outline_candidates,
)
from nuno.estimate.outline_or_rectangle import fit_cloth
from nuno.estimate.pick_settings import check_settings, check_table
from nuno.mesh.polygon import contains, distance_to_outline
from outline_masks import BOX, HEIGHT, L, mask_of


@pytest.fixture(scope="module")
def camera():
    """Looking down at 45 degrees."""
    return nuno.Camera.look_at((-0.9, 0.1, HEIGHT + 0.9), (0.05, 0.0, HEIGHT), fov=0.9)


@pytest.fixture(scope="module")
def cloth(camera):
    """An L."""
    return fit_outline(mask_of(L, camera), camera, HEIGHT)


def settings(camera, candidates=(6, 6)):
    """Those of an estimate."""
    table = check_table(HEIGHT, None, None, 0.04)
    return check_settings(
        table=table, camera=camera, hand=(0.0, 0.0, 1.1), candidates=candidates, rest_height=0.0025, hand_radius=0.014,
        lift_seconds=1.5, discretisations=nuno.estimate.hypotheses.DISCRETISATIONS, sure=0.98, turns=(0.0,),
        learned=True, sideways=0.5, score="evidence", device="cpu", progress=False,
    )  # fmt: skip


def test_candidates_are_on_the_outline_and_inside(cloth):
    """No two are nearer than half a spacing; the L's six corners, to 6 mm, are among them; the rest is inside.

    By area and length there are about 1.93 m / s + (0.16 m2 - ...) / (0.87 s2): the count asked for to a fifth.
    """
    spacing = usual_spacing(cloth)
    points = outline_points(cloth, spacing)
    assert abs(len(points) - USUAL) < 0.2 * USUAL
    apart = np.linalg.norm(points[:, None] - points, axis=2) + 10.0 * np.eye(len(points))
    assert apart.min() > 0.49 * spacing
    inner = distance_to_outline(cloth.polygon, points) > 1e-6
    assert contains(cloth.polygon, points[inner]).all() and 0 < inner.sum() < len(points)
    corners = cloth.fractions(np.column_stack([L, np.full(6, HEIGHT)])) * (cloth.long_m, cloth.short_m)
    assert np.linalg.norm(points[:, None] - corners, axis=2).min(axis=0).max() < 6e-3
    # no point of the cloth is farther than a spacing from a candidate
    grid = np.stack(np.meshgrid(*[np.linspace(0, s, 60) for s in (cloth.long_m, cloth.short_m)]), -1).reshape(-1, 2)
    grid = grid[contains(cloth.polygon, grid)]
    assert np.linalg.norm(grid[:, None] - points, axis=2).min(axis=1).max() < spacing


def test_settings_of_a_rectangle_stay_as_they_are(camera, cloth):
    """The very object; a spacing is refused, for it would do nothing."""
    given, box = settings(camera), fit_rectangle(mask_of(BOX, camera), None, camera, HEIGHT)
    assert with_outline_candidates(given, box, None) is given
    with pytest.raises(InvalidInputError, match="spacing is for outlines"):
        with_outline_candidates(given, box, 0.1)
    changed = with_outline_candidates(given, cloth, 0.06)
    assert changed.spacing == 0.06 and given.spacing is None
    assert not changed.learned and np.issubdtype(changed.labels.dtype, np.floating)
    np.testing.assert_allclose(changed.labels, changed.uv * (cloth.long_m, cloth.short_m))
    with pytest.raises(InvalidInputError, match="more than 1024"):
        with_outline_candidates(given, cloth, 0.004)


def test_given_points_go_to_the_nearest_one_on_the_cloth(camera, cloth):
    """One inside stays; one in the bay of the L, or in a corner of its rectangle, goes to the outline."""
    uv = np.array([(u, v) for u in (0.1, 0.5, 0.9) for v in (0.1, 0.5, 0.9)])
    changed = with_outline_candidates(settings(camera, uv), cloth, None)
    found = changed.labels
    assert changed.spacing is None  # one of them is the pick
    asked = uv * (cloth.long_m, cloth.short_m)
    inside = contains(cloth.polygon, asked)
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(found[inside], asked[inside])
    away = np.linalg.norm(found - asked, axis=1)[~inside]
    np.testing.assert_allclose(away, distance_to_outline(cloth.polygon, asked[~inside]), atol=1e-12)
    np.testing.assert_allclose(found[~inside], nearest_on_outline(cloth.polygon, asked[~inside]))


def test_what_is_a_rectangle_is_taken_as_one(camera):
    """By "auto" the L is taken by its outline with a warning, a rectangle as ever, bit for bit; "rectangle" refuses."""
    box, other = mask_of(BOX, camera), mask_of(L, camera)
    before, now = fit_rectangle(box, None, camera, HEIGHT), fit_cloth(box, None, camera, HEIGHT, "auto")
    assert not isinstance(now, ClothOutline) and np.array_equal(before.corners, now.corners)
    found = fit_cloth(other, None, camera, HEIGHT, "auto")
    assert isinstance(found, ClothOutline) and "no rectangle" in found.warnings[0]
    assert isinstance(fit_cloth(box, None, camera, HEIGHT, "outline"), ClothOutline)
    with pytest.raises(EstimationError, match="rectangle"):
        fit_cloth(other, None, camera, HEIGHT, "rectangle")


def test_the_body_is_the_cloth(camera, cloth):
    """Its area is the outline's where sides are straight, to 2 % where edges cut corners; candidates are on it."""
    body = outline_body(cloth, 20, "cloth")
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(cloth.area, rel=0.02)
    uv = outline_points(cloth, 0.08) / (cloth.long_m, cloth.short_m)
    points, places = grips_on(cloth, uv, body)
    assert len(points) == len(uv)
    assert np.linalg.norm(places - cloth.world_positions(uv), axis=1).max() < 4e-3  # what the outline's edges cut off
    assert edge_of(cloth, 20) == EDGE and edge_of(cloth, 25) == pytest.approx(0.8 * EDGE)
    large = replace(cloth, outline=2.0 * cloth.outline)
    assert edge_of(large, 20) > EDGE  # four times the area in not as many more vertices
