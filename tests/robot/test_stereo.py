"""Stereo: points from two views, their uncertainty, and hands followed through rendered videos whose truth is known."""

import cv2
import numpy as np
import pytest

import nuno
from nuno.camera.camera import Camera
from nuno.camera.picture import Lamp, take_picture
from nuno.errors import InvalidInputError
from nuno.robot.stereo import locate_marker, track_hands_in_stereo, triangulate

BASELINE, FOCAL = 0.07, 554.3


def pair(distortion=None, scale=1.0):
    """Return two cameras, 0.07 m apart, 0.9 m above a table's middle and 0.5 m before it, that look down at it."""
    place, middle = np.array((0.1, 0.0, 1.6)), np.array((0.6, 0.0, 0.75))
    z = (middle - place) / np.linalg.norm(middle - place)
    x = np.cross(z, (0, 0, 1.0))
    x /= np.linalg.norm(x)
    made = []
    for side in (-0.5, 0.5):
        pose = np.eye(4)
        pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        pose[:3, 3] = place + side * BASELINE * x
        made.append(Camera(640, 480, FOCAL, FOCAL, 319.5, 239.5, pose, distortion).scaled(scale))
    return made


POINTS = np.array([(0.6, 0.0, 0.75), (0.5, 0.2, 0.9), (0.7, -0.15, 0.8)])


@pytest.mark.parametrize("distortion", [None, (-0.2, 0.05, 1e-3, -5e-4)])
def test_exact_pixels_give_the_points_back(distortion):
    """Projection and its inverse, with and without distortion; nothing remains in the images."""
    left, right = pair(distortion)
    found = triangulate(left, right, left.project(POINTS), right.project(POINTS))
    np.testing.assert_allclose(found.positions, POINTS, atol=1e-7)  # [m], OpenCV's iterative undistortion
    assert found.residuals.max() < 1e-4
    single = triangulate(left, right, left.project(POINTS[0]), right.project(POINTS[0]))
    np.testing.assert_allclose(single.positions, POINTS[:1], atol=1e-7)


def test_the_covariance_is_that_of_noisy_pixels():
    """2,000 draws spread as it says; along the rays by depth squared over focal length and baseline."""
    left, right = pair()
    noise, draws = 0.4, 2000
    random = np.random.default_rng(0)
    a, b = (camera.project(POINTS[0]) + noise * random.standard_normal((draws, 2)) for camera in (left, right))
    found = triangulate(left, right, a, b, noise=noise)
    told = found.covariances.mean(axis=0)
    drawn = np.cov(found.positions.T)
    scale = np.sqrt(np.outer(np.diag(told), np.diag(told)))
    # a variance of 2,000 draws is known to sqrt(2 / 2000) = 3 %; four of these
    np.testing.assert_allclose(drawn / scale, told / scale, atol=0.13)
    depth = left.depth_of(POINTS[0])
    assert found.deviations.mean() == pytest.approx(depth**2 / (FOCAL * BASELINE) * noise * np.sqrt(2.0), rel=0.02)


