"""What a table's border in an image tells of the camera and of the table's height."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from drawn_tables import TABLE, TRUE, drawn, told
from nuno.camera.camera_of_table import BORDER, corrected, view_of_table


def test_what_is_right_is_left_alone():
    """Also where camera, height and extents are off by as little as they mostly are."""
    image = drawn()
    view = view_of_table(image, TRUE, TABLE)
    assert view is not None and view.mistakes == () and view.warning is None and not view.errors.any()
    camera, table = told(1.005, (0.15, -0.1, 0.15), 0.003)
    view = view_of_table(image, camera, replace(table, half_extents=(0.424, 0.597)))
    assert view is not None and view.mistakes == ()


@pytest.mark.parametrize("turn", [pytest.param((-3.0, 0.0, 0.0), marks=pytest.mark.long), (1.5, 0.0, -1.5)])
def test_a_turned_camera_is_set_right(turn):
    """To 0.15 degrees: the prior of a mistake draws by a hundredth, and the least error of an edge is 0.1 px."""
    camera, table = told(turn=turn)
    view = view_of_table(drawn(), camera, table)
    assert view is not None and view.mistakes == ("turn",) and view.is_clear
    right, same = corrected(camera, table, view.errors)
    off = cv2.Rodrigues(right.camera_to_world[:3, :3].T @ TRUE.camera_to_world[:3, :3])[0]
    assert np.rad2deg(np.linalg.norm(off)) < 0.15
    assert same == table
    degrees = np.linalg.norm(turn)
    assert view.warning is not None and view.warning.startswith(BORDER) and f"turned by {degrees:.1f}" in view.warning


def test_a_wrong_height_is_set_right():
    """To 3 mm: with ordinary errors of extents of 5 mm and 1 px of noise it is known no better."""
    camera, table = told(height=0.03)
    view = view_of_table(drawn(), camera, table)
    assert view is not None and view.mistakes == ("height",)
    assert corrected(camera, table, view.errors)[1].height == pytest.approx(TABLE.height, abs=0.003)
    assert view.warning is not None and "cm lower" in view.warning


def test_a_wrong_focal_length_is_set_right():
    """To 1 %, as the ordinary error of one is 0.8 %."""
    camera, table = told(0.9)
    view = view_of_table(drawn(), camera, table)
    assert view is not None and view.mistakes == ("focal",)
    assert corrected(camera, table, view.errors)[0].fx == pytest.approx(TRUE.fx, rel=0.01)


def test_an_edge_beside_the_border_is_not_taken_for_it():
    """Where the near edge of the top cannot be told from the face below it, the face's lower edge is seen alone."""
    view = view_of_table(drawn(face=(150, 120, 95)), TRUE, TABLE)
    assert view is not None and view.mistakes == ()


def test_other_extents_leave_the_camera_alone():
    """Half extents 3 and 4 cm too large are no mistake of the camera's; a warning names them."""
    view = view_of_table(drawn(), TRUE, replace(TABLE, half_extents=(0.45, 0.64)))
    assert view is not None and view.mistakes == ("extents",) and not view.errors.any()
    assert view.warning is not None and "extents" in view.warning


def test_a_table_that_is_not_seen_tells_nothing():
    """Without extents, in the floor's colour, or far beyond the image."""
    image = drawn()
    assert view_of_table(image, TRUE, replace(TABLE, half_extents=None)) is None
    assert view_of_table(np.full_like(image, 90), TRUE, TABLE) is None
    assert view_of_table(image, TRUE, replace(TABLE, half_extents=(30.0, 30.0))) is None


def test_what_no_mistake_explains_tells_nothing():
    """A camera that looks 12 degrees aside, a table of half the size: none of their lines is where it is looked for."""
    camera, table = told(turn=(0.0, 12.0, 0.0))
    for view in (
        view_of_table(drawn(), camera, table),
        view_of_table(drawn(), TRUE, replace(TABLE, half_extents=(0.21, 0.3))),
    ):
        assert view is None or not view.errors.any()


@pytest.mark.long
def test_large_and_distorted_images_tell_the_same():
    """Twice the pixels, and a lens with barrel distortion: the same turn, to 0.15 degrees as above."""
    camera, table = told(turn=(2.0, 0.0, 0.0))
    view = view_of_table(drawn(TRUE.scaled(2.0), finer=1), camera.scaled(2.0), table)
    assert view is not None and np.rad2deg(view.errors[1]) == pytest.approx(-2.0, abs=0.15)
    lens = np.array([-0.15, 0.02, 0.0, 0.0])
    bent = replace(TRUE, distortion=lens)
    u, v = np.meshgrid(np.arange(640.0), np.arange(480.0))
    at = TRUE.project(TRUE.camera_to_world[:3, 3] + bent.rays(np.stack([u, v], axis=-1))).astype(np.float32)
    image = cv2.remap(drawn(), at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    view = view_of_table(image, replace(camera, distortion=lens), table)
    assert view is not None and np.rad2deg(view.errors[1]) == pytest.approx(-2.0, abs=0.15)
