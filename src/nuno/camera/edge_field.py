"""The edges of a picture by place and direction, whatever their contrast and colours."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

DIRECTIONS = 32
"""Directions of a step from dark to bright; edges of a side that runs in between are told less by 0.5 %."""
_SHARPNESS = 3  # power of the cosine between an edge's direction and the side's
_NOISE = 2.0  # gradients of so many standard deviations of the noise count half
_LOCAL = 0.5  # so do those of so much of what is usual near them, so that a loud pattern is no better than a faint edge


@dataclass(frozen=True, eq=False)
class EdgeField:
    """The steps of brightness or colour of an image, by direction.

    Attributes:
        maps: (`DIRECTIONS`, h, w) float32 in [0, 1], how much of a step each pixel shows that goes up in the direction
            2 pi k / `DIRECTIONS`, from x to y.
    """

    maps: np.ndarray

    def support(self, start: np.ndarray, end: np.ndarray, samples: int) -> np.ndarray:
        """Return how much of segments lies on edges that go up to one side all along: (...,) float32 in [0, 1].

        Args:
            start: (..., 2) float, x and y [px].
            end: (..., 2) float.
            samples: How many points of each are looked at; those outside of the image count 0.
        """
        start, along = np.asarray(start, dtype=np.float32), np.asarray(end - start, dtype=np.float32)
        turn = DIRECTIONS / (2.0 * np.pi)
        left = np.rint((np.arctan2(along[..., 1], along[..., 0]) + 0.5 * np.pi) * turn).astype(np.int32) % DIRECTIONS
        right = (left + DIRECTIONS // 2) % DIRECTIONS
        height, width = self.maps.shape[1:]
        flat, size = self.maps.reshape(-1), height * width
        left, right = left * size, right * size
        ups, downs = np.zeros(left.shape, dtype=np.float32), np.zeros(left.shape, dtype=np.float32)
        for share in (np.arange(samples, dtype=np.float32) + np.float32(0.5)) / np.float32(samples):
            x, y = (np.rint(start[..., k] + share * along[..., k]).astype(np.int32) for k in range(2))
            # the outermost pixels show no edges, so that what is farther out may be told by them
            at = np.clip(y, 0, height - 1) * width + np.clip(x, 0, width - 1)
            ups += flat.take(left + at)
            downs += flat.take(right + at)
        return np.maximum(ups, downs) / np.float32(samples)

    def widened(self, radius: int) -> EdgeField:
        """Return the field in which an edge is seen up to a radius [px] to both its sides, as coarse grids need it."""
        if radius < 1:
            return self
        widened = np.empty_like(self.maps)
        size = 2 * radius + 1
        for k in range(DIRECTIONS):
            angle = 2.0 * np.pi * k / DIRECTIONS
            line = np.zeros((size, size), dtype=np.uint8)
            reach = np.array([np.cos(angle), np.sin(angle)]) * radius
            a, b = np.round(radius - reach).astype(int), np.round(radius + reach).astype(int)
            cv2.line(line, (int(a[0]), int(a[1])), (int(b[0]), int(b[1])), 1)
            widened[k] = cv2.dilate(self.maps[k], line)
        _without_rim(widened)
        return EdgeField(widened)


def edge_field(image: np.ndarray, seen: np.ndarray, blur: float = 1.0) -> EdgeField:
    """Return an image's edges.

    Of each pixel that channel counts whose gradient is the steepest. A gradient g counts g / (g + c), with c from the
    image's noise and from how steep it is near there.

    Args:
        image: (h, w, channels) float32.
        seen: (h, w) bool; the rest shows no edges, and neither does its border.
        blur: Standard deviation of the smoothing [px].
    """
    smooth = cv2.GaussianBlur(image, (0, 0), blur)
    smooth = smooth.reshape(*smooth.shape[:2], -1)
    x = cv2.Scharr(smooth, cv2.CV_32F, 1, 0, scale=1.0 / 32.0).reshape(smooth.shape)
    y = cv2.Scharr(smooth, cv2.CV_32F, 0, 1, scale=1.0 / 32.0).reshape(smooth.shape)
    steepest = np.hypot(x, y).argmax(axis=-1)[..., None]
    x, y = np.take_along_axis(x, steepest, axis=-1)[..., 0], np.take_along_axis(y, steepest, axis=-1)[..., 0]
    rim = 2 * int(np.ceil(2.0 * blur)) + 3
    inner = cv2.erode(seen.astype(np.uint8), np.ones((rim, rim), np.uint8), borderValue=0).astype(bool)
    size = np.where(inner, np.hypot(x, y), np.float32(0.0))
    noise = float(np.median(size[inner])) if inner.any() else 0.0
    reach = max(5, round(0.08 * float(np.sqrt(seen.sum()))) | 1)
    share = cv2.blur(inner.astype(np.float32), (reach, reach))
    near = cv2.blur(size, (reach, reach)) / np.maximum(share, np.float32(1e-3))
    level = np.float32(_NOISE * noise + 1e-3) + np.float32(_LOCAL) * near
    strength = size / (size + level)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine, sine = np.where(size > 0, x / size, 0.0), np.where(size > 0, y / size, 0.0)
    maps = np.empty((DIRECTIONS, *seen.shape), dtype=np.float32)
    for k in range(DIRECTIONS):
        angle = 2.0 * np.pi * k / DIRECTIONS
        maps[k] = strength * np.maximum(cosine * np.cos(angle) + sine * np.sin(angle), 0.0) ** _SHARPNESS
    _without_rim(maps)
    return EdgeField(maps)


def _without_rim(maps: np.ndarray) -> None:
    maps[:, [0, -1]] = 0.0
    maps[:, :, [0, -1]] = 0.0
