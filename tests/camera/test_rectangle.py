"""The rectangle of a flat cloth: corners, labels, grid points, warnings."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest
from synthetic import LOOKS, REST_HEIGHT, Pair, look_at, make_pair

from few_variants import few
from nuno.camera.camera import Camera
from nuno.camera.cloth_outline import fit_outline
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.camera.segmentation import segment_before
from nuno.camera.table import plane_coordinates
from nuno.errors import ClothNotFoundError, EstimationError, InvalidInputError

HEIGHT = 0.7025
BESIDE = look_at(np.array([-0.8, 0.1, 1.35]), np.array([0.1, 0.0, 0.72]), 520.0)


def corners_of(centre: tuple[float, float], size: tuple[float, float], yaw: float) -> np.ndarray:
    """(4, 3) float, anticlockwise."""
    c, s = np.cos(yaw), np.sin(yaw)
    local = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * np.array(size)
    return np.column_stack([local @ np.array([[c, s], [-s, c]]) + centre, np.full(4, HEIGHT)])


def picture(camera: Camera, inside: np.ndarray) -> np.ndarray:
    """A plain image of a mask: red on grey, with the blur of a lens."""
    image = np.where(inside[..., None], (190.0, 60.0, 50.0), (130.0, 132.0, 135.0)).astype(np.float32)
    return cv2.GaussianBlur(image, (0, 0), 0.5).round().astype(np.uint8)


def draw(camera: Camera, centre, size, yaw) -> tuple[np.ndarray, np.ndarray]:
    """Exact mask (pixel centres on the rectangle) and image of a rectangle."""
    xy = np.nan_to_num(plane_coordinates(camera, HEIGHT), nan=1e6) - centre
    c, s = np.cos(yaw), np.sin(yaw)
    local = np.stack([xy @ (c, s), xy @ (-s, c)], axis=-1)
    inside = (np.abs(local) <= 0.5 * np.array(size)).all(axis=-1)
    return inside, picture(camera, inside)


def farthest(found: ClothRectangle, true: np.ndarray) -> float:
    """Largest distance [m] of a corner from the true one, whatever the labels."""
    return float(np.linalg.norm(found.corners[:, None] - true[None], axis=-1).min(axis=1).max())


def expected_labels(camera: Camera, true: np.ndarray) -> np.ndarray:
    """The label rule, said once more and by brute force: over all orders of the corners."""
    for order in itertools.permutations(range(4)):
        c00, ci, opposite, cj = true[list(order)]
        is_cycle = np.allclose(c00 + opposite, ci + cj)
        nearest = np.linalg.norm(camera.project(true), axis=1).min()
        if is_cycle and np.linalg.norm(camera.project(c00)) == nearest:
            if np.linalg.norm(ci - c00) > np.linalg.norm(cj - c00):
                return true[list(order)]
    raise AssertionError("no order fits")


@pytest.mark.parametrize("yaw", np.deg2rad([0, 17, 45, 63, 90, 118, 150]))
def test_corners_and_labels(yaw: float) -> None:
    """Corners are right to a fraction of a pixel, and in the order of the rule, at any yaw."""
    size, centre = (0.5, 0.36), (0.12, -0.05)
    mask, image = draw(BESIDE, centre, size, yaw)
    found = fit_rectangle(mask, image, BESIDE, HEIGHT)
    true = expected_labels(BESIDE, corners_of(centre, size, yaw))
    # A pixel is 1.7 to 3 mm on the plane; the edges are drawn without noise but to whole pixels.
    assert np.linalg.norm(found.corners - true, axis=1).max() < 0.0008
    assert abs(found.long_m - 0.5) < 0.0008 and abs(found.short_m - 0.36) < 0.0008
    assert np.allclose(found.centre, [*centre, HEIGHT], atol=0.0005)
    along = true[1] - true[0]
    assert abs(np.angle(np.exp(1j * (found.yaw - np.arctan2(along[1], along[0]))))) < 0.002
    assert found.residual < 0.3 and found.warnings == ()


def test_both_hands_occur() -> None:
    """Seen from above, the grid's axes may be right or left handed: the label rule does not know."""
    signs = set()
    for yaw in np.deg2rad([10, 40, 100, 130]):
        mask, image = draw(BESIDE, (0.12, 0.0), (0.5, 0.36), yaw)
        corners = fit_rectangle(mask, image, BESIDE, HEIGHT).corners
        signs.add(float(np.sign(np.cross(corners[1] - corners[0], corners[3] - corners[0])[2])))
    assert signs == {1.0, -1.0}


