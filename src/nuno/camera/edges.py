"""Subpixel edges: the border of a region along a straight side, to a fraction of a pixel."""

from __future__ import annotations

import cv2
import numpy as np

from nuno.camera.camera import Camera

_REACH = 6.0  # [px] how far to each side of the line a profile goes
_STEP = 0.25  # [px] between samples of a profile
_BORDER = 2.0  # [px] nearer to the image's border there is no edge to be measured


def side_pixels(
    start: np.ndarray, end: np.ndarray, camera: Camera, height: float, ends: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points along a side of a rectangle, about one for every two pixels, where the image shows them.

    Args:
        start: (2,) float, x and y of one end on the plane [m].
        end: (2,) float, the other end, anticlockwise around the rectangle seen from above.
        camera: The camera.
        height: The plane's z [m].
        ends: Fraction of the side to leave out at either end.

    Returns:
        Pixels (k, 2), unit normals outward in the image (k, 2), and whether each lies within the image (k,)
        bool.
    """
    corners = camera.project(np.array([[*start, height], [*end, height]]))
    length = float(np.linalg.norm(corners[1] - corners[0])) if np.isfinite(corners).all() else 400.0
    count = int(np.clip(length / 2, 12, 300))
    at = np.linspace(ends, 1.0 - ends, count)[:, None]
    ground = np.asarray(start) + at * (np.asarray(end) - np.asarray(start))
    pixels = camera.project(np.column_stack([ground, np.full(count, height)]))
    tangent = np.gradient(pixels, axis=0)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    outward = np.array([end[1] - start[1], start[0] - end[0]])
    outward = outward / np.linalg.norm(outward) * 1e-3
    step = camera.project(np.column_stack([ground + outward, np.full(count, height)])) - pixels
    normal *= np.where((step * normal).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    size = np.array([camera.width, camera.height])
    with np.errstate(invalid="ignore"):
        seen = np.all((pixels > _BORDER) & (pixels < size - 1 - _BORDER), axis=1)
    return pixels, normal, np.asarray(seen)


def _profiles(image: np.ndarray, pixels: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Offsets (m,) and image values (k, m, channels) along the normals."""
    offsets = np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    if not len(pixels):
        return offsets, np.empty((0, len(offsets), 1 if image.ndim == 2 else image.shape[2]), dtype=image.dtype)
    at = (pixels[:, None] + offsets[None, :, None] * normals[:, None]).astype(np.float32)
    values = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return offsets, values.reshape(len(pixels), len(offsets), -1)


def _crossing(offsets: np.ndarray, level: np.ndarray, within: float) -> np.ndarray:
    """Offset (k,) of the fall through 0.5 that is nearest to 0, NaN where there is none within reach."""
    falls = (level[:, :-1] >= 0.5) & (level[:, 1:] < 0.5)
    drop = np.maximum(level[:, :-1] - level[:, 1:], 1e-6)
    where = offsets[:-1] + (level[:, :-1] - 0.5) / drop * _STEP
    where = np.where(falls & (np.abs(where) <= within), where, np.inf)
    best = where[np.arange(len(where)), np.abs(where).argmin(axis=1)]
    return np.where(np.isfinite(best), best, np.nan)


def edge_in_mask(mask: np.ndarray, pixels: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Edge of a slightly blurred mask near a line.

    Args:
        mask: (h, w) float32, 1 inside and 0 outside, blurred: its level 0.5 is the edge without the half
            pixel by which the outermost pixel centres lie inside.
        pixels: (k, 2) float, points of the line.
        normals: (k, 2) float, outward.

    Returns:
        (k, 2) float, the edge points; NaN where there is none within reach.
    """
    offsets, values = _profiles(mask, pixels, normals)
    return pixels + _crossing(offsets, values[..., 0], _REACH)[:, None] * normals


def edge_in_image(image: np.ndarray, pixels: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Edge between the colours inside and outside of a line that is within about 2 px of it.

    Along each normal the colours are projected on the difference between inside and outside; the edge is
    where half of the way is gone. A symmetric blur does not move that point.

    Args:
        image: (h, w, 3) float32.
        pixels: (k, 2) float, points of the line.
        normals: (k, 2) float, outward.

    Returns:
        (k, 2) float, the edge points; NaN where the colours are too alike or there is no edge within 2 px.
    """
    offsets, values = _profiles(image, pixels, normals)
    inner = (offsets >= -3.5) & (offsets <= -1.75)
    outer = (offsets <= 3.5) & (offsets >= 1.75)
    # The mean over neighbours along the side halves the noise; texture across the side stays.
    inside = cv2.blur(values[:, inner].mean(axis=1), (1, 5), borderType=cv2.BORDER_REPLICATE).reshape(-1, 3)
    outside = cv2.blur(values[:, outer].mean(axis=1), (1, 5), borderType=cv2.BORDER_REPLICATE).reshape(-1, 3)
    difference = inside - outside
    contrast = (difference**2).sum(axis=1)
    level = ((values - outside[:, None]) * difference[:, None]).sum(axis=-1) / np.maximum(contrast, 1.0)[:, None]
    offset = _crossing(offsets, level, 2.0)
    offset[contrast < 12.0**2] = np.nan  # four times a camera's noise
    return pixels + offset[:, None] * normals
