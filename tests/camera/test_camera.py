"""Camera: projection, rays and their inverse."""

import cv2
import numpy as np
import pytest

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError


def _pose(position=(0.3, -0.5, 1.2), target=(0.1, 0.0, 0.2)) -> np.ndarray:
    forward = np.subtract(target, position) / np.linalg.norm(np.subtract(target, position))
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = position
    return pose


def _camera(distortion=None) -> Camera:
    return Camera(640, 480, 520.0, 510.0, 315.0, 244.0, camera_to_world=_pose(), distortion=distortion)


MILD = (-0.21, 0.06, 0.0012, -0.0008, 0.01)


@pytest.mark.parametrize("distortion", [None, MILD])
def test_project_matches_opencv(distortion):
    """Pixels are those of cv2.projectPoints."""
    camera = _camera(distortion)
    points = np.random.default_rng(0).uniform((-0.2, -0.2, 0.0), (0.4, 0.3, 0.4), (50, 3))
    view = camera.world_to_camera
    expected = cv2.projectPoints(
        points, cv2.Rodrigues(view[:3, :3])[0], view[:3, 3], camera.matrix, np.array(distortion or (0.0,) * 5)
    )[0].reshape(-1, 2)
    # both compute in float64; the rotation vector costs a few digits of 1e3 px
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-8)


@pytest.mark.parametrize("distortion", [None, MILD])
def test_back_project_undoes_project(distortion):
    """Pixels of points on a plane lead back to the points."""
    camera = _camera(distortion)
    points = np.random.default_rng(1).uniform((-0.1, -0.2, 0.25), (0.3, 0.2, 0.25), (4, 10, 3))
    pixels = camera.project(points)
    assert pixels.shape == (4, 10, 2)
    # OpenCV's undistortion is iterative: it stops at about 1e-5 m at this distance
    np.testing.assert_allclose(camera.back_project(pixels, 0.25), points, atol=1e-10 if distortion is None else 2e-5)


def test_rays_have_unit_depth():
    """A ray times a depth is a point of that depth on that pixel."""
    camera = _camera()
    pixels = np.array([[0.0, 0.0], [639.0, 479.0], [315.0, 244.0]])
    points = camera.camera_to_world[:3, 3] + 1.7 * camera.rays(pixels)
    np.testing.assert_allclose(camera.depth_of(points), 1.7, atol=1e-12)  # float64 rounding
    np.testing.assert_allclose(camera.project(points), pixels, atol=1e-9)  # the same, times 500 px
    np.testing.assert_allclose(camera.rays(pixels[2]), camera.camera_to_world[:3, 2], atol=1e-12)


def test_points_behind_the_camera_have_no_pixel():
    """What is behind the camera projects to NaN and has a negative depth."""
    camera = _camera()
    behind = camera.camera_to_world[:3, 3] - camera.camera_to_world[:3, 2]
    assert np.isnan(camera.project(behind)).all()
    assert camera.depth_of(behind) == pytest.approx(-1.0)


def test_scaled_keeps_the_edges_of_the_image():
    """The image's outer corners stay the same rays, so pixel areas (not centres) coincide."""
    camera = _camera()
    half = camera.scaled(0.5)
    assert (half.width, half.height) == (320, 240)
    corners, half_corners = np.array([[-0.5, -0.5], [639.5, 479.5]]), np.array([[-0.5, -0.5], [319.5, 239.5]])
    np.testing.assert_allclose(half.rays(half_corners), camera.rays(corners), atol=1e-12)  # rounding
    # a pixel of the small image is the mean of two by two
    np.testing.assert_allclose(half.rays((10.0, 20.0)), camera.rays((20.5, 40.5)), atol=1e-12)


