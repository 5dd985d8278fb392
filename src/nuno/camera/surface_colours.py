"""Appearance of surfaces: smooth illumination, colour densities, shading, and edge-aware smoothing.

All images here are float32 RGB in 0 ... 255.
"""

from __future__ import annotations

import cv2
import numpy as np

COLOUR_VOLUME = 256.0**3
"""Volume of the colour cube: one over it is the density of a colour about which nothing is known."""

_BINS = 32


def _quadratic(shape: tuple[int, int], crop: tuple[slice, slice] | None = None) -> np.ndarray:
    """(h, w, 6) float32, the monomials of second degree in image coordinates scaled to about -1 ... 1."""
    h, w = shape
    rows, columns = crop or (slice(0, h), slice(0, w))
    y = ((np.arange(rows.start, rows.stop) + 0.5) / h * 2 - 1)[:, None]
    x = ((np.arange(columns.start, columns.stop) + 0.5) / w * 2 - 1)[None, :]
    one = np.ones((y.size, x.size))
    return np.stack([one, x * one, y * one, x * x * one, x * y, y * y * one], axis=-1).astype(np.float32)


class Illumination:
    """A smooth field of brightness and tint over a surface, fitted robustly.

    The logarithm of each channel is a polynomial of second degree in the image: enough for lamps, vignetting
    and a broad highlight.

    Args:
        image: (h, w, 3) float32.
        weights: (h, w) float, how far each pixel is trusted to show the surface; 0 leaves it out.
        full_shape: Height and width of the full image, if ``image`` is a smaller copy of it.
        degree: 0 for one colour, 1 or 2 for a polynomial.
    """

    def __init__(
        self,
        image: np.ndarray,
        weights: np.ndarray,
        full_shape: tuple[int, int] | None = None,
        degree: int = 2,
    ) -> None:
        terms = (1, 3, 6)[degree]
        self._shape = full_shape or image.shape[:2]
        use = weights > 0
        basis = _quadratic(image.shape[:2])[use][:, :terms].astype(float)
        logs = np.log(np.maximum(image[use], 2.0)).astype(float)
        prior = np.sqrt(weights[use].astype(float))
        self._coefficients = np.zeros((terms, 3))
        robust = prior
        ridge = 1e-3 * len(basis) * np.diag([0.0, *[1.0] * (terms - 1)])
        for _ in range(8):
            weighted = basis * (robust**2)[:, None]
            normal = weighted.T @ basis + ridge * (robust**2).mean()
            self._coefficients = np.linalg.solve(normal, weighted.T @ logs)
            distance = np.linalg.norm(logs - basis @ self._coefficients, axis=1)
            scale = max(1.5 * float(_weighted_median(distance, prior**2)), 0.02)
            robust = prior / (1.0 + (distance / scale) ** 2)

    def field(self, crop: tuple[slice, slice]) -> np.ndarray:
        """(h, w, 3) float32, the surface's smooth colour in a part (rows, columns) of the full image."""
        terms = len(self._coefficients)
        return np.exp(_quadratic(self._shape, crop)[..., :terms] @ self._coefficients.astype(np.float32))

    def level(self) -> np.ndarray:
        """(3,) float32, the colour in the middle of the image."""
        return np.exp(self._coefficients[0]).astype(np.float32)


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def colour_density(samples: np.ndarray, colours: np.ndarray, smoothing: float = 1.0) -> np.ndarray:
    """Probability density of colours under a smoothed histogram of samples.

    Args:
        samples: (n, 3) float32 colours of the surface.
        colours: (..., 3) float32 colours to look up.
        smoothing: Standard deviation of the smoothing [bins of 8 levels].

    Returns:
        (...) float32, density per unit of the colour cube, with one part in a hundred spread evenly.
    """
    index = np.clip(samples / (256 / _BINS), 0, _BINS - 1).astype(np.int32)
    flat = (index[:, 0] * _BINS + index[:, 1]) * _BINS + index[:, 2]
    counts = np.bincount(flat, minlength=_BINS**3).astype(np.float32)
    histogram: np.ndarray = counts.reshape(_BINS, _BINS, _BINS)
    for axis in range(3):
        moved = np.ascontiguousarray(np.moveaxis(histogram, axis, 0)).reshape(_BINS, -1)
        smooth = cv2.GaussianBlur(moved, (1, 7), sigmaX=0.01, sigmaY=smoothing)
        histogram = np.moveaxis(smooth.reshape(_BINS, _BINS, _BINS), 0, axis)
    histogram = histogram / max(float(histogram.sum()), 1e-9) * (_BINS / 256) ** 3
    look = np.clip(colours / (256 / _BINS), 0, _BINS - 1).astype(np.int32)
    return 0.99 * histogram[look[..., 0], look[..., 1], look[..., 2]] + 0.01 / COLOUR_VOLUME


