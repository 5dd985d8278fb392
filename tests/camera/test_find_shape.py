"""Finding a known shape among clutter of its own colour."""

from functools import cache

import cv2
import numpy as np
import pytest

import nuno

TABLE = nuno.Table(0.7, (0.4, 0.5), (0.0, 0.0))
CAMERA = nuno.Camera.look_at((-0.7, 0.1, 1.5), (0.0, 0.0, 0.7), 0.9)
TOWEL = np.array([[-0.2, -0.13], [0.2, -0.13], [0.2, 0.13], [-0.2, 0.13]])
CLOTH, WOOD = (70, 95, 150), (150, 115, 85)


def turned(outline, angle, place):
    """An outline turned and put somewhere."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return outline @ turn.T + place


def bent(outline, angle, place):
    """Each side's points moved inwards by up to 2 cm in the middle, then turned and put somewhere."""
    count = len(outline)
    sides = [
        outline[k] + (outline[(k + 1) % count] - outline[k]) * s
        for k in range(count)
        for s in np.linspace(0, 1, 9)[:-1]
    ]
    shares = np.tile(np.linspace(0, 1, 9)[:-1], count)
    inwards = 1.0 - 0.12 * (4 * shares * (1 - shares))[:, None] * (np.arange(len(sides)) // 8 % 2 == 0)[:, None]
    return turned(np.array(sides) * inwards, angle, place)


def drawn(*outlines, seed=0, clutter=True):
    """The table with outlines on it, and rags of the same colour beside and on their rims; noise of 3 levels."""
    rng = np.random.default_rng(seed)
    image = np.full((480, 640, 3), (165, 170, 175), np.uint8)

    def fill(points, colour):
        pixels = CAMERA.project(np.column_stack([points, np.full(len(points), TABLE.height)]))
        cv2.fillPoly(image, [np.round(pixels * 16).astype(np.int32)], colour, cv2.LINE_AA, 4)

    fill(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * TABLE.half_extents, WOOD)
    for outline in outlines:
        fill(outline, CLOTH)
        if clutter:
            for k in range(3):  # at its rim, of its colour
                size = rng.uniform((0.03, 0.03), (0.10, 0.05))
                rag = size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
                fill(turned(rag, rng.uniform(0, 3), outline[(k * len(outline)) // 3]), CLOTH)
    if clutter:
        for _ in range(8):
            rag = rng.uniform(0.03, 0.1, 2) * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
            fill(turned(rag, rng.uniform(0, 3), rng.uniform(-1, 1, 2) * (0.36, 0.46)), CLOTH)
    smooth = cv2.GaussianBlur(image, (0, 0), 0.7).astype(float)
    return np.clip(smooth + rng.normal(0, 3, smooth.shape), 0, 255).astype(np.uint8)


def mask_of(outline):
    """(h, w) bool, what an outline covers."""
    pixels = CAMERA.project(np.column_stack([outline, np.full(len(outline), TABLE.height)]))
    mask = np.zeros((480, 640), np.uint8)
    cv2.fillPoly(mask, [np.round(pixels * 16).astype(np.int32)], 1, shift=4)
    return mask.astype(bool)


def overlap(a, b):
    """Intersection over union."""
    return (a & b).sum() / (a | b).sum()


PLACE = bent(TOWEL, 0.6, (0.05, -0.1))


@cache
def cluttered():
    """A bent towel among rags."""
    return drawn(PLACE, seed=1)


def test_a_bent_towel_among_rags_of_its_colour():
    """It is found to an IoU of 0.9: a side of some 130 px told to 2 px has 0.94, and rags pull at it."""
    (found,) = nuno.find_shape(cluttered(), TOWEL, camera=CAMERA, table=TABLE)
    assert overlap(found.mask, mask_of(PLACE)) > 0.9
    assert found.score == pytest.approx(found.support - found.deformation, abs=1e-6)  # FORM is 1
    np.testing.assert_allclose(CAMERA.project(found.on_plane), found.polygon, atol=1e-6)
    np.testing.assert_allclose(found.on_plane[:, 2], TABLE.height)
    assert not found.mirrored and found.scale == 1.0 and len(found.outline) == len(found.polygon)


@pytest.mark.long
def test_rags_alone_are_no_towel():
    """On a table with the same rags but no towel nothing is found, and the likeliest place has a lower score."""
    empty = drawn(seed=1)
    assert nuno.find_shape(empty, TOWEL, camera=CAMERA, table=TABLE) == ()
    (likeliest,) = nuno.find_shape(empty, TOWEL, camera=CAMERA, table=TABLE, min_score=0.0)
    assert likeliest.score < nuno.camera.find_shape.FOUND


@pytest.mark.long
def test_two_instances_best_first():
    """Two towels are found apart, the better one first; a third there is not."""
    small = 0.55 * TOWEL
    places = [turned(small, 0.3, (-0.1, -0.22)), turned(small, 1.4, (0.1, 0.25))]
    found = nuno.find_shape(drawn(*places, seed=2, clutter=False), small, camera=CAMERA, table=TABLE, max_count=3)
    assert len(found) == 2
    assert found[0].score >= found[1].score
    for place in places:
        assert max(overlap(each.mask, mask_of(place)) for each in found) > 0.85


@pytest.mark.long
def test_the_other_side_up():
    """An L that lies with its other side up is found as such, where it is asked for."""
    ell = np.array([[0, 0], [0.3, 0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.24], [0, 0.24]]) - (0.12, 0.1)
    place = turned(ell * (-1.0, 1.0), 0.8, (0.0, 0.05))
    image = drawn(place, seed=3, clutter=False)
    best = nuno.find_shape(image, ell, camera=CAMERA, table=TABLE, mirrored=True, min_score=0.0)[0]
    assert best.mirrored
    assert overlap(best.mask, mask_of(place)) > 0.85


@pytest.mark.long
def test_in_pixels_at_an_unknown_scale():
    """Without a camera a shape is found at the right one of two scales; the same image gives the same bits."""
    image = np.full((240, 320), 90, np.uint8)
    box = cv2.boxPoints(((170.0, 120.0), (135.0, 90.0), 25.0))
    cv2.fillPoly(image, [np.round(box).astype(np.int32)], 130)
    image = np.clip(image + np.random.default_rng(0).normal(0, 3, image.shape), 0, 255).astype(np.uint8)
    outline = [[0, 0], [90, 0], [90, 60], [0, 60]]
    best, again = (nuno.find_shape(image, outline, scales=(1.0, 1.5))[0] for _ in range(2))
    assert best.scale == 1.5 and best.on_plane is None
    true = np.zeros(image.shape, np.uint8)
    cv2.fillPoly(true, [np.round(box).astype(np.int32)], 1)
    assert overlap(best.mask, true > 0) > 0.9
    np.testing.assert_array_equal(best.polygon, again.polygon)


@pytest.mark.long
def test_segmentation_by_template():
    """Where colours take the rags for the towel, the template finds it; where both agree, colours give the mask."""
    truth = mask_of(PLACE)
    with_template = nuno.segment_before(cluttered(), CAMERA, TABLE, template=TOWEL)
    assert overlap(with_template, truth) > 0.9
    clear = drawn(PLACE, seed=4, clutter=False)
    by_colour = nuno.segment_before(clear, CAMERA, TABLE)
    np.testing.assert_array_equal(nuno.segment_before(clear, CAMERA, TABLE, template=TOWEL), by_colour)
    with pytest.raises(nuno.ClothNotFoundError, match="nor is its outline found"):
        nuno.segment_before(drawn(seed=1, clutter=False), CAMERA, TABLE, template=TOWEL)


def test_a_small_thing_of_the_cloths_colour_that_touches_it_is_left_out():
    """A rag of 6 x 8 cm at the rim, less than the share by which colours and outline may differ: it is no cloth.

    3 % of the root of the area, by which a cloth may lie beside its outline, is 1 cm of the rag's 6.
    """
    rag = turned(np.array([[0.2, -0.04], [0.26, -0.04], [0.26, 0.04], [0.2, 0.04]]), 0.4, (0.02, -0.03))
    lies = turned(TOWEL, 0.4, (0.02, -0.03))
    found = nuno.segment_before(drawn(lies, rag, clutter=False), CAMERA, TABLE, template=TOWEL)
    truth, other = mask_of(lies), mask_of(rag) & ~mask_of(lies)
    assert overlap(mask_of(lies) | other, truth) > 0.85, "colours alone would count"
    assert (found & other).sum() < 0.3 * other.sum()
    assert overlap(found, truth) > 0.95


def test_bad_input():
    """What cannot be searched for is named before anything is searched."""
    image = np.zeros((480, 640, 3), np.uint8)
    seen = {"camera": CAMERA, "table": TABLE}
    for given, error, words in (
        ({"outline": TOWEL[[0, 2, 1, 3]], **seen}, nuno.InvalidInputError, "cross|area"),
        ({"outline": TOWEL, "camera": CAMERA}, nuno.InvalidInputError, "either table or plane_height"),
        ({"outline": TOWEL, "table": TABLE}, nuno.InvalidInputError, "needs the camera"),
        ({"outline": 0.01 * TOWEL, **seen}, nuno.InvalidInputError, "20 are needed"),
        ({"outline": 20 * TOWEL, **seen}, nuno.InvalidInputError, "more than the part"),
        ({"outline": TOWEL}, nuno.InvalidInputError, "below the 20 px"),
        ({"outline": 100 * TOWEL, "scales": ()}, nuno.InvalidInputError, "scales"),
        ({"outline": 100 * TOWEL, "scales": (0.0,)}, nuno.InvalidInputError, "positive"),
        ({"outline": 100 * TOWEL, "scales": (0.01,)}, nuno.InvalidInputError, "at the scale 0.01"),
        ({"outline": TOWEL, "stretch": (1.1, 0.9), **seen}, nuno.InvalidInputError, "stretch"),
        ({"outline": TOWEL, "max_count": 0, **seen}, nuno.InvalidInputError, "max_count"),
    ):
        with pytest.raises(error, match=words):
            nuno.find_shape(image, **given)
    with pytest.raises(nuno.ImageError):
        nuno.find_shape(image[:10], TOWEL, **seen)
    away = nuno.Camera.look_at((0, 0, 1.5), (0, 1, 3), 0.5)
    with pytest.raises(nuno.InvalidInputError, match="does not see the plane"):
        nuno.find_shape(image, TOWEL, camera=away, table=TABLE)
