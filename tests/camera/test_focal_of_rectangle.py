"""The focal length with which a cloth's outline is a rectangle."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from synthetic import look_at

from nuno.camera.focal_of_rectangle import FocalRatio, camera_with, focal_of_rectangle
from nuno.camera.rectangle import fit_rectangle
from nuno.camera.table import plane_coordinates

HEIGHT = 0.7025
TRUE = look_at(np.array([-0.85, 0.05, 1.3]), np.array([0.1, 0.0, 0.8]), 500.0)


def drawn(size, yaw, skew=0.0) -> np.ndarray:
    """(480, 640) bool, pixels whose centres the true camera sees on a cloth, which is sheared by an angle [rad]."""
    xy = np.nan_to_num(plane_coordinates(TRUE, HEIGHT), nan=1e6) - (0.05, 0.01)
    c, s = np.cos(yaw), np.sin(yaw)
    local = np.stack([xy @ (c, s), xy @ (-s, c)], axis=-1)
    local[..., 0] -= np.tan(skew) * local[..., 1]
    return (np.abs(local) <= 0.5 * np.array(size)).all(axis=-1)


def found(mask: np.ndarray, told: float) -> FocalRatio:
    """What is found where a focal length is told that is ``told`` times the true one."""
    camera = camera_with(TRUE, np.log(told))
    ratio = focal_of_rectangle(fit_rectangle(mask, None, camera, HEIGHT), mask, camera, HEIGHT)
    assert ratio is not None
    return ratio


@pytest.mark.parametrize("told", [0.9, 0.97, 1.0, 1.1])
@pytest.mark.parametrize("yaw", [0.2, 1.9])
def test_a_wrong_focal_length_is_measured(told, yaw):
    """To 1 %: edges of masks that are drawn by pixel centres are right to about 0.1 px, which is 0.3 % here."""
    ratio = found(drawn((0.55, 0.4), yaw), told)
    assert ratio.log == pytest.approx(-np.log(told), abs=0.01)
    assert ratio.std < 0.01


def test_a_wrong_focal_length_is_told_by_name():
    """A tenth is, in its direction; what is right, or wrong by 2 %, is not."""
    mask = drawn((0.55, 0.4), 0.2)
    assert "11 % longer" in found(mask, 0.9).warning and "9 % shorter" in found(mask, 1.1).warning
    assert found(mask, 1.0).warning is None and found(mask, 1.02).warning is None
    assert FocalRatio(0.08, 0.03).warning is None


def test_a_noisy_outline_tells_less():
    """An edge displaced by smooth noise of 2 px: the deviation says so, and the truth is within four of them."""
    mask = drawn((0.55, 0.4), 0.2)
    noise = cv2.GaussianBlur(np.random.default_rng(3).standard_normal(mask.shape), (0, 0), 4.0)
    inside, outside = (cv2.distanceTransform(m.astype(np.uint8), cv2.DIST_L2, 5) for m in (mask, ~mask))
    ratio = found(inside - outside + noise * (2.0 / noise.std()) > 0, 1.0)
    assert ratio.std > 0.015
    assert abs(ratio.log) < 4.0 * ratio.std


def test_a_table_of_another_height_leaves_a_rectangle():
    """Rays from one point cut parallel planes in figures of one shape."""
    mask = drawn((0.55, 0.4), 0.2)
    ratio = focal_of_rectangle(fit_rectangle(mask, None, TRUE, HEIGHT - 0.04), mask, TRUE, HEIGHT - 0.04)
    assert ratio is not None and abs(ratio.log) < 0.01


def test_a_sheared_cloth_is_no_proof():
    """It looks like a wrong focal length, somewhat: so what is said of one names the cloth, too."""
    assert abs(found(drawn((0.55, 0.4), 0.7, np.radians(3.0)), 1.0).log) > 0.02


def test_no_edge_tells_nothing():
    """Of a mask that is elsewhere than the rectangle."""
    mask = drawn((0.55, 0.4), 0.2)
    rectangle = fit_rectangle(mask, None, TRUE, HEIGHT)
    assert focal_of_rectangle(rectangle, np.roll(mask, 200, axis=1), TRUE, HEIGHT) is None


def test_a_camera_straight_above_tells_nothing_false():
    """Whatever its focal length, a rectangle stays one: no ratio, or one that is not clearly another."""
    above = look_at(np.array([0.05, 0.01, 1.6]), np.array([0.05, 0.0100001, 0.7]), 500.0)
    xy = plane_coordinates(above, HEIGHT) - (0.05, 0.01)
    mask = (np.abs(xy) <= (0.27, 0.2)).all(axis=-1)
    ratio = focal_of_rectangle(fit_rectangle(mask, None, above, HEIGHT), mask, above, HEIGHT)
    assert ratio is None or ratio.warning is None
