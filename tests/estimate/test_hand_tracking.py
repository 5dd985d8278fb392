"""Following hands that are drawn as discs where a known path has them."""

import cv2
import numpy as np
import pytest

import nuno
from nuno import InvalidInputError

TOP, RADIUS = 0.72, 0.014  # [m]
TIMES = np.arange(0.0, 2.0, 1 / 30)


def make_camera():
    """A small camera 0.9 m before the table and 0.6 m above it, looking 30 degrees down."""
    down, pose = np.deg2rad(30.0), np.eye(4)
    pose[:3, :3] = [[0, -np.sin(down), np.cos(down)], [-1, 0, 0], [0, -np.cos(down), -np.sin(down)]]
    pose[:3, 3] = (-0.9, 0.0, TOP + 0.6)
    return nuno.Camera(320, 240, 250.0, 250.0, 159.5, 119.5, pose)


def true_paths():
    """Two hands on half circles of 0.2 m radius, within 1.6 s: (k, 2, 3) [m]."""
    s = np.clip(TIMES / 1.6, 0.0, 1.0)
    angle = np.pi * s**3 * (10.0 + s * (6.0 * s - 15.0))
    x, z = -0.2 * np.cos(angle), TOP + 0.2 * np.sin(angle)
    return np.stack([np.stack([x, np.full_like(x, y), z], axis=1) for y in (-0.15, 0.15)], axis=1)


def draw(camera, positions):
    """An image of a grey, noisy table with a dark ball at each position."""
    fine = np.full((240 * 8, 320 * 8, 3), 150, np.uint8)
    for p in positions:
        u, v = (camera.project(p) + 0.5) * 8
        size = RADIUS * camera.fx / camera.depth_of(p) * 8
        cv2.circle(fine, (round(float(u)), round(float(v))), round(float(size)), (35, 35, 40), -1)
    image = cv2.resize(fine, (320, 240), interpolation=cv2.INTER_AREA).astype(float)
    rng = np.random.default_rng(int(positions[:, 0].sum() * 1e6) % 1000)
    return (image + rng.normal(0.0, 4.0, image.shape)).clip(0, 255).astype(np.uint8)


def film(hidden=()):
    """Images of every third frame; in those of ``hidden`` the first hand is not to be seen."""
    camera, paths = make_camera(), true_paths()
    return {k: draw(camera, paths[k, 1:] if k in hidden else paths[k]) for k in range(0, len(TIMES), 3)}


def follow(images, **changes):
    """The tracks of both hands."""
    paths = true_paths()
    given = dict(frame_times=TIMES, camera=make_camera(), start=paths[0], heights=paths[..., 2], radius=RADIUS)
    return nuno.track_hands(images, **given | changes)


def error(track, hand):
    """How far a track is from the truth, (k,) [m]."""
    return np.linalg.norm(track.positions - true_paths()[:, hand], axis=1)


def test_hands_are_followed_everywhere():
    """To half a pixel (2.2 mm at 1.1 m), and to a pixel and the rays' slant between two images."""
    for hand, track in enumerate(follow(film())):
        assert track.gaps == () and track.found[::3].all() and not track.found[1::3].any()
        assert error(track, hand)[::3].mean() < 0.003
        assert error(track, hand).max() < 0.010


def test_a_gap_is_bridged_and_reported():
    """Hidden for 0.3 s in the fastest part: the bridge errs by the acceleration it misses, a few centimetres."""
    hidden = (21, 24, 27)
    first, second = follow(film(hidden))
    (gap,) = first.gaps
    np.testing.assert_allclose(gap, (TIMES[18], TIMES[30]))
    assert not first.found[list(hidden)].any() and second.gaps == ()
    assert error(first, 0)[21:28].max() < 0.03
    np.testing.assert_allclose(first.positions[40:], follow(film())[0].positions[40:], atol=1e-3)


def test_a_hand_that_leaves_rests():
    """It is not found again: the gap goes to the end, and it stays where it was seen last."""
    gone = tuple(range(45, len(TIMES), 3))
    track = follow(film(gone))[0]
    assert track.gaps == ((TIMES[42], TIMES[57]),)
    assert (np.ptp(track.pixels[42:], axis=0) == 0.0).all()


def test_a_path_for_a_replay():
    """The track and when it held make a HandPath."""
    track = follow(film())[1]
    path = track.path(TIMES < 1.7)
    np.testing.assert_array_equal(path.positions, track.positions)
    assert path.holds == [(0.0, pytest.approx(1.7, abs=1 / 60))]


def test_a_height_for_all():
    """One number stands for all frames; balls that stay on a plane are found on it."""
    camera, start = make_camera(), np.array([[0.0, -0.1, TOP], [0.0, 0.1, TOP]])
    images = {k: draw(camera, start + np.array((0.002 * k, 0.0, 0.0))) for k in range(0, 30, 3)}
    for hand, track in enumerate(follow(images, frame_times=TIMES[:30], start=start, heights=TOP)):
        np.testing.assert_allclose(track.positions[27], start[hand] + (0.054, 0.0, 0.0), atol=0.006)  # a pixel


BAD = {
    "times": (dict(frame_times=TIMES[::-1]), "increase"),
    "start": (dict(start=[[0.0, np.nan, 0.0]]), "finite"),
    "start out of the image": (dict(start=[[0.0, 9.0, TOP]], heights=TOP), "not in the first image"),
    "heights": (dict(heights=TIMES[:4]), "heights"),
    "radius": (dict(radius=0.0), "radius"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_named(name):
    """What cannot be used is said."""
    changes, words = BAD[name]
    with pytest.raises(InvalidInputError, match=words):
        follow(film(), **changes)


def test_the_first_frame_is_needed():
    """It shows what the hands look like."""
    images = film()
    del images[0]
    with pytest.raises(InvalidInputError, match="first frame"):
        follow(images)