def brightness(image: np.ndarray) -> np.ndarray:
    """(h, w) float32, the mean of the three channels of an image (h, w, 3) float32."""
    return cv2.transform(image, np.full((1, 3), 1.0 / 3.0, dtype=np.float32))


def normal_density(pixels: np.ndarray, colour: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Density (...) of pixels (..., 3) around colours (..., 3), independent in each channel."""
    offset = pixels - colour
    variance = np.broadcast_to(variance, offset.shape)
    scale = variance[..., 0] * variance[..., 1] * variance[..., 2]
    distance2 = np.einsum("...i,...i->...", offset * offset, 1.0 / variance)
    return np.exp(-0.5 * distance2) / np.sqrt(np.float32((2 * np.pi) ** 3) * scale)


def shaded_density(
    pixels: np.ndarray,
    colour: np.ndarray,
    noise: float,
    darkest: float,
    brightest: float,
    variation: float = 0.03,
) -> np.ndarray:
    """Density of pixels that show a colour in any light between two.

    One colour in more or less light lies on a ray from black: the density is even along it and normal across
    it.

    Args:
        pixels: (..., 3) float32.
        colour: (3,) or (..., 3) float32, the colour in full light.
        noise: Standard deviation of a channel [levels].
        darkest: Least share of the full light.
        brightest: Largest share.
        variation: How much the colour itself varies, relative to it.

    Returns:
        (...) float32, per unit of the colour cube.
    """
    length2 = np.einsum("...i,...i->...", colour, colour) + np.float32(1.0)
    share = np.einsum("...i,...i->...", pixels, colour) / length2
    along2 = share * share * length2
    across2 = np.maximum(np.einsum("...i,...i->...", pixels, pixels) - along2, 0.0)
    variance = np.float32(noise**2) + np.float32(variation**2) * along2
    ends = np.clip(np.minimum(share - darkest, brightest - share) / np.float32(0.05) + np.float32(0.5), 0.0, 1.0)
    even = ends / (np.float32(brightest - darkest) * np.sqrt(length2))
    return even * np.exp(-0.5 * across2 / variance) / (np.float32(2 * np.pi) * variance)


def palette(samples: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The main colours of a surface.

    Args:
        samples: (n, 3) float32 colours.
        count: How many colours at most.

    Returns:
        Colours (k, 3) float32 and their shares (k,) float32.
    """
    samples = np.ascontiguousarray(samples[:: max(1, len(samples) // 3000)], dtype=np.float32)
    count = min(count, len(samples))
    # Start from equal parts along the main direction of colour: no dice, so one image gives one answer.
    offset = samples - samples.mean(axis=0)
    main = np.linalg.svd(offset.T @ offset)[0][:, 0]
    labels = np.empty((len(samples), 1), dtype=np.int32)
    labels[np.argsort(offset @ main, kind="stable"), 0] = np.arange(len(samples)) * count // len(samples)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 15, 0.5)
    centres = cv2.kmeans(samples, count, labels, criteria, 1, cv2.KMEANS_USE_INITIAL_LABELS)[2]
    centres = np.asarray(centres, dtype=np.float32)
    share = np.bincount(labels.ravel(), minlength=count).astype(np.float32) / len(samples)
    return centres[share > 0], share[share > 0]


def guided_filter(values: np.ndarray, guide: np.ndarray, radius: int, epsilon: float) -> np.ndarray:
    """Smooth values, but not across edges of a guide.

    He, Sun, Tang: Guided image filtering (2010), eq. 5, 6 and 8.

    Args:
        values: (h, w) float32.
        guide: (h, w) float32.
        radius: Half width of the window [px].
        epsilon: Variance of the guide that counts as flat [the guide's unit squared].

    Returns:
        (h, w) float32.
    """
    size = (2 * radius + 1, 2 * radius + 1)

    def mean(array: np.ndarray) -> np.ndarray:
        return cv2.blur(array, size, borderType=cv2.BORDER_REFLECT)

    mean_guide, mean_values = mean(guide), mean(values)
    variance = mean(guide * guide) - mean_guide * mean_guide
    covariance = mean(guide * values) - mean_guide * mean_values
    slope = covariance / (np.maximum(variance, 0.0) + epsilon)
    return mean(slope) * guide + mean(mean_values - slope * mean_guide)


def discriminant(image: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Project an image on the direction of colour that tells two of its regions apart best (Fisher's).

    Args:
        image: (h, w, 3) float32.
        first: (h, w) bool.
        second: (h, w) bool.

    Returns:
        (h, w) float32, scaled so that the regions' means are 1 apart.
    """
    a, b = image[first], image[second]
    within = np.cov(a.T) + np.cov(b.T) + 9.0 * np.eye(3)
    apart = a.mean(axis=0, dtype=float) - b.mean(axis=0, dtype=float)
    direction = np.linalg.solve(within, apart)
    direction /= max(abs(float(direction @ apart)), 1e-6)
    return image @ direction.astype(np.float32)
