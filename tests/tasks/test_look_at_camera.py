"""A camera that looks at a point has it in the middle of its picture, and the world upright."""

import numpy as np
import pytest

from nuno.errors import InvalidInputError
from nuno.tasks.look_at_camera import look_at_camera

EYE, TARGET, UP = np.array((1.5, -1.0, 1.2)), np.array((0.2, 0.1, 0.7)), np.array((0.0, 0.0, 1.0))


def test_target_is_in_the_middle():
    """Integer pixels are centres: of 101 columns and 81 rows, 50 and 40 are the middle ones."""
    camera = look_at_camera(EYE, TARGET, 101, 81, 120.0)
    np.testing.assert_allclose(camera.project(TARGET), (50.0, 40.0), atol=1e-9)
    assert camera.depth_of(TARGET) == pytest.approx(np.linalg.norm(TARGET - EYE))


def test_picture_is_upright():
    """What is above the target is above it in the picture, and what is level and to the right of it to the right."""
    camera = look_at_camera(EYE, TARGET, 101, 81, 120.0)
    above, aside = camera.project(TARGET + 0.1 * UP), np.cross(TARGET - EYE, UP)
    right = camera.project(TARGET + 0.1 * aside)
    assert above[0] == pytest.approx(50.0) and above[1] < 39.0
    assert right[0] > 51.0 and right[1] == pytest.approx(40.0)


@pytest.mark.parametrize("target", [EYE, EYE - UP])
def test_nothing_is_upright_straight_below(target):
    """Then no side of the picture is up."""
    with pytest.raises(InvalidInputError, match="beside the camera"):
        look_at_camera(EYE, target, 101, 81, 120.0)
