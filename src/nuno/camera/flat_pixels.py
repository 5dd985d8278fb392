"""The pixels of a flat cloth whose region a first look has found (`nuno.camera.flat`)."""

from __future__ import annotations

import cv2
import numpy as np

from nuno.camera.flat import HELP, RECTANGLE, STEP
from nuno.camera.regions import fill_holes, grow, shrink
from nuno.camera.surface_colours import Illumination, colour_density, discriminant, guided_filter
from nuno.errors import ClothNotFoundError

_DOUBT = 1.0  # [nats] a bay in a flat cloth's outline is one only if the colours in it say so by more than this


def refine(rgb: np.ndarray, blob: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """Decide pixel by pixel what a first look found.

    Args:
        rgb: (h, w, 3) uint8.
        blob: (h // 4, w // 4) bool, the cloth roughly.
        surface: (h // 4, w // 4) bool, where the table may be seen.

    Returns:
        (h, w) bool.

    Raises:
        ClothNotFoundError: nothing, or much less, is left on the closer look.
    """
    h, w = rgb.shape[:2]
    full = (w // STEP * STEP, h // STEP * STEP)

    def enlarge(small: np.ndarray) -> np.ndarray:
        big = cv2.resize(small.astype(np.uint8), full, interpolation=cv2.INTER_NEAREST)
        return np.pad(big, ((0, h - full[1]), (0, w - full[0])), mode="edge").astype(bool)

    labels, table = enlarge(blob), enlarge(surface)
    rows, columns = np.flatnonzero(labels.any(axis=1)), np.flatnonzero(labels.any(axis=0))
    pad = 12 + int(0.15 * max(np.ptp(rows), np.ptp(columns)))
    crop = (
        slice(max(0, rows[0] - pad), min(h, rows[-1] + pad + 1)),
        slice(max(0, columns[0] - pad), min(w, columns[-1] + pad + 1)),
    )
    image = rgb[crop].astype(np.float32)
    labels, table = labels[crop], table[crop]
    # What lies beyond the table's edge is no cloth on it, whatever its colour; the surface ends a block short of it.
    on_table = grow(table, 4)
    for gap in (8, 4, 2):  # of a table that is mostly covered little is seen, and that close to the cloth
        around = (table if gap == 8 else on_table) & ~grow(labels, gap)
        if around.sum() >= 20:
            break
    else:
        raise ClothNotFoundError(f"no cloth: nothing of the table is seen beside what looks like one; {HELP}")
    # Divide by the light on the table: then one colour is one colour from end to end.
    step = image[::2, ::2]
    light = Illumination(step, around[::2, ::2].astype(float), full_shape=image.shape[:2], degree=1)
    field = light.field((slice(0, image.shape[0]), slice(0, image.shape[1])))
    image = np.clip(image / field * light.level(), 0, 255)
    inside = shrink(labels, 5) if shrink(labels, 5).sum() > 20 else labels
    for attempt in range(3):
        soft = cv2.GaussianBlur(image, (0, 0), 0.8)
        ratio = np.log(colour_density(soft[inside], soft) / colour_density(soft[around], soft))
        ratio = np.clip(ratio, -6, 6)
        guide = discriminant(soft, inside, around)
        score = guided_filter(ratio, guide, radius=4 if attempt < 2 else 3, epsilon=0.05)
        labels = _without_bays(_near((score > 0) & on_table, labels), score)
        inside, around = shrink(labels, 3), table & ~grow(labels, 4)
        if inside.sum() < 20 or around.sum() < 20:
            break
    if labels.sum() < 0.5 * blob.sum() * STEP**2:
        raise ClothNotFoundError(f"no cloth: what looked like one dissolved on a closer look; {HELP}")
    mask = np.zeros((h, w), dtype=bool)
    mask[crop] = labels
    return mask


def _without_bays(mask: np.ndarray, score: np.ndarray) -> np.ndarray:
    """A mask (h, w) bool with the bays of its outline filled about which its score (h, w) is in doubt.

    A flat rectangle has no bays: where a pattern meets the outline in the table's own colour, that decides.
    """
    width = int(0.06 * np.sqrt(mask.sum())) | 1
    ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    solid = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, ellipse)  # without spurs, which would be spanned
    contours, _ = cv2.findContours(solid, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return mask
    hull = np.zeros_like(solid)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.concatenate(contours)), 1)
    if mask.sum() < RECTANGLE * hull.sum():
        return mask
    # Bays of less than 5 px are the outline's own unevenness.
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    bays = cv2.morphologyEx(np.where(mask, np.uint8(0), hull), cv2.MORPH_OPEN, small)
    count, parts = cv2.connectedComponents(bays, connectivity=4)
    mean = np.bincount(parts.ravel(), weights=score.ravel(), minlength=count) / np.bincount(parts.ravel())
    closed = mean > -_DOUBT
    closed[0] = False
    if not closed.any():
        return mask
    filled = np.minimum(cv2.dilate(closed[parts].astype(np.uint8), small), hull)
    return fill_holes(mask | filled.astype(bool))


def _near(found: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """The part of what was found that overlaps the labels most, without holes and hairs."""
    opened = cv2.morphologyEx(
        found.astype(np.uint8), cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    )
    count, parts = cv2.connectedComponents(opened, connectivity=4)
    overlap = np.bincount(parts[labels], minlength=count)
    overlap[0] = 0
    return fill_holes(parts == overlap.argmax()) if overlap.any() else np.zeros_like(labels)
