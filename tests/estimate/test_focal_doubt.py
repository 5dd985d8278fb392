"""A focal length that is told wrongly is found by the cloth's outline, and taken."""

from dataclasses import replace

import numpy as np
import pytest
from test_pick_settings import LOOKING_DOWN, settings

import nuno
from nuno.camera.rectangle import fit_rectangle
from nuno.camera.table import plane_coordinates
from nuno.estimate.focal_doubt import with_focal_of_rectangle
from nuno.estimate.pick_images import PickImages

TILT = np.radians(35.0)
POSE = LOOKING_DOWN.copy()
POSE[:3, :3] = LOOKING_DOWN[:3, :3] @ np.array(
    [[1, 0, 0], [0, np.cos(TILT), -np.sin(TILT)], [0, np.sin(TILT), np.cos(TILT)]]
)
CAMERA = nuno.Camera(640, 480, 600.0, 600.0, 319.5, 239.5, camera_to_world=POSE)
HEIGHT = 0.0025


def before(told: float):
    """Settings with a focal length that is ``told`` times the true one, the mask of a cloth, and its rectangle."""
    middle = CAMERA.back_project(np.array([[319.5, 239.5]]), HEIGHT)[0, :2]
    away = np.abs(np.nan_to_num(plane_coordinates(CAMERA, HEIGHT), nan=1e6) - middle)
    mask = (away <= (0.24, 0.16)).all(axis=-1)
    wrong = replace(CAMERA, fx=told * CAMERA.fx, fy=told * CAMERA.fy)
    given = settings(camera=wrong, hand=(*middle, 0.2))
    return given, PickImages(None, None, mask, mask, None), fit_rectangle(mask, None, wrong, HEIGHT)


@pytest.mark.parametrize("told", [0.9, 1.1])
def test_the_focal_length_of_the_outline_is_taken(told):
    """To 1 %, with a warning by name; then the sides are the true ones to 1 %, which are 10 % off before."""
    given, images, rectangle = before(told)
    assert rectangle.long_m != pytest.approx(0.48, rel=0.05)
    found, better = with_focal_of_rectangle(given, images, rectangle)
    assert found.camera.fx == pytest.approx(CAMERA.fx, rel=0.01)
    assert (better.long_m, better.short_m) == pytest.approx((0.48, 0.32), rel=0.01)
    assert "focal length" in better.warnings[0] and not rectangle.warnings


def test_a_right_focal_length_stays():
    """To the bit, as does what the outline cannot tell: without a mask, on the table's border."""
    given, images, rectangle = before(1.0)
    assert with_focal_of_rectangle(given, images, rectangle) == (given, rectangle)
    given, images, rectangle = before(1.1)
    without = replace(images, mask_before=None)
    assert with_focal_of_rectangle(given, without, rectangle) == (given, rectangle)
    # the table ends where the cloth's near side lies as the camera is told to be
    half = np.abs(rectangle.corners[:, :2] - rectangle.centre[:2]).max(axis=0)
    table = replace(given.table, half_extents=tuple(half), centre=tuple(rectangle.centre[:2]))
    on_border = replace(given, table=table)
    assert with_focal_of_rectangle(on_border, images, rectangle) == (on_border, rectangle)
