"""The outline of a flat cloth: its shape and place from a mask that a camera sees."""

import numpy as np
import pytest

import nuno
from nuno import ClothNotFoundError, EstimationError
from nuno.camera.cloth_outline import ClothOutline, cloth_colours, fit_outline
from nuno.camera.rectangle import fit_rectangle
from outline_masks import BOX, HEIGHT, L, mask_of


@pytest.fixture(scope="module")
def camera():
    """Looking down at 45 degrees."""
    return nuno.Camera.look_at((-0.9, 0.1, HEIGHT + 0.9), (0.05, 0.0, HEIGHT), fov=0.9)


def test_an_l_is_measured(camera):
    """Area within 2 % of 0.16 m2, every corner within 5 mm: a pixel is 3 mm here, and corners are rounded by one."""
    found = fit_outline(mask_of(L, camera), camera, HEIGHT)
    assert isinstance(found, ClothOutline)
    assert found.area == pytest.approx(0.16, rel=0.02)
    away = np.linalg.norm(found.outline[:, None, :2] - L, axis=2).min(axis=0)
    assert away.max() < 5e-3
    np.testing.assert_allclose(found.outline[:, 2], HEIGHT, atol=1e-12)
    # the smallest rectangle around an L with equal arms cuts its inner corner off or is a square around it
    assert found.area < found.long_m * found.short_m
    np.testing.assert_allclose(found.world_positions(found.fractions(found.outline)), found.outline, atol=1e-12)
    assert found.polygon.min() > -1e-6 and (found.polygon < (found.long_m + 1e-6, found.short_m + 1e-6)).all()


def test_a_rectangle_has_the_corners_of_a_rectangle(camera):
    """Taken by its outline, its smallest rectangle is what is fitted to it as one, within a pixel's 3 mm."""
    mask = mask_of(BOX, camera)
    as_outline, as_rectangle = fit_outline(mask, camera, HEIGHT), fit_rectangle(mask, None, camera, HEIGHT)
    np.testing.assert_allclose(as_outline.corners, as_rectangle.corners, atol=5e-3)


def test_what_has_no_outline_is_refused(camera):
    """Nothing, a speck, and a cloth that the image cuts off."""
    empty = np.zeros((camera.height, camera.width), bool)
    with pytest.raises(ClothNotFoundError):
        fit_outline(empty, camera, HEIGHT)
    speck = empty.copy()
    speck[200, 300] = True
    with pytest.raises(EstimationError):
        fit_outline(speck, camera, HEIGHT)
    cut = empty.copy()
    cut[100:, 200:300] = True
    with pytest.raises(EstimationError, match="border"):
        fit_outline(cut, camera, HEIGHT)


def test_colours_around_an_outline_are_the_cloths(camera):
    """Outside of the mask nothing of the table is left; inside, and of a rectangle, nothing changes."""
    mask = mask_of(L, camera)
    image = np.where(mask[..., None], np.uint8(200), np.uint8(30)).repeat(3, axis=2)
    filled = cloth_colours(image, mask, fit_outline(mask, camera, HEIGHT))
    assert (filled == 200).all()
    rectangle = fit_rectangle(mask_of(BOX, camera), None, camera, HEIGHT)
    assert cloth_colours(image, mask, rectangle) is image
