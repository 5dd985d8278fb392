"""Images and masks as callers give them: what counts as foreground."""

import numpy as np
import pytest

from nuno import Camera
from nuno.camera.image import check_mask
from nuno.errors import ImageError

CAMERA = Camera(4, 2, 10.0, 10.0, 1.5, 0.5)
INSIDE = np.array([[0, 1, 1, 0], [0, 1, 1, 0]], dtype=bool)


@pytest.mark.parametrize("dtype", [np.uint8, np.int64, np.float32])
@pytest.mark.parametrize("top", [1, 255])
def test_foreground_is_what_is_above_half_of_the_brightest(dtype, top):
    """Definition: a pixel that the cloth covers by less than half, as at an antialiased edge, is background."""
    mask = (top * INSIDE).astype(dtype)
    if top > 1 or dtype == np.float32:
        mask[0, 0], mask[1, 3], mask[0, 1] = 0.4 * top, 0.49 * top, 0.6 * top
    np.testing.assert_array_equal(check_mask(mask, CAMERA), INSIDE)


def test_bools_are_taken_as_they_are_and_black_has_no_foreground():
    """Definition."""
    np.testing.assert_array_equal(check_mask(INSIDE, CAMERA), INSIDE)
    assert not check_mask(np.zeros((2, 4)), CAMERA).any()
    with pytest.raises(ImageError, match="mask must have shape"):
        check_mask(INSIDE.T, CAMERA)


@pytest.mark.parametrize("values", [(0.0, 0.02), (-3.0, 1.0), (0.0, 0.97), (0.0, np.nan)])
def test_probabilities_and_logits_are_no_masks(values):
    """Half of the largest means nothing for them: noise of 0.02 where there is no cloth would be cloth."""
    with pytest.raises(ImageError, match="real numbers"):
        check_mask(np.where(INSIDE, values[1], values[0]), CAMERA)
