"""Camera and table height that are told wrongly are set right by the table's border before anything is measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_pick_settings import settings

from drawn_tables import TABLE, TRUE, drawn, told
from nuno.camera.camera_of_table import BORDER
from nuno.estimate.pick_images import PickImages
from nuno.estimate.table_doubt import with_view_of_table

HAND = (0.1, 0.0, 1.1)


def given(camera, table, hand=HAND):
    """Settings with a camera and a table."""
    return replace(settings(camera=camera, hand=hand), table=table)


def test_a_turned_camera_is_replaced():
    """By one within 0.15 degrees of the true one, with a warning; poses are across the view of that one."""
    camera, table = told(turn=(2.0, 0.0, 0.0))
    doubt = with_view_of_table(given(camera, table), PickImages(drawn(), None, None, None, None))
    assert doubt.is_seen and doubt.warnings[0].startswith(BORDER)
    right = doubt.settings.camera.camera_to_world
    assert np.abs(right[:3, :3] - TRUE.camera_to_world[:3, :3]).max() < np.deg2rad(0.15)
    across = doubt.settings.poses.shifts[np.abs(doubt.settings.poses.shifts).sum(axis=1) > 0.0][0]
    assert np.cross(across, right[:3, 0]) == pytest.approx(0.0, abs=1e-12)


def test_what_is_right_stays_as_it_is():
    """The very settings, where the border is where it should be, and where there is no image."""
    right = given(TRUE, TABLE)
    seen = with_view_of_table(right, PickImages(drawn(), None, None, None, None))
    assert seen.settings is right and seen.is_seen and seen.warnings == ()
    unseen = with_view_of_table(right, PickImages(None, None, None, None, None))
    assert unseen.settings is right and not unseen.is_seen


def test_wrong_extents_are_told_and_change_nothing():
    """Half extents 3 and 4 cm too large: the very settings, a warning, and the cloth's outline is asked as ever."""
    wrong = given(TRUE, replace(TABLE, half_extents=(0.45, 0.64)))
    doubt = with_view_of_table(wrong, PickImages(drawn(), None, None, None, None))
    assert doubt.settings is wrong and not doubt.is_seen and "extents" in doubt.warnings[0]


def test_a_hand_stays_above_the_table():
    """A table that would rise above the hand is left where it is told."""
    camera, table = told(height=-0.03)
    low = given(camera, table, (0.1, 0.0, table.height + 0.01))
    assert with_view_of_table(low, PickImages(drawn(), None, None, None, None)).settings is low
