"""Hands that look like balls, followed through the images of one calibrated camera, where their height is known."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.image import check_image, read_image
from nuno.errors import InvalidInputError
from nuno.estimate.hand_path import HandPath
from nuno.estimate.hand_sight import CORE, disc
from nuno.validation import checked, finite_array, number

log = logging.getLogger(__name__)

NOISE = 0.35
"""[px] What the middle of a ball of a few pixels is off."""
UNREST = 400.0
"""[px/s2] How fast a hand's speed in the image changes."""
SEARCH_RADIUS = 4.0
"""[px] Beside three standard deviations, how far from where it is expected a hand is looked for."""
ALIKE = 0.4
"""Share by which a disc must be more like the hand than the ring around it."""
RING = 1.7
"""[radii] The outer border of that ring."""
COLOUR = 28.0
"""[levels] How far the hand's colour may change from image to image; noise and light."""


@dataclass(frozen=True, eq=False)
class HandTrack:
    """One hand as it was followed.

    Attributes:
        times: (k,) float [s], of the frames.
        positions: (k, 3) float [m], smoothed; where it was not found, bridged; after it was found last, at rest.
        pixels: (k, 2) float [px], likewise.
        found: (k,) bool, whether it was found in the frame's image.
        gaps: (begin, end) [s] of each stretch of images without it, from the last image with it to the next one
            (or to the last image).
    """

    times: np.ndarray
    positions: np.ndarray
    pixels: np.ndarray
    found: np.ndarray
    gaps: tuple[tuple[float, float], ...]

    @checked
    def path(self, held: ArrayLike) -> HandPath:
        """Return the path for a replay; ``held`` (k,) bool says when the hand held."""
        return HandPath(self.times, self.positions, np.asarray(held))


def track_hands(
    images: Mapping[int, Any],
    frame_times: ArrayLike,
    *,
    camera: Camera,
    start: ArrayLike,
    heights: ArrayLike,
    radius: float = 0.014,
) -> tuple[HandTrack, ...]:
    """Follow hands that look like balls of one colour, from where they are in the first image.

    A hand's colour is that at its place in the first image. In each later one it is the disc near where it is expected
    that is more like this than the ring around it; a Kalman filter of constant speed in the image tells what to expect,
    and its backward pass smooths the track and bridges what is missing. The pixel's ray then meets the known height.

    Args:
        images: RGB images (h, w, 3) uint8, or their paths, by index of the frame; the first frame must have one.
        frame_times: (k,) [s] of the frames, increasing.
        camera: The camera.
        start: (hands, 3) [m], the hands at the first frame.
        heights: z of the hands [m]: a number, (k,) or (k, hands).
        radius: Of the hands [m].

    Raises:
        InvalidInputError: a value that cannot be used; a hand that is not in the first image, or a height at which a
            ray does not meet it.
        ImageError: an image that cannot be read or does not fit the camera.
    """
    times = finite_array("frame_times", frame_times, ("k",))
    if len(times) < 2 or (np.diff(times) <= 0.0).any():
        raise InvalidInputError("frame_times must be two or more times that increase")
    begin = finite_array("start", start, ("hands", 3))
    z = finite_array("heights", heights, (), (len(times),), (len(times), len(begin)))
    z = np.broadcast_to(z[:, None] if z.ndim == 1 else z, (len(times), len(begin)))
    number("radius", radius, above=0.0)
    seen = {}
    for k in sorted(images):
        if not 0 <= k < len(times):
            raise InvalidInputError(f"there is an image of frame {k}; the video has frames 0 to {len(times) - 1}")
        image = images[k] if isinstance(images[k], np.ndarray) else read_image(images[k])
        seen[k] = check_image(image, camera, f"the image of frame {k}").astype(np.float32)
    if 0 not in seen:
        raise InvalidInputError("the first frame needs an image; it shows what the hands look like")
    tracks = []
    for hand, place in enumerate(begin):
        core = disc(camera, place, CORE * radius)
        if not core.any():
            raise InvalidInputError(f"hand {hand} at {place.tolist()} m is not in the first image")
        pixels, found = _follow(seen, times, camera, place, z[:, hand], np.median(seen[0][core], axis=0), radius)
        rays = zip(pixels, z[:, hand], strict=True)
        positions = np.stack([camera.back_project(pixel, height) for pixel, height in rays])
        gaps = gaps_without(times, sorted(seen), found)
        for first, last in gaps:
            log.info("hand %d was not found from %.2f s to %.2f s", hand, first, last)
        tracks.append(HandTrack(times, positions, pixels, found, gaps))
    return tuple(tracks)


