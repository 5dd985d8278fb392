"""Pictures in notebooks are small."""

import cv2
import numpy as np

from nuno.camera.small_png import MAX_SIDE, WORLDS, small_png


def read(png):
    """Return the image of a PNG, (h, w, 3) red, green, blue."""
    return cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def test_a_small_picture_is_as_it_is():
    """Pixel by pixel."""
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    assert np.array_equal(read(small_png(image)), image)


def test_a_large_one_is_made_smaller():
    """To the longest side that is shown; its shape is kept."""
    assert read(small_png(np.zeros((1000, 2000, 3), np.uint8))).shape == (MAX_SIDE // 2, MAX_SIDE, 3)


def test_worlds_stand_in_rows():
    """Row by row, white where there is none; only the first of many."""
    images = np.stack([np.full((4, 6, 3), 10 * k, np.uint8) for k in range(5)])
    shown = read(small_png(images))
    assert shown.shape == (8, 18, 3)
    assert shown[::4, ::6, 0].tolist() == [[0, 10, 20], [30, 40, 255]]
    assert read(small_png(np.zeros((WORLDS + 20, 4, 4, 3), np.uint8))).shape == (24, 24, 3)