def video(ways, times, screen=None, noise=1.0, cameras=None):
    """Return left and right images of balls that move over a table; ``screen`` hides what is behind."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.8, 1.2, 0.02), position=(0.7, 0, 0.71), color="#9b6b43"))
    balls = [world.add(nuno.sphere(0.014, color=color)) for color in ("#2050c0", "#208040")[: len(ways)]]
    board = world.add(nuno.box((0.08, 0.004, 0.1), color="#b0b0b0", position=(0, 0, -1))) if screen else None
    images = ([], [])
    for k, _ in enumerate(times):
        for ball, way in zip(balls, ways, strict=True):
            ball.locate(way[k])
        if board is not None:
            board.locate(screen(k))
        for side, camera in enumerate(pair() if cameras is None else cameras[k]):
            picture = take_picture(world, camera, lamp=Lamp(shadows=False), noise=noise, seed=2 * k + side)
            images[side].append(picture.color.numpy())
    return images


TIMES = np.arange(24) / 24.0
FAR = 8e-3  # [m]; the depth of a pixel of disparity is 22 mm there, a ball's middle is drawn to the lit side by 1.7 px


def two_ways():
    """Two hands that move up and apart, and across, with at most 1.5 m/s2."""
    s = (10 * TIMES**3 - 15 * TIMES**4 + 6 * TIMES**5)[:, None]
    return [
        np.array((0.55, 0.1, 0.8)) + s * np.array((0.0, 0.15, 0.15)),
        np.array((0.55, -0.1, 0.8)) + s * np.array((0.1, -0.1, 0.1)),
    ]


@pytest.mark.long
def test_two_hands_are_followed_as_surely_as_they_say():
    """Errors as the deviations that the track tells, and under 8 mm: no hint of height is given."""
    ways = two_ways()
    left, right = video(ways, TIMES)
    a, b = pair()
    tracks = track_hands_in_stereo(left, right, TIMES, left=a, right=b, start=[way[0] for way in ways])
    for track, way in zip(tracks, ways, strict=True):
        assert track.found.all() and track.gaps == ()
        error = track.positions - way
        assert np.linalg.norm(error, axis=1).max() < FAR
        # squared errors in units of the covariance are 3 on average; those of one hand hang together: three times that
        distance = np.einsum("ki,kij,kj->k", error, np.linalg.inv(track.covariances), error)
        assert distance.mean() < 9.0
        held = TIMES > 0.2
        path = track.path(held)
        np.testing.assert_array_equal(path.positions, track.positions)
        assert path.holds[0][1] == np.inf


@pytest.mark.long
def test_a_hand_that_one_image_misses_is_still_followed():
    """Seen by the left camera alone for a third of the time: no gap, and within what the track tells."""
    way = two_ways()[:1]
    left, right = video(way, TIMES)
    shown = {k: image for k, image in enumerate(right) if not 8 <= k < 16}
    a, b = pair()
    (track,) = track_hands_in_stereo(left, shown, TIMES, left=a, right=b, start=[way[0][0]])
    assert track.gaps == () and not track.found[8:16, 1].any() and track.found[:, 0].all()
    assert np.linalg.norm(track.positions - way[0], axis=1).max() < 0.01
    assert track.deviations[12] > track.deviations[4]


@pytest.mark.long
def test_an_occluded_hand_is_bridged_and_the_gap_is_told():
    """A board passes before the ball for some frames: neither image shows it, and the way between is bridged."""
    way = two_ways()[:1]
    a, b = pair()
    hidden = range(10, 15)

    def screen(k):
        if k not in hidden:
            return np.array((0.0, 0.0, -1.0))
        middle = 0.5 * (a.camera_to_world[:3, 3] + b.camera_to_world[:3, 3])
        return way[0][k] + 0.12 * (middle - way[0][k])

    left, right = video(way, TIMES, screen)
    (track,) = track_hands_in_stereo(left, right, TIMES, left=a, right=b, start=[way[0][0]])
    assert not track.found[10:15].any() and track.found[:10].all() and track.found[15:].all()
    assert track.gaps == ((TIMES[9], TIMES[15]),)
    assert np.linalg.norm(track.positions - way[0], axis=1).max() < 0.015  # [m], 0.2 s at up to 0.4 m/s bridged
    assert track.deviations[12] > 1.3 * track.deviations[5]


@pytest.mark.long
def test_cameras_that_move_follow_too():
    """The head turns while it looks: a camera for each frame."""
    way = two_ways()[:1]
    cameras = []
    for k in range(len(TIMES)):
        turned = nuno.Coordinates().rotate(0.003 * k, (0, 0, 1))
        moved = []
        for camera in pair():
            pose = camera.camera_to_world.copy()
            pose[:3] = turned.rotation @ pose[:3]
            moved.append(Camera(640, 480, FOCAL, FOCAL, 319.5, 239.5, pose))
        cameras.append(moved)
    left, right = video(way, TIMES, cameras=cameras)
    (track,) = track_hands_in_stereo(
        left, right, TIMES, left=[c[0] for c in cameras], right=[c[1] for c in cameras], start=[way[0][0]]
    )
    assert track.found.all() and np.linalg.norm(track.positions - way[0], axis=1).max() < FAR


def test_a_marker_is_found_where_it_is():
    """An ArUco marker made of tiles, rendered: its corners within three deviations; another one is not there."""
    world = nuno.World(device="cpu")
    bits = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 6)
    size, middle = 0.02, np.array((0.6, 0.0, 0.8))
    world.add(nuno.box((0.2, 0.2, 0.002), position=middle - (0, 0, 0.001), color="white"))
    for row, column in np.argwhere(bits < 128):
        place = middle + size * np.array((2.5 - row, 2.5 - column, 0.0))  # its top away from the robot, x ahead
        world.add(nuno.box((size, size, 2e-4), position=place, color="black"))
    left, right = pair()
    images = [
        take_picture(world, camera, lamp=Lamp(shadows=False), samples=2).color.numpy() for camera in (left, right)
    ]
    found = locate_marker(*images, left, right, 7)
    corners = middle + size * np.array([(3, 3, 0), (3, -3, 0), (-3, -3, 0), (-3, 3, 0.0)]) + (0, 0, 1e-4)
    assert (np.linalg.norm(found.positions - corners, axis=1) < 3.0 * found.deviations).all()
    assert found.deviations.max() < 7e-3  # [m], 0.2 px at 0.95 m
    assert locate_marker(*images, left, right, 8) is None


def test_bad_input():
    """Named errors that say what is valid."""
    left, right = pair()
    good = left.project(POINTS), right.project(POINTS)
    with pytest.raises(InvalidInputError, match="of the same points, got 3 and 2"):
        triangulate(left, right, good[0], good[1][:2])
    with pytest.raises(InvalidInputError, match="at one place"):
        triangulate(left, left, *good)
    with pytest.raises(InvalidInputError, match="do not meet in front of both cameras"):
        triangulate(left, right, (300.0, 240.0), (340.0, 240.0))
    image = np.zeros((480, 640, 3), dtype=np.uint8)
    with pytest.raises(InvalidInputError, match="the first frame needs a right image"):
        track_hands_in_stereo([image, image], {1: image}, (0, 1), left=left, right=right, start=[POINTS[0]])
    with pytest.raises(InvalidInputError, match="left must be a Camera, or 2 of them"):
        track_hands_in_stereo([image], [image], (0, 1), left=[left], right=right, start=[POINTS[0]])
    with pytest.raises(InvalidInputError, match="not in the first left image"):
        track_hands_in_stereo([image], [image], (0, 1), left=left, right=right, start=[(5.0, 5.0, 0.0)])