def _follow(
    images: Mapping[int, np.ndarray], times: np.ndarray, camera: Camera, place: np.ndarray, heights: np.ndarray,
    colour: np.ndarray, radius: float,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Pixels (k, 2), smoothed, and whether the hand was found (k,).

    The filter's state is the pixel and its speed; both axes share the covariance (Rauch, Tung and Striebel 1965).
    """
    states, covariances = np.zeros((len(times), 2, 2)), np.zeros((len(times), 2, 2))  # (k, [place, speed], [u, v])
    expected, expected_covariances = states.copy(), covariances.copy()
    found = np.zeros(len(times), dtype=bool)
    state = np.stack([camera.project(place), np.zeros(2)])
    covariance = np.diag([1.0, 100.0**2])
    for k, time in enumerate(times):
        if k:
            move, shake = _motion(time - times[k - 1])
            state, covariance = move @ state, move @ covariance @ move.T + shake
        expected[k], expected_covariances[k] = state, covariance
        if k in images:
            ray = camera.rays(state[0])
            origin = camera.camera_to_world[:3, 3]
            depth = (heights[k] - origin[2]) / ray[2] if abs(ray[2]) > 1e-9 else -1.0
            if depth > 0.0:
                size = max(camera.fx, camera.fy) * radius / depth
                measured = find_disc(
                    images[k], state[0], size, colour, SEARCH_RADIUS + 3.0 * float(np.sqrt(covariance[0, 0]))
                )
                if measured is not None:
                    gain = covariance[:, 0] / (covariance[0, 0] + NOISE**2)
                    state = state + gain[:, None] * (measured - state[0])
                    covariance = covariance - np.outer(gain, covariance[0])
                    found[k] = True
        states[k], covariances[k] = state, covariance
    smooth = states.copy()
    for k in range(len(times) - 2, -1, -1):
        move, _ = _motion(times[k + 1] - times[k])
        back = covariances[k] @ move.T @ np.linalg.inv(expected_covariances[k + 1])
        smooth[k] = states[k] + back @ (smooth[k + 1] - expected[k + 1])
    last = int(np.flatnonzero(found).max(initial=0))
    smooth[last:] = smooth[last]  # nothing says where a hand went that is not found again
    return smooth[:, 0], found


def _motion(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a time step's effect on (place, speed), and its covariance: a random, constant acceleration."""
    effect = np.array([0.5 * step**2, step])
    return np.array([[1.0, step], [0.0, 1.0]]), UNREST**2 * np.outer(effect, effect) + 1e-9 * np.eye(2)


def find_disc(
    image: np.ndarray, expected_at: np.ndarray, size: float, colour: np.ndarray, search: float
) -> np.ndarray | None:
    """The pixel (2,) of the disc of ``size`` [px] within ``search`` [px] that is most like the hand, or None."""
    reach = int(np.ceil(search + RING * size + 2))
    u0, v0 = np.floor(expected_at).astype(int) - reach
    u1, v1 = np.ceil(expected_at).astype(int) + reach + 1
    height, width = image.shape[:2]
    u0, v0, u1, v1 = max(u0, 0), max(v0, 0), min(u1, width), min(v1, height)
    if u1 - u0 < 3 or v1 - v0 < 3:
        return None
    part = image[v0:v1, u0:u1]
    alike = np.exp(-((part - colour) ** 2).sum(axis=-1) / (2.0 * COLOUR**2)).astype(np.float32)
    half = int(np.ceil(RING * size))
    away = np.hypot(*np.meshgrid(np.arange(-half, half + 1), np.arange(-half, half + 1)))
    inner = (away <= size).astype(np.float32)
    outer = ((away > size + 0.7) & (away <= RING * size + 0.7)).astype(np.float32)
    score = cv2.filter2D(alike, -1, inner / inner.sum(), borderType=cv2.BORDER_CONSTANT)
    score = score - cv2.filter2D(alike, -1, outer / max(outer.sum(), 1.0), borderType=cv2.BORDER_REFLECT)
    v, u = np.mgrid[v0:v1, u0:u1]
    score[np.hypot(u - expected_at[0], v - expected_at[1]) > search] = -1.0
    best = np.unravel_index(int(score.argmax()), score.shape)
    if score[best] < ALIKE:
        return None
    around = np.hypot(u - u[best], v - v[best]) <= size + 1.0
    weight = alike * around
    return np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()


def gaps_without(times: np.ndarray, shown: list[int], found: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Begin and end [s] of each stretch of the frames ``shown`` in which the hand was not ``found`` (k,)."""
    gaps: list[tuple[float, float]] = []
    last = times[shown[0]]
    missing = False
    for k in shown:
        if found[k]:
            if missing:
                gaps.append((float(last), float(times[k])))
            last, missing = times[k], False
        else:
            missing = True
    return tuple([*gaps, (float(last), float(times[shown[-1]]))] if missing else gaps)
