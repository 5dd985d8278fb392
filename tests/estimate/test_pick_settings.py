"""Settings and images of an estimate of a pick, checked before anything is imagined."""

import cv2
import numpy as np
import pytest

import nuno
from nuno.estimate.hypotheses import DISCRETISATIONS
from nuno.estimate.pick_images import find_cloth_before, read_images
from nuno.estimate.pick_settings import check_settings, check_table

LOOKING_DOWN = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]], float)
CAMERA = nuno.Camera(64, 48, 60.0, 60.0, 31.5, 23.5, camera_to_world=LOOKING_DOWN)


def settings(**changes):
    """Settings of a pick over an endless table at z = 0, with changes."""
    given = dict(
        camera=CAMERA, table=check_table(0.0, None, None, 0.04), hand=(0.0, 0.0, 0.2), candidates=(3, 2),
        discretisations=DISCRETISATIONS, turns=(0.0, 0.1), score="evidence", device="cpu", rest_height=0.0025,
        hand_radius=0.014, lift_seconds=1.5, sure=0.98, sideways=0.5, learned=True, progress=False,
    )  # fmt: skip
    return check_settings(**given | changes)


def test_a_grid_names_its_candidates():
    """A grid of 3 x 2 has labels (i, j) and fractions i / 2, j / 1 of the sides; points are their own labels."""
    found = settings()
    assert found.labels.tolist() == [[0, 0], [0, 1], [1, 0], [1, 1], [2, 0], [2, 1]]
    np.testing.assert_array_equal(found.uv, found.labels / (2, 1))
    for same in ([3, 2], (np.int64(3), np.int32(2))):
        np.testing.assert_array_equal(settings(candidates=same).labels, found.labels)
    points = settings(candidates=[[0.25, 1.0]])
    assert points.labels.tolist() == points.uv.tolist() == [[0.25, 1.0]] and points.grid == (2, 2)


def test_scores_without_evidence_are_not_turned():
    """Only evidence is averaged over angles; the others are compared at 0 alone."""
    assert settings().turns.tolist() == [0.0, 0.1] and settings().with_evidence
    iou = settings(score="iou")
    assert iou.turns.tolist() == [0.0] and not iou.with_evidence


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(score="best"), "score must be one of evidence, silhouette, chamfer, iou, eq1, got 'best'"),
        (dict(hand=(0.0, 0.0, -0.1)), "below the table's top"),
        (dict(hand=(2.0, 0.0, 2.0)), "behind the camera"),
        (dict(candidates=(1, 4)), "at least 2 x 2"),
        (dict(candidates=[1, 4]), "at least 2 x 2"),
        (dict(rest_height=2.5), "rest_height"),
        (dict(hand_radius=14.0), "hand_radius"),
        (dict(turns=(0.1,)), "0 among them"),
        (dict(discretisations=()), "must begin with one that looks at all candidates"),
    ],
)
def test_bad_settings_are_named(changes, message):
    """A setting that cannot be used is refused, with what is valid."""
    with pytest.raises(nuno.InvalidInputError, match=message):
        settings(**changes)


def test_images_that_are_needed_are_asked_for():
    """Without an image before, a mask or a rectangle nothing can be found; two images that are the same are no pick."""
    image = np.zeros((48, 64, 3), np.uint8)
    with pytest.raises(nuno.InvalidInputError, match="nothing was picked up"):
        read_images(image, image.copy(), None, None, None, CAMERA)
    nothing = read_images(None, image, None, None, None, CAMERA)
    with pytest.raises(nuno.InvalidInputError, match="the image before is needed"):
        find_cloth_before(nothing, None, None, settings())


@pytest.mark.parametrize(("end", "told"), [(0.20, False), (0.29, False), (0.30, True), (0.36, True)])
def test_a_cloth_over_the_border_of_its_table_is_told(end, told):
    """Of a cloth that reaches beyond the border at x = 0.3 m the rest is not seen: its length is too short."""
    camera = nuno.Camera(640, 480, 600.0, 600.0, 319.5, 239.5, camera_to_world=LOOKING_DOWN)
    table = check_table(0.0, (0.3, 0.3), None, 0.04)
    corners = np.array([[-0.1, -0.1, 0], [end, -0.1, 0], [end, 0.12, 0], [-0.1, 0.12, 0]])
    shown = np.minimum(corners, [0.3, 0.3, 0.0])  # as segmentation sees it
    mask = np.zeros((480, 640), np.uint8)
    cv2.fillConvexPoly(mask, np.round(camera.project(shown)).astype(np.int32), 1)
    images = read_images(None, None, mask.astype(bool), mask.astype(bool), None, camera)
    _, found = find_cloth_before(images, None, None, settings(camera=camera, table=table))
    assert any("table's border" in warning for warning in found.warnings) == told
