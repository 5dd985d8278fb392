"""Colours by name and number."""

import numpy as np
import pytest

from nuno import InvalidInputError
from nuno.shapes.color import linear, rgb


def test_names_and_numbers():
    """CSS names, hexadecimal and numbers give the same colour."""
    np.testing.assert_allclose(rgb("gray"), (128 / 255,) * 3)
    np.testing.assert_allclose(rgb("#ff8000"), (1.0, 128 / 255, 0.0))
    np.testing.assert_allclose(rgb((0.1, 0.2, 0.3)), (0.1, 0.2, 0.3))


@pytest.mark.parametrize("color", ["octarine", "#12", (0.1, 0.2), (0, 0, 256), None, (0.0, float("nan"), 0.0)])
def test_no_colour(color):
    """What is no colour is named."""
    with pytest.raises(InvalidInputError):
        rgb(color)


def test_linear():
    """Ends stay, the middle of sRGB is 21.4 % of the light (IEC 61966-2-1), and the two pieces meet."""
    np.testing.assert_allclose(linear(np.array([0.0, 0.5, 1.0])), (0.0, 0.21404, 1.0), atol=1e-5)
    np.testing.assert_allclose(linear(np.array([0.02])), 0.02 / 12.92, rtol=1e-12)  # the piece near black is a line
    low, high = linear(np.array([0.04045, 0.0404501]))
    assert high - low < 1e-7
