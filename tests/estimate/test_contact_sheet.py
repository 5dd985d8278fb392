"""The picture of an estimate: a panel of its own for every candidate, within the sheet, however candidates lie."""

from types import SimpleNamespace

import numpy as np
import pytest

import nuno
from nuno.estimate.contact_sheet import BEST, BOTH, IMAGINED, REAL, contact_sheet, panel_boxes

POSE = np.array([[0, -0.5, 0.5, 0], [-1, 0, 0, 0], [0, -0.5, -0.5, 1], [0, 0, 0, 1]], dtype=float)
POSE[:3, 1:3] *= np.sqrt(2.0)  # looks 45 degrees down


def estimate(grid, labels, images=True):
    """What the sheet shows of an estimate: a seen square, and imagined ones, four of five moved to the right."""
    camera = nuno.Camera(320, 240, 250.0, 250.0, 159.5, 119.5, POSE)
    masks = np.zeros((len(labels), 60, 80), bool)
    for k in range(len(labels)):
        masks[k, 20:40, 20 + 4 * (k % 5) : 40 + 4 * (k % 5)] = True
    corners = np.array([(0.8, 0.2, 0), (0.8, -0.2, 0), (1.2, -0.2, 0), (1.2, 0.2, 0)])
    image = np.full((240, 320, 3), 90, np.uint8) if images else None
    seen = np.zeros((240, 320), bool)
    seen[80:160, 80:160] = True
    shares = np.asarray(labels, dtype=float) / (np.array(grid) - 1 if np.issubdtype(labels.dtype, np.integer) else 1)
    return SimpleNamespace(
        grid=grid, labels=labels, masks=masks, real=SimpleNamespace(mask=masks[0]), order=np.arange(len(labels)),
        scores=-np.arange(len(labels), dtype=float), eq1=np.ones(len(labels)), best=tuple(labels[0]), by_position=False,
        confidence=0.9, turn=0.3, score_name="iou", fractions=shares, camera=camera, image_before=image,
        image_after=image, mask_before=seen if images else None, mask_after=seen,
        rectangle=SimpleNamespace(corners=corners, long_m=0.4, short_m=0.4),
    )  # fmt: skip


def grid_labels(n, m):
    """All (i, j) of a grid."""
    return np.stack(np.meshgrid(np.arange(n), np.arange(m)), axis=-1).reshape(-1, 2)


RESULTS = {
    "a grid": ((6, 5), grid_labels(6, 5)),
    "two by two": ((2, 2), grid_labels(2, 2)),
    "many columns": ((12, 2), grid_labels(12, 2)),
    "five points": ((2, 2), np.random.default_rng(0).uniform(size=(5, 2))),
}


@pytest.mark.parametrize("name", RESULTS)
def test_every_candidate_has_a_panel(name):
    """Panels are within the sheet and apart, and the middle of each shows what its masks say of that point."""
    result = estimate(*RESULTS[name])
    sheet, boxes = contact_sheet(result), panel_boxes(result)
    covered = np.zeros(sheet.shape[:2], int)
    for k, (x, y, w, h) in enumerate(boxes):
        assert x >= 0 and y >= 0 and x + w <= sheet.shape[1] and y + h <= sheet.shape[0]
        covered[y : y + h, x : x + w] += 1
        panel = sheet[y : y + h, x : x + w].reshape(-1, 3).tolist()
        assert list(BOTH) in panel  # 20 columns of each square, of which at most 16 are beside the seen one
        assert (list(IMAGINED) in panel) == (list(REAL) in panel) == (k % 5 > 0)
    assert covered.max() == 1
    x, y, w, _ = boxes[0]
    assert tuple(sheet[y - 2, x + w // 2]) == BEST


def test_without_images():
    """Where only masks were given, the cloth is drawn as a mask."""
    result = estimate(*RESULTS["two by two"], images=False)
    sheet = contact_sheet(result)
    assert sheet.dtype == np.uint8 and (sheet == 200).all(axis=-1).any()  # the mask after is that grey