def test_mask_alone_is_unbiased() -> None:
    """With an image that shows no edge, the mask's half pixel does not make the cloth smaller."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.3)
    found = fit_rectangle(mask, np.full_like(image, 128), BESIDE, HEIGHT)
    # Half a pixel all around would be 2 mm or more of each side.
    assert abs(found.long_m - 0.5) < 0.0008 and abs(found.short_m - 0.36) < 0.0008


def test_the_cloths_own_shadow_is_left_out() -> None:
    """A shadow 4 mm wide along one side, in the mask as in the image, moves no corner."""
    size, yaw = (0.5, 0.35), 0.3
    wide, _ = draw(BESIDE, (0.1, 0.0), (size[0] + 0.004, size[1]), yaw)
    middle = (0.1 + 0.002 * np.cos(yaw), 0.002 * np.sin(yaw))
    cloth, _ = draw(BESIDE, middle, size, yaw)
    image = np.where(wide[..., None], 0.45 * np.array([130.0, 132.0, 135.0]), (130.0, 132.0, 135.0))
    image = np.where(cloth[..., None], (190.0, 60.0, 50.0), image).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), 0.5).round().astype(np.uint8)
    true = corners_of(middle, size, yaw)
    assert farthest(fit_rectangle(wide, None, BESIDE, HEIGHT), true) > 0.003
    # Half a pixel, which is 2 to 4 mm here.
    assert farthest(fit_rectangle(wide, image, BESIDE, HEIGHT), true) < 0.0015


def test_ragged_mask_is_mended() -> None:
    """A mask that bites into the cloth and juts out at places is corrected by the image's edges."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.3)
    rng = np.random.default_rng(3)
    ragged = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 2.0) > 0.5 + 0.25 * cv2.GaussianBlur(
        rng.normal(0, 6, mask.shape).astype(np.float32), (0, 0), 3.0
    )
    found = fit_rectangle(ragged, image, BESIDE, HEIGHT)
    assert farthest(found, corners_of((0.1, 0.0), (0.5, 0.36), 0.3)) < 0.001


def test_lens_distortion() -> None:
    """Sides that a lens bends are straight on the plane."""
    camera = Camera(640, 480, 520.0, 520.0, 319.5, 239.5, BESIDE.camera_to_world, np.array([-0.12, 0.02, 0.0, 0.0]))
    mask, image = draw(camera, (0.1, 0.0), (0.5, 0.36), 0.4)
    found = fit_rectangle(mask, image, camera, HEIGHT)
    assert farthest(found, corners_of((0.1, 0.0), (0.5, 0.36), 0.4)) < 0.001
    assert found.warnings == ()


@pytest.mark.parametrize("number", few([0, 3, 6, 8, 9, 14], 3, 9))
def test_corners_from_segmented_images(number: int) -> None:
    """From a noisy image to the corners: within 3 mm on average and 6 mm at worst."""
    scene: Pair = make_pair(LOOKS[number], 900 + number, lift=False)
    mask = segment_before(scene.before, scene.camera, scene.table)
    found = fit_rectangle(mask, scene.before, scene.camera, scene.table.height + REST_HEIGHT)
    away = np.linalg.norm(found.corners[:, None] - scene.corners[None], axis=-1).min(axis=1)
    assert away.mean() < 0.003 and away.max() < 0.006
    assert abs(found.long_m / scene.size[0] - 1) < 0.02 and abs(found.short_m / scene.size[1] - 1) < 0.02


def test_square_goes_clockwise() -> None:
    """Sides within 2 %: CI is the next corner clockwise in the image, with a warning."""
    sizes, yaws = [(0.40, 0.40), (0.403, 0.40), (0.40, 0.403)], np.deg2rad([5, 30, 60, 85])
    for size, yaw in itertools.product(sizes, yaws):
        mask, image = draw(BESIDE, (0.1, 0.0), size, yaw)
        found = fit_rectangle(mask, image, BESIDE, HEIGHT)
        pixels = BESIDE.project(found.corners)
        a, b = pixels[1] - pixels[0], pixels[2] - pixels[0]
        # With y down, a positive cross product is a clockwise turn to the eye.
        assert a[0] * b[1] - a[1] * b[0] > 0
        assert np.linalg.norm(pixels, axis=1).argmin() == 0
        assert any("2 %" in warning for warning in found.warnings)


