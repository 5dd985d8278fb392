"""Regions of an image: growing, filling, choosing parts, and sharpening an outline."""

from __future__ import annotations

import cv2
import numpy as np


def _disc(radius: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def grow(mask: np.ndarray, radius: int) -> np.ndarray:
    """The mask (h, w) bool and what is within a radius [px] of it."""
    return cv2.dilate(mask.astype(np.uint8), _disc(radius)).astype(bool)


def shrink(mask: np.ndarray, radius: int) -> np.ndarray:
    """Return what of the mask (h, w) bool is farther than a radius [px] from its outside."""
    return cv2.erode(mask.astype(np.uint8), _disc(radius)).astype(bool)


def fill_holes(mask: np.ndarray) -> np.ndarray:
    """The mask (h, w) bool with all that it encloses."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(mask.shape, dtype=np.uint8)
    cv2.drawContours(filled, contours, -1, 1, thickness=cv2.FILLED)
    return filled.astype(bool)


def fill_doubtful_holes(mask: np.ndarray, score: np.ndarray, *, area: int, doubt: float) -> np.ndarray:
    """Fill the holes that are small, or whose mean score is not clearly against the mask.

    Args:
        mask: (h, w) bool.
        score: (h, w) float, how much speaks for the mask.
        area: Holes up to this size [px] are filled.
        doubt: So are those whose mean score is above minus this.

    Returns:
        (h, w) bool.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats((~mask).astype(np.uint8), connectivity=4)
    rim = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    sizes = stats[:, cv2.CC_STAT_AREA]
    mean = np.bincount(labels.ravel(), weights=score.ravel(), minlength=count) / np.maximum(sizes, 1)
    closed = (sizes <= area) | (mean > -doubt)
    closed[rim] = False
    closed[0] = False  # the mask itself
    return mask | closed[labels]


def parts_at(found: np.ndarray, score: np.ndarray, anchor: np.ndarray, pixel: np.ndarray) -> np.ndarray:
    """The part of a region that holds on to an anchor, and other parts with little doubt about them.

    Args:
        found: (h, w) bool, the region.
        score: (h, w) float, how much speaks for each pixel of it.
        anchor: (h, w) bool, what joins parts that touch it (the hand occludes the middle of a cloth); may be
            empty.
        pixel: (2,) float, u and v of the anchor's middle, also if it is out of the image.

    Returns:
        (h, w) bool.
    """
    joined = (found | anchor).astype(np.uint8)
    count, labels = cv2.connectedComponents(joined, connectivity=8)
    if count < 2:
        return np.zeros_like(found)
    rows, columns = np.nonzero(found)
    owner = labels[rows, columns]
    away = np.hypot(columns - pixel[0], rows - pixel[1])
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, owner, away)
    nearest = np.maximum(nearest - (np.sqrt(anchor.sum() / np.pi) + 2.0), 0.0)
    area = np.bincount(owner, minlength=count).astype(float)
    mean = np.bincount(owner, weights=score[rows, columns], minlength=count) / np.maximum(area, 1.0)
    with np.errstate(invalid="ignore"):
        weight = np.where(area > 0, area * np.maximum(mean, 0.1) / (1.0 + nearest / 10.0) ** 2, 0.0)
    main = int(weight.argmax())
    keep = (mean > 3.5) & (area > max(30.0, 0.01 * area[main]))
    keep[main] = True
    keep[0] = False
    return found & keep[labels]


def sharpen(mask: np.ndarray, image: np.ndarray, noise: float) -> np.ndarray:
    """Decide the pixels along the outline anew: are they more like the inside or the outside near them?

    A pixel on an outline shows a mixture that may look like anything (between a dark and a light grey lies
    every grey); but it is on the mixing line of its two neighbours, and past the middle it is the other
    one's.

    Args:
        mask: (h, w) bool.
        image: (h, w, 3) float32.
        noise: Standard deviation of a channel [levels].

    Returns:
        (h, w) bool.
    """
    inner, outer = shrink(mask, 2), ~grow(mask, 2)
    if not inner.any() or not outer.any():
        return mask
    band = grow(mask, 1) & ~shrink(mask, 1)
    inside, near_inside = _nearest(image, inner, band)
    outside, near_outside = _nearest(image, outer, band)
    difference = inside - outside
    contrast = (difference**2).sum(axis=-1)
    share = ((image[band] - outside) * difference).sum(axis=-1) / np.maximum(contrast, 1e-6)
    certain = (contrast > (5.0 * noise) ** 2) & (near_inside < 4.5) & (near_outside < 4.5)
    result = mask.copy()
    result[band] = np.where(certain, share > 0.5, mask[band])
    return result


def _nearest(image: np.ndarray, region: np.ndarray, where: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Colour (k, 3) of the region's pixel nearest to each pixel of ``where``, and its distance (k,)."""
    distance, labels = cv2.distanceTransformWithLabels(
        (~region).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    colours = np.zeros((int(labels.max()) + 1, 3), dtype=np.float32)
    colours[labels[region]] = image[region]
    return colours[labels[where]], distance[where]
