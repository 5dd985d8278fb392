"""Sharpness and exposure of images."""

import cv2
import numpy as np
import pytest

import nuno
from nuno.camera.image_quality import check_quality


def edges(blur, low=60.0, high=180.0):
    """Stripes 40 px wide, at a slant, that a Gaussian has blurred (h, w, 3) uint8."""
    v, u = np.mgrid[:240, :320]
    image = np.where((u + 0.3 * v) % 80 < 40, low, high).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), blur)
    noise = np.random.default_rng(0).normal(0, 2.0, (240, 320, 1))
    return np.clip(image[..., None] + noise, 0, 255).astype(np.uint8).repeat(3, axis=-1)


@pytest.mark.parametrize("blur", [1.0, 2.0, 3.0])
def test_blur_is_that_of_the_edges(blur):
    """The blur of edges that a Gaussian blurred is its deviation, to a fifth: by noise a fourth look sharper."""
    assert nuno.image_quality(edges(blur)).blur == pytest.approx(blur, rel=0.2)


def test_blur_does_not_depend_on_contrast():
    """Faint edges are as sharp as strong ones; noise of 2 levels on 50 changes it by a tenth."""
    assert nuno.image_quality(edges(1.5, 100, 150)).blur == pytest.approx(nuno.image_quality(edges(1.5)).blur, rel=0.1)


def test_what_is_refused():
    """Blurred, overexposed, dark and empty images are refused by name, with what to do."""
    good = edges(0.8)
    check_quality(good, "it")
    for image, words in (
        (edges(4.0), "is blurred by .* focus"),
        (np.clip(good.astype(int) + 100, 0, 255).astype(np.uint8), "is overexposed.* shorter exposure"),
        ((good * 0.1).astype(np.uint8), "is too dark.* more light"),
        (np.full_like(good, 128), "shows no edges"),
    ):
        with pytest.raises(nuno.ImageQualityError, match=f"^it {words}"):
            check_quality(image, "it")


def test_bad_images():
    """What is no image is told."""
    with pytest.raises(nuno.ImageError, match="uint8"):
        nuno.image_quality(np.zeros((4, 4)))
    with pytest.raises(nuno.ImageError, match="region"):
        nuno.image_quality(edges(1.0), np.zeros((240, 320), bool))
