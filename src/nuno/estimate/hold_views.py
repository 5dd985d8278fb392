"""Hanging garments as cameras see them, at all turns about the vertical, compared with what they do see.

A garment that hangs free may have turned any way. All cameras see the same turn, which is why two of them can tell a
garment from its mirror image, and one cannot: seen from the side, a turned garment and its mirror image at the opposite
turn have the same silhouette but for perspective.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.extent import regions_of
from nuno.camera.image_region import Region, view
from nuno.errors import ImageError
from nuno.estimate.futures import DRAWN_THICKNESS
from nuno.estimate.imagined_holds import Holds
from nuno.estimate.ranking import CONTOUR_WEIGHT, OVERLAP_WEIGHT
from nuno.estimate.rotations import turn, view_of_turned
from nuno.estimate.similarity import Silhouette, begin_scores

WIDTH = 200
"""[px] of the images that are compared: hanging folds are not known finer."""
FULL_WIDTH = 640
"""[px] of the image in whose pixels distances of outlines count, as `nuno.estimate.ranking` weighs them."""
BATCH = 512
"""Garments that are drawn at once."""
MARGIN = 3
"""[px] around a garment's vertices, which is drawn thicker than they tell."""
HAND_MARGIN = 2
"""[px] of the full image around the hand that count neither as garment nor as background."""
ALIKE = 8.0
"""Distance of colours (0 to 255) up to which they are alike."""
SHADE = (0.2, 0.95)
"""Shares of the light that a shadow leaves."""
OF_ITS_TINT = 0.7
"""Share of what differs that is darker background from which on this is the garment, and not its shadow."""


@dataclass(frozen=True, eq=False)
class HoldView:
    """The image of a garment that one camera sees.

    Attributes:
        camera: The camera, its image reduced.
        real: The silhouette there.
        mask: (h, w) bool, the whole image's.
        full: The camera of the whole image.
    """

    camera: Camera
    real: Silhouette
    mask: np.ndarray
    full: Camera


def hold_view(
    mask: np.ndarray, camera: Camera, hand: np.ndarray, hand_radius: float, hidden: np.ndarray | None
) -> HoldView:
    """Prepare a mask (h, w) for comparison, with the pixels around the hand and hidden ones (h, w) left out.

    Raises:
        ImageError: nothing of the garment is left.
    """
    import cv2

    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centre = camera.project(hand)
    reach = hand_radius * max(camera.fx, camera.fy) / camera.depth_of(hand) + HAND_MARGIN
    ignored = (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= reach**2
    if hidden is not None:
        ignored |= hidden
    if not (mask & ~ignored).any():
        raise ImageError("the mask is empty but for the hand, so there is no garment to compare with")
    small = camera.scaled(min(1.0, WIDTH / camera.width))

    def shrink(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), (small.width, small.height), interpolation=cv2.INTER_AREA)

    return HoldView(small, Silhouette(shrink(mask & ~ignored) >= 0.5, shrink(ignored) > 0.25), mask, camera)


