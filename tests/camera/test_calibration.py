"""A camera by images of a board that another, known camera took."""

from functools import cache

import cv2
import numpy as np
import pytest
from board_views import BOARD, LENS, board_view, board_views, exposed, quads, room

import nuno
from nuno.camera.image_quality import check_quality

views = cache(board_views)


def table_view(camera, at=(0.05, -0.02), height=0.72, thickness=0.0):
    """The board on the table, its middle at x and y."""
    width, depth = BOARD.size
    corners = np.array([[-width / 2, depth / 2, 0], [width / 2, depth / 2, 0], [-width / 2, -depth / 2, 0]])
    corners += (*at, height + thickness)
    return exposed(quads(camera, room(camera), corners, 0.82 * BOARD.picture(100) + 20))


def over_table(lens=LENS, eye=(-0.45, 0.1, 1.27)):
    """A lens 0.6 m over a table, aslant."""
    pose = nuno.Camera.look_at(eye, (0.05, 0.0, 0.72), 1.0).camera_to_world
    return nuno.Camera(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy, pose, lens.distortion)


def test_the_lens_comes_back():
    """Eight views give the focal lengths to 0.5 % and the rays of all but the rim's pixels to 2 px.

    The corners are found to 0.09 px, and OpenCV tells a deviation of 0.14 % for the focal length and, with it, of
    about a pixel for the principal point, which p1 and p2 partly balance; three of these are allowed.
    """
    found = nuno.calibrate_camera(views(), BOARD)
    assert found.camera.fx == pytest.approx(LENS.fx, rel=0.005)
    assert found.camera.fy == pytest.approx(LENS.fy, rel=0.005)
    assert found.error < 0.2
    assert found.views == 8 and not found.warnings
    pixels = np.stack(np.meshgrid(np.linspace(64, 575, 9), np.linspace(48, 431, 7)), axis=-1)
    assert np.linalg.norm(found.camera.project(LENS.rays(pixels)) - pixels, axis=-1).max() < 2.0


def test_bad_views_are_left_out_and_told():
    """A blurred view and one without the board do not count, and the rest give the same lens as without them."""
    blurred = cv2.GaussianBlur(views()[2], (0, 0), 4.0)
    given = [*views(), exposed(room(LENS)), blurred]
    names = [f"{k}.png" for k in range(10)]
    found = nuno.calibrate_camera(given, BOARD, names)
    assert found.views == 8
    assert len(found.warnings) == 2 and "8.png" in found.warnings[0] and "9.png" in found.warnings[1]
    assert found.camera.fx == pytest.approx(nuno.calibrate_camera(views(), BOARD).camera.fx, rel=1e-9)  # OpenCV's sums


def test_too_few_or_the_same_views():
    """Three views are too few, and eight of one place cover too little; the errors say how to hold the board."""
    with pytest.raises(nuno.CalibrationError, match=r"3 of 3 images .* 6 are needed: hold the board"):
        nuno.calibrate_camera(views()[:3], BOARD)
    with pytest.raises(nuno.CalibrationError, match="6 are needed"):
        nuno.calibrate_camera([], BOARD)
    near = [board_view(LENS, np.array([0.0, 0.0, 0.6]), (0.01 * k, 0.0, 0.0), seed=k) for k in range(6)]
    with pytest.raises(nuno.CalibrationError, match=r"seen in .* of the image|focal length is known|fit no camera"):
        nuno.calibrate_camera(near, BOARD)


def test_images_without_the_board():
    """No image with the board, only blurred or overexposed ones, or images of two sizes."""
    with pytest.raises(nuno.BoardNotFoundError, match="image 0 shows 0 of"):
        nuno.calibrate_camera([exposed(room(LENS))] * 6, BOARD)
    with pytest.raises(nuno.ImageQualityError, match="blurred by"):
        nuno.calibrate_camera([cv2.GaussianBlur(view, (0, 0), 6.0) for view in views()[:6]], BOARD)
    bright = [np.clip(view.astype(int) * 2 + 90, 0, 255).astype(np.uint8) for view in views()[:6]]
    with pytest.raises(nuno.ImageQualityError, match="overexposed"):
        nuno.calibrate_camera(bright, BOARD)
    with pytest.raises(nuno.ImageError, match="one camera, one size"):
        nuno.calibrate_camera([*views()[:6], views()[0][:240]], BOARD)


def test_another_lens_than_the_tables():
    """A table seen through another lens (half as long again, with strong pincushion distortion) does not fit."""
    camera = over_table(eye=(-0.1, 0.05, 1.0))
    other = nuno.Camera(640, 480, 840.0, 840.0, 325.0, 236.0, distortion=[2.0, 0.0, 0.05, 0.05])
    with pytest.raises(nuno.CalibrationError, match=r"is the lens that of the other images"):
        nuno.camera_above_table(table_view(camera), other, BOARD)


@pytest.mark.parametrize("thickness", [0.0, 0.01])
def test_the_pose_over_the_table(thickness):
    """With the true lens the camera is found to 5 mm and 0.4 degrees, also with a board on a plate of 1 cm.

    Corners to 0.2 px, as squares are 20 px wide here and 14 high, over 130 px: 0.2 / 130 rad / sqrt(6) each way, twice.
    """
    camera = over_table()
    image = table_view(camera, thickness=thickness)
    found, error = nuno.camera_above_table(
        image, LENS, BOARD, table_height=0.72, board_thickness=thickness, board_at=(0.05, -0.02)
    )
    assert error < 0.3
    np.testing.assert_allclose(found.camera_to_world[:3, 3], camera.camera_to_world[:3, 3], atol=5e-3)
    np.testing.assert_allclose(found.camera_to_world[:3, :3], camera.camera_to_world[:3, :3], atol=np.radians(0.4))


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.02, -0.03, 0.01)])
def test_a_marker_in_one_image(offset):
    """A marker of 6 cm, 60 px wide, is found to 5 mm along the view (0.3 / 60 of 0.6 m is 3) and 1 mm across it."""
    camera = over_table()
    middle, side = np.array([0.0, 0.1, 0.95]), 0.06
    right, up = np.array([0.0, -1.0, 0.0]), np.array([np.sin(0.6), 0.0, np.cos(0.6)])
    known = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    picture = cv2.aruco.generateImageMarker(known, 7, 300).astype(float) * 0.8 + 20
    corners = middle + 0.5 * side * np.array([up - right, up + right, -up - right])
    image = exposed(quads(camera, room(camera), corners, picture))
    point, _, error = nuno.find_marker(image, camera, 7, side, offset=offset)
    true = middle + np.array(offset) @ np.stack([right, up, np.cross(right, up)])
    ray = true - camera.camera_to_world[:3, 3]
    ray /= np.linalg.norm(ray)
    away = point - true
    assert abs(away @ ray) < 0.005
    assert np.linalg.norm(away - (away @ ray) * ray) < 0.0015 + 0.1 * np.linalg.norm(offset)
    assert error < 0.5
    with pytest.raises(nuno.BoardNotFoundError, match=r"marker 8 of 4X4_50 \(it shows \[7\]\)"):
        nuno.find_marker(image, camera, 8, side)


def test_the_views_are_good():
    """The images that these tests are made of are themselves sharp and well exposed."""
    for image in views():
        check_quality(image, "a view")
