"""A cloth's edge beside its own thin shadow on the table."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from nuno.camera.rim_shadow import cloth_at_shadow

TABLE = np.array([140.0, 120.0, 100.0])
CLOTH = np.array([60.0, 70.0, 150.0])
EDGE = 60  # [px] column at which the cloth ends


def side(width: int, share: float, *, blur: float = 0.9, stripes: bool = False) -> np.ndarray:
    """An image (160, 120, 3) float32: cloth, a strip of the table in a share of its light, and the table."""
    image = np.tile(TABLE, (160, 120, 1))
    image[:, :EDGE] = CLOTH
    if stripes:
        image[:, 10:EDGE][:, np.arange(EDGE - 10) % 10 < 4] = share * TABLE
    image[:, EDGE : EDGE + width] = share * TABLE
    noise = np.random.default_rng(2).normal(0.0, 3.0, image.shape)
    return (cv2.GaussianBlur(image, (0, 0), blur) + cv2.GaussianBlur(noise, (0, 0), 0.6)).astype(np.float32)


def measure(image: np.ndarray, line: float, metres: float = 0.002) -> np.ndarray | None:
    """The cloth's edge along a line at a column [px]."""
    rows = np.arange(10.0, 150.0, 2.0)
    pixels = np.column_stack([np.full_like(rows, line), rows])
    return cloth_at_shadow(image, pixels, np.tile([1.0, 0.0], (len(rows), 1)), metres)


@pytest.mark.parametrize("width", [2, 3, 4])
@pytest.mark.parametrize("line", [0.0, 1.0, 2.0])
def test_edge_is_the_cloths(width: int, line: float) -> None:
    """The edge lies between the last pixel of the cloth and the first of the shadow, wherever the line is."""
    found = measure(side(width, 0.45), EDGE + line)
    assert found is not None
    # Edges are tried at every quarter of a pixel, with a blur that is not quite the picture's.
    assert np.abs(EDGE - 0.5 - (EDGE + line) - found).max() < 0.3


def test_an_edge_without_a_strip_is_left_alone() -> None:
    """Neither a sharp nor a soft edge has a strip beside it."""
    assert measure(side(0, 0.45), EDGE) is None
    assert measure(side(0, 0.45, blur=1.4), EDGE) is None


def test_a_stripe_of_the_cloth_is_no_shadow() -> None:
    """A strip as dark as other stripes of the cloth is one of them."""
    assert measure(side(3, 0.45, stripes=True), EDGE) is None


def test_a_strip_of_another_tint_is_no_shadow() -> None:
    """A dark hem has not the table's tint."""
    image = side(0, 0.45)
    image[:, EDGE : EDGE + 3] = (20.0, 70.0, 70.0)
    assert measure(cv2.GaussianBlur(image, (0, 0), 0.9), EDGE) is None


def test_a_wide_strip_is_no_shadow() -> None:
    """A flat cloth's shadow is some millimetres wide, not centimetres."""
    assert measure(side(4, 0.45), EDGE, metres=0.005) is None


def test_a_short_side_is_left_alone() -> None:
    """A dozen pixels say too little."""
    pixels = np.column_stack([np.full(8, EDGE + 0.0), np.arange(20.0, 36.0, 2.0)])
    assert cloth_at_shadow(side(3, 0.45), pixels, np.tile([1.0, 0.0], (8, 1)), 0.002) is None