def test_from_dict_reads_an_input_file():
    """The entries of a camera in an input.json."""
    camera = Camera.from_dict(
        {
            "width": 64,
            "height": 48,
            "fx": 50,
            "fy": 51,
            "cx": 31.5,
            "cy": 23.5,
            "camera_to_world": _pose().tolist(),
        }
    )
    assert (camera.width, camera.height, camera.fx, camera.fy) == (64, 48, 50.0, 51.0)
    np.testing.assert_array_equal(camera.camera_to_world, _pose())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "pixels"),
        ({"fx": -1.0}, "fx"),
        ({"cx": float("nan")}, "finite"),
        ({"camera_to_world": np.eye(3)}, r"\(4, 4\)"),
        ({"camera_to_world": np.diag([2.0, 1.0, 1.0, 1.0])}, "rotation"),
        ({"camera_to_world": np.diag([1.0, 1.0, -1.0, 1.0])}, "rotation"),
    ],
)
def test_bad_cameras_are_refused(change, message):
    """A camera that cannot be says why."""
    good = {
        "width": 64,
        "height": 48,
        "fx": 50.0,
        "fy": 50.0,
        "cx": 31.5,
        "cy": 23.5,
        "camera_to_world": np.eye(4),
    }
    with pytest.raises(InvalidInputError, match=message):
        Camera(**{**good, **change})


def test_bad_dicts_are_refused():
    """What is missing or not a number is named."""
    with pytest.raises(InvalidInputError, match="lacks fx, fy"):
        Camera.from_dict({"width": 1, "height": 1, "cx": 0, "cy": 0, "camera_to_world": np.eye(4)})
    with pytest.raises(InvalidInputError, match="list"):
        Camera.from_dict([1, 2])
    bad = {"width": 1, "height": 1, "fx": "wide", "fy": 1, "cx": 0, "cy": 0, "camera_to_world": np.eye(4)}
    with pytest.raises(InvalidInputError, match="wide"):
        Camera.from_dict(bad)


def test_pixels_above_the_horizon_do_not_back_project():
    """A ray that does not meet the plane is an error, not a point behind the camera."""
    level = Camera(64, 48, 50.0, 50.0, 31.5, 23.5, camera_to_world=_pose((0, 0, 1), (1, 0, 1)))
    with pytest.raises(InvalidInputError, match="plane"):
        level.back_project((31.5, 5.0), 0.0)


@pytest.mark.parametrize("eye, target, up, top", [
    ((0.3, -0.5, 1.2), (0.1, 0.0, 0.2), (0, 0, 1), (0, 0, 1)),
    ((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0, 0, 1), (0, 1, 0)),  # straight down: +y points up
    ((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0, 1, 0), (1, 0, 0)),  # up is the line of sight, and so is +y
])  # fmt: skip
def test_look_at(eye, target, up, top):
    """The target is in the middle, what is above it is above it there, and the edges are half the angle away."""
    camera = Camera.look_at(eye, target, np.radians(50.0), width=80, height=60, up=up)
    np.testing.assert_allclose(camera.project(target), (39.5, 29.5), atol=1e-9)
    across, down = camera.project(np.add(target, 0.01 * np.array(top))) - camera.project(target)
    assert abs(across) < 1e-9 and down < 0.0
    np.testing.assert_allclose(camera.camera_to_world[:3, 3], eye)
    middle, edge = camera.rays([39.5, 29.5]), camera.rays([39.5, -0.5])  # the first row's upper edge
    angle = np.arccos(middle @ edge / np.linalg.norm(middle) / np.linalg.norm(edge))
    assert np.degrees(angle) == pytest.approx(25.0, abs=1e-9)


def test_look_at_names_what_it_cannot_do():
    """Degrees, a camera on its target, no direction, no pixels."""
    with pytest.raises(InvalidInputError, match=r"np.radians\(45\)"):
        Camera.look_at((0, 0, 1), (0, 0, 0), 45)
    with pytest.raises(InvalidInputError, match="same point"):
        Camera.look_at((0, 0, 1), (0, 0, 1), 0.7)
    with pytest.raises(InvalidInputError, match="direction"):
        Camera.look_at((0, 0, 1), (0, 0, 0), 0.7, up=(0, 0, 0))
    with pytest.raises(InvalidInputError, match="width"):
        Camera.look_at((0, 0, 1), (0, 0, 0), 0.7, width=0.5)