def test_nearly_square_keeps_the_longer_side() -> None:
    """Sides 4 % apart are told apart, without a warning."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.416, 0.40), 0.5)
    found = fit_rectangle(mask, image, BESIDE, HEIGHT)
    assert abs(found.long_m - 0.416) < 0.001 and abs(found.short_m - 0.40) < 0.001 and found.warnings == ()


def test_cut_corner_warns() -> None:
    """A corner outside of the image is where the sides meet, with a warning."""
    mask, image = draw(BESIDE, (0.15, 0.46), (0.5, 0.36), 0.5)
    assert mask[:, 0].any(), "the scene was to be cut off at the left"
    found = fit_rectangle(mask, image, BESIDE, HEIGHT)
    assert any("cuts" in warning for warning in found.warnings)
    assert farthest(found, corners_of((0.15, 0.46), (0.5, 0.36), 0.5)) < 0.0008


def test_cut_side_fails() -> None:
    """A cloth with a whole side outside of the image has no known length: a named error."""
    mask, image = draw(BESIDE, (0.1, 0.62), (0.36, 0.9), 0.0)
    with pytest.raises(EstimationError):
        fit_rectangle(mask, image, BESIDE, HEIGHT)


def test_other_shapes() -> None:
    """A disc or a triangle is no cloth laid out flat; a torn corner only warns."""
    xy = np.nan_to_num(plane_coordinates(BESIDE, HEIGHT), nan=1e6)
    disc = np.linalg.norm(xy - (0.1, 0.0), axis=-1) < 0.2
    triangle = (np.abs(xy[..., 1]) < 0.3 * (xy[..., 0] + 0.2)) & (xy[..., 0] < 0.3)
    for shape in (disc, triangle):
        with pytest.raises(EstimationError):
            fit_rectangle(shape, picture(BESIDE, shape), BESIDE, HEIGHT)
    mask, _ = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.0)
    torn = mask & ~((xy[..., 0] < -0.02) & (xy[..., 1] > 0.06))
    found = fit_rectangle(torn, picture(BESIDE, torn), BESIDE, HEIGHT)
    assert any("not quite" in warning for warning in found.warnings)


def test_millimetres_are_named() -> None:
    """A camera and a plane in millimetres make a cloth of 600 m, which is refused as one, and as an outline."""
    mask, _ = draw(BESIDE, (0.1, 0.0), (0.6, 0.4), 0.3)
    pose = BESIDE.camera_to_world.copy()
    pose[:3, 3] *= 1000.0
    camera = replace(BESIDE, camera_to_world=pose)
    for fit in (partial(fit_rectangle, mask, None), partial(fit_outline, mask)):
        with pytest.raises(InvalidInputError, match="in metres"):
            fit(camera, 1000.0 * HEIGHT)


def test_empty_and_tiny_masks() -> None:
    """An empty mask and one of a few pixels are named errors."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.0)
    with pytest.raises(ClothNotFoundError):
        fit_rectangle(np.zeros_like(mask), image, BESIDE, HEIGHT)
    tiny = np.zeros_like(mask)
    tiny[240:242, 320:322] = True
    with pytest.raises(EstimationError):
        fit_rectangle(tiny, image, BESIDE, HEIGHT)


def test_plane_behind_the_camera() -> None:
    """A plane that the cloth's pixels do not meet is refused."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.0)
    with pytest.raises(InvalidInputError):
        fit_rectangle(mask, image, BESIDE, 3.0)


def test_grid_points() -> None:
    """The grid is the rule's formula, with its corners at the cloth's."""
    mask, image = draw(BESIDE, (0.1, 0.0), (0.5, 0.36), 0.3)
    found = fit_rectangle(mask, image, BESIDE, HEIGHT)
    grid = found.grid_points(6, 4)
    assert grid.shape == (6, 4, 3)
    c00, ci, opposite, cj = found.corners
    for i, j in itertools.product(range(6), range(4)):
        assert np.allclose(grid[i, j], c00 + i / 5 * (ci - c00) + j / 3 * (cj - c00), atol=1e-12)
    assert np.allclose(grid[5, 3], opposite, atol=1e-9)
    fractions = np.stack(np.meshgrid(np.arange(6) / 5, np.arange(4) / 3, indexing="ij"), axis=-1)
    assert np.allclose(found.fractions(grid + np.array((0.0, 0.0, 0.3))), fractions, atol=1e-9)  # also above the plane
    with pytest.raises(InvalidInputError):
        found.grid_points(1, 6)