def compare_holds(holds: Holds, views: Sequence[HoldView], hand: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Compare every imagined garment at every turn with what all cameras see.

    Args:
        holds: The garment as it hangs from every candidate.
        views: What is seen.
        hand: (3,) the held point [m].
        turns: (t,) [rad].

    Returns:
        (turns, guesses, candidates) float, -log likelihood up to a constant, summed over the cameras: that of
        `nuno.estimate.ranking`, of silhouettes; infinite where a state is not finite.
    """
    guesses, count, n, _ = holds.positions.shape
    placed = (holds.positions.reshape(-1, n, 3) + hand.astype(np.float32)).astype(np.float32)
    faces: Any = wp.array(np.ascontiguousarray(holds.garment.faces, np.int32), dtype=wp.vec3i, device=holds.device)
    error = np.zeros((len(turns), guesses * count))
    for first in range(0, len(placed), BATCH):
        part = slice(first, min(first + BATCH, len(placed)))
        positions: Any = wp.array(np.nan_to_num(placed[part]), dtype=wp.vec3, device=holds.device)
        for seen in views:
            for k, angle in enumerate(turns):
                scores = _scores(positions, faces, seen, hand, float(angle))
                chamfer = scores["chamfer"] * (FULL_WIDTH / seen.camera.width)
                error[k, part] += CONTOUR_WEIGHT * np.log1p(chamfer) + OVERLAP_WEIGHT * (1.0 - scores["iou"])
    return np.where(holds.finite, error.reshape(len(turns), guesses, count), np.inf)


def _scores(
    positions: wp.array, faces: wp.array, seen: HoldView, hand: np.ndarray, angle: float
) -> dict[str, np.ndarray]:
    keys, region = _drawn(positions, faces, seen.camera, hand, angle)
    return begin_scores(keys, seen.real, region=region)()


def _drawn(
    positions: wp.array, faces: wp.array, camera: Camera, hand: np.ndarray, angle: float
) -> tuple[wp.array, Region]:
    device: Any = positions.device
    looking = view_of_turned(camera, hand, angle)
    (region,) = regions_of(positions, [looking], margin=MARGIN)
    keys = raster.key_images(positions.shape[0], region, device)
    raster.clear(keys)
    raster.draw(keys, positions, faces, view(looking, region), 0, thickness=DRAWN_THICKNESS)
    return keys, region


def hold_masks(
    holds: Holds, chosen: Sequence[tuple[int, int]], turns: Sequence[float], camera: Camera, hand: np.ndarray
) -> np.ndarray:
    """Return masks (k, h, w) bool of chosen (guess, candidate) pairs, each at a turn [rad] of its own."""
    moved = [turn(holds.positions[g, c] + hand, hand, a) for (g, c), a in zip(chosen, turns, strict=True)]
    positions: wp.array = wp.array(np.asarray(moved, np.float32), dtype=wp.vec3, device=holds.device)
    faces: wp.array = wp.array(np.ascontiguousarray(holds.garment.faces, np.int32), dtype=wp.vec3i, device=holds.device)
    keys, region = _drawn(positions, faces, camera, hand, 0.0)
    masks = np.zeros((len(chosen), camera.height, camera.width), dtype=bool)
    rows, columns = slice(region.y0, region.y0 + region.height), slice(region.x0, region.x0 + region.width)
    masks[:, rows, columns] = raster.masks_of(keys).numpy()
    return masks


def hold_mask(image: np.ndarray, background: np.ndarray, camera: Camera, hand: np.ndarray) -> np.ndarray:
    """Return (h, w) bool, the garment in an image: what differs from the image without it, in the hand's region.

    The limit between like and unlike is Otsu's. What has the background's tint and less light is the garment's shadow,
    unless most of what differs is so: then the garment has that tint.

    Args:
        image: (h, w, 3) uint8 RGB.
        background: (h, w, 3) uint8, the same without the garment.
        camera: The camera.
        hand: (3,) the held point [m].

    Raises:
        ImageError: nothing differs.
    """
    import cv2

    smooth, behind = (cv2.GaussianBlur(each, (0, 0), 1.0).astype(float) for each in (image, background))
    apart = np.linalg.norm(smooth - behind, axis=2)
    limit, _ = cv2.threshold(np.minimum(apart, 255).astype(np.uint8), 0, 255, cv2.THRESH_OTSU)
    differs = apart > max(limit, ALIKE)
    shaded = differs & _is_shaded(smooth, behind)
    if shaded.sum() < OF_ITS_TINT * differs.sum():
        differs &= ~shaded
    found = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    number, labels = cv2.connectedComponents(found, connectivity=8)
    if number < 2:
        raise ImageError("the image is like its background: no garment is seen")
    rows, columns = np.nonzero(labels)
    u, v = camera.project(hand)
    near = np.hypot(columns - u, rows - v).argmin()
    return np.asarray(labels == labels[rows[near], columns[near]])


def _is_shaded(image: np.ndarray, background: np.ndarray) -> np.ndarray:
    """Return (h, w) bool, where an image (h, w, 3) shows the background's colours in less light."""
    light = (image * background).sum(axis=2) / np.maximum((background**2).sum(axis=2), 1.0)
    apart = np.linalg.norm(image - np.clip(light, *SHADE)[..., None] * background, axis=2)
    return np.asarray(apart < ALIKE)
