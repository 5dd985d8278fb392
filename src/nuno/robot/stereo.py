"""Stereo: where points are that two cameras see, how sure that is, and the way of hands through a pair's images."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
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
from nuno.estimate.hand_tracking import NOISE, SEARCH_RADIUS, find_disc, gaps_without
from nuno.validation import checked, finite_array, number

log = logging.getLogger(__name__)

UNREST = 2.0
"""[m/s2] How fast a hand's velocity changes: a grasp of half a metre in a second by minimum jerk has 2.9 at most."""
APART = 3.0
"""[px] How far from each other's rays the two images may show a hand; further, one of them shows something else."""
SHADE = 0.2
"""[radii] How far light and shade draw the middle of what looks like a hand to one side, in all images alike."""
STEPS = 3
"""Newton's steps from the linear solution to the least squares in pixels; the first already leaves 1e-6 m."""


@dataclass(frozen=True, eq=False)
class StereoPoints:
    """Points that two cameras saw.

    Attributes:
        positions: (k, 3) float [m], in the world; those that fit both images best.
        covariances: (k, 3, 3) float [m2], from the pixels' noise.
        residuals: (k,) float [px], root mean square of what remains between the points' images and the pixels.
    """

    positions: np.ndarray
    covariances: np.ndarray
    residuals: np.ndarray

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def deviations(self) -> np.ndarray:
        """(k,) float [m], standard deviation along each point's most uncertain direction."""
        return np.sqrt(np.linalg.eigvalsh(self.covariances)[:, -1])


@checked
def triangulate(
    left: Camera, right: Camera, left_pixels: ArrayLike, right_pixels: ArrayLike, *, noise: float = NOISE
) -> StereoPoints:
    """Return the points that two cameras see at given pixels.

    Args:
        left: One camera.
        right: The other.
        left_pixels: (k, 2) [px], or (2,) of one point.
        right_pixels: Likewise, of the same points.
        noise: Standard deviation of each pixel coordinate [px].

    Raises:
        InvalidInputError: pixels that do not fit each other, cameras at one place, or rays that meet nowhere in front
            of both cameras.
    """
    a, b = (finite_array(name, pixels, (2,), ("k", 2)).reshape(-1, 2)
            for name, pixels in (("left_pixels", left_pixels), ("right_pixels", right_pixels)))  # fmt: skip
    if a.shape != b.shape:
        raise InvalidInputError(f"left_pixels and right_pixels must be of the same points, got {len(a)} and {len(b)}")
    number("noise", noise, above=0.0)
    if np.linalg.norm(left.camera_to_world[:3, 3] - right.camera_to_world[:3, 3]) < 1e-6:
        raise InvalidInputError("the cameras are at one place: two views of a point need a baseline")
    flat = [_on_unit_plane(camera, pixels) for camera, pixels in ((left, a), (right, b))]
    poses = [camera.world_to_camera[:3] for camera in (left, right)]
    found = cv2.triangulatePoints(poses[0], poses[1], flat[0].T, flat[1].T)
    with np.errstate(divide="ignore", invalid="ignore"):
        points = (found[:3] / found[3]).T
    _check_in_front(points, left, right)
    cameras, pixels = (left, right), np.stack([a, b], axis=1)  # (k, 2 cameras, 2)
    for _ in range(STEPS):
        slopes, missing = _linear(cameras, points, pixels)
        points = points + np.einsum("kij,kj->ki", np.linalg.pinv(slopes), missing)
        _check_in_front(points, left, right)
    slopes, missing = _linear(cameras, points, pixels)
    covariances = noise**2 * np.linalg.inv(np.einsum("kji,kjl->kil", slopes, slopes))
    return StereoPoints(points, covariances, np.sqrt(np.mean(missing**2, axis=1)))


@dataclass(frozen=True, eq=False)
class StereoTrack:
    """One hand as it was followed through the images of two cameras.

    Attributes:
        times: (k,) float [s], of the frames.
        positions: (k, 3) float [m], smoothed; where it was not found, bridged; after it was found last, at rest.
        covariances: (k, 3, 3) float [m2], of the positions; large in gaps. That light and shade displace the middle of
            what is seen is in them, and does not average out.
        found: (k, 2) bool, whether it was found in the left and the right image.
        gaps: (begin, end) [s] of each stretch of frames in which neither image shows it, from the last frame with it to
            the next one (or to the last frame).
    """

    times: np.ndarray
    positions: np.ndarray
    covariances: np.ndarray
    found: np.ndarray
    gaps: tuple[tuple[float, float], ...]

    @property
    def deviations(self) -> np.ndarray:
        """(k,) float [m], standard deviation along the most uncertain direction."""
        return np.sqrt(np.linalg.eigvalsh(self.covariances)[:, -1])

    @checked
    def path(self, held: ArrayLike) -> HandPath:
        """Return the path for a replay; ``held`` (k,) bool says when the hand held."""
        return HandPath(self.times, self.positions, np.asarray(held))


def track_hands_in_stereo(
    left_images: Mapping[int, Any] | Sequence[Any], right_images: Mapping[int, Any] | Sequence[Any],
    frame_times: ArrayLike, *, left: Camera | Sequence[Camera], right: Camera | Sequence[Camera], start: ArrayLike,
    radius: float = 0.014,
) -> tuple[StereoTrack, ...]:  # fmt: skip
    """Follow hands that look like balls of one colour through the images of two cameras, of any height.

    A hand's colour in either camera is that at its place in the first image. A Kalman filter of constant velocity in
    space tells where to look; what either image shows corrects it along that camera's directions, so that one image
    alone still does what it can. The backward pass (Rauch, Tung and Striebel 1965) smooths and bridges gaps.

    Args:
        left_images: RGB images (h, w, 3) uint8, or their paths, by index of the frame; the first frame needs one.
        right_images: Likewise of the other camera.
        frame_times: (k,) [s] of the frames, increasing.
        left: The camera, or one for each frame where it moves.
        right: Likewise.
        start: (hands, 3) [m], the hands at the first frame, within two or three radii.
        radius: Of the hands [m].

    Raises:
        InvalidInputError: a value that cannot be used, or a hand that is not in both first images.
        ImageError: an image that cannot be read or does not fit its camera.
    """
    times = finite_array("frame_times", frame_times, ("k",))
    if len(times) < 2 or (np.diff(times) <= 0.0).any():
        raise InvalidInputError("frame_times must be two or more times that increase")
    begin = finite_array("start", start, ("hands", 3))
    number("radius", radius, above=0.0)
    cameras = tuple(_each_frame(name, given, len(times)) for name, given in (("left", left), ("right", right)))
    seen = tuple(
        _images(name, given, own, len(times))
        for name, given, own in (("left", left_images, cameras[0]), ("right", right_images, cameras[1]))
    )
    tracks = []
    for hand, place in enumerate(begin):
        colours = []
        for name, images, own in zip(("left", "right"), seen, cameras, strict=True):
            core = disc(own[0], place, CORE * radius)
            if not core.any():
                raise InvalidInputError(f"hand {hand} at {place.tolist()} m is not in the first {name} image")
            colours.append(np.median(images[0][core], axis=0))
        positions, covariances, found = _follow(seen, times, cameras, place, colours, radius)
        for k, camera in enumerate(cameras[0]):
            ray = positions[k] - camera.camera_to_world[:3, 3]
            ray /= np.linalg.norm(ray)
            covariances[k] += (SHADE * radius) ** 2 * (np.eye(3) - np.outer(ray, ray))
        gaps = gaps_without(times, sorted(set(seen[0]) | set(seen[1])), found[:, 0] | found[:, 1])
        for first, last in gaps:
            log.info("neither image showed hand %d from %.2f s to %.2f s", hand, first, last)
        tracks.append(StereoTrack(times, positions, covariances, found, gaps))
    return tuple(tracks)


@checked
def locate_marker(
    left_image: np.ndarray, right_image: np.ndarray, left: Camera, right: Camera, marker: int,
    *, dictionary: int = cv2.aruco.DICT_4X4_50, noise: float = 0.2,
) -> StereoPoints | None:  # fmt: skip
    """Return the four corners of an ArUco marker that both images show, clockwise from its own upper left, or None.

    Args:
        left_image: (h, w, 3) uint8.
        right_image: Likewise.
        left: Its camera.
        right: Its camera.
        marker: The marker's number.
        dictionary: OpenCV's number of the markers' dictionary.
        noise: Standard deviation of a corner [px].

    Raises:
        ImageError: an image is not (h, w, 3) uint8 of its camera's size.
    """
    rules = cv2.aruco.DetectorParameters()
    rules.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(dictionary), rules)
    pixels = []
    for image, camera in ((left_image, left), (right_image, right)):
        corners, numbers, _ = detector.detectMarkers(check_image(image, camera, "an image of the marker"))
        which = [] if numbers is None else np.flatnonzero(np.ravel(numbers) == marker)
        if not len(which):
            return None
        pixels.append(np.asarray(corners[which[0]], dtype=float).reshape(4, 2))
    return triangulate(left, right, *pixels, noise=noise)


def _follow(
    images: Sequence[Mapping[int, np.ndarray]], times: np.ndarray, cameras: Sequence[Sequence[Camera]],
    place: np.ndarray, colours: Sequence[np.ndarray], radius: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Positions (k, 3), their covariances (k, 3, 3), and where the hand was found (k, 2)."""
    count = len(times)
    states, spreads = np.zeros((count, 6)), np.zeros((count, 6, 6))
    expected, expected_spreads = states.copy(), spreads.copy()
    found = np.zeros((count, 2), dtype=bool)
    state = np.concatenate([place, np.zeros(3)])
    spread = np.diag([(2.0 * radius) ** 2] * 3 + [0.5**2] * 3)  # [m2], [m2/s2]: it may begin in motion
    for k, time in enumerate(times):
        if k:
            move, shake = _motion(time - times[k - 1])
            state, spread = move @ state, move @ spread @ move.T + shake
        expected[k], expected_spreads[k] = state, spread
        pixels = [_seen(own[k], shown.get(k), state, spread, colour, radius)
                  for own, shown, colour in zip(cameras, images, colours, strict=True)]  # fmt: skip
        pixels = _agreeing(pixels, [own[k] for own in cameras], state[:3])
        for side, pixel in enumerate(pixels):
            if pixel is not None:
                state, spread = _corrected(cameras[side][k], state, spread, pixel)
                found[k, side] = True
        states[k], spreads[k] = state, spread
    smooth, smooth_spreads = states.copy(), spreads.copy()
    for k in range(count - 2, -1, -1):
        move, _ = _motion(times[k + 1] - times[k])
        back = spreads[k] @ move.T @ np.linalg.inv(expected_spreads[k + 1])
        smooth[k] = states[k] + back @ (smooth[k + 1] - expected[k + 1])
        smooth_spreads[k] = spreads[k] + back @ (smooth_spreads[k + 1] - expected_spreads[k + 1]) @ back.T
    last = int(np.flatnonzero(found.any(axis=1)).max(initial=0))
    smooth[last:] = smooth[last]  # nothing says where a hand went that is not found again
    return smooth[:, :3], smooth_spreads[:, :3, :3], found


def _seen(
    camera: Camera, image: np.ndarray | None, state: np.ndarray, spread: np.ndarray, colour: np.ndarray, radius: float
) -> np.ndarray | None:
    """The pixel (2,) at which an image shows the hand, or None."""
    depth = float(camera.depth_of(state[:3]))
    if image is None or depth <= radius:
        return None
    near = camera.project(state[:3])
    slope = _slopes(camera, state[None, :3])[0]
    reach = SEARCH_RADIUS + 3.0 * float(np.sqrt(np.linalg.eigvalsh(slope @ spread[:3, :3] @ slope.T)[-1]))
    return find_disc(image, near, max(camera.fx, camera.fy) * radius / depth, colour, reach)


def _agreeing(pixels: list[np.ndarray | None], cameras: list[Camera], place: np.ndarray) -> list[np.ndarray | None]:
    """The pixels, less the one that is further from where it was expected where both cannot be of one point."""
    if any(pixel is None for pixel in pixels):
        return pixels
    try:
        made = triangulate(cameras[0], cameras[1], pixels[0], pixels[1])  # type: ignore[arg-type]
        if made.residuals[0] <= APART:
            return pixels
    except InvalidInputError:  # the rays part
        pass
    away = [np.linalg.norm(pixel - camera.project(place)) for pixel, camera in zip(pixels, cameras, strict=True)]
    pixels[int(np.argmax(away))] = None
    return pixels


def _corrected(
    camera: Camera, state: np.ndarray, spread: np.ndarray, pixel: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The filter's state (6,) and covariance after a pixel, the camera being linear about where it expects the hand."""
    slope = np.zeros((2, 6))
    slope[:, :3] = _slopes(camera, state[None, :3])[0]
    gain = spread @ slope.T @ np.linalg.inv(slope @ spread @ slope.T + NOISE**2 * np.eye(2))
    keep = np.eye(6) - gain @ slope
    state = state + gain @ (pixel - camera.project(state[:3]))
    return state, keep @ spread @ keep.T + NOISE**2 * gain @ gain.T  # Joseph's form, which stays symmetric


def _motion(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a time step's effect on (place, velocity), and its covariance: a random, constant acceleration."""
    effect = np.concatenate([0.5 * step**2 * np.eye(3), step * np.eye(3)])
    move = np.eye(6)
    move[:3, 3:] = step * np.eye(3)
    return move, UNREST**2 * effect @ effect.T + 1e-12 * np.eye(6)


def _linear(cameras: tuple[Camera, Camera], points: np.ndarray, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (k, 4, 3) [px/m] of both cameras at points (k, 3), and what is missing to pixels (k, 2, 2): (k, 4)."""
    slopes = np.concatenate([_slopes(camera, points) for camera in cameras], axis=1)
    missing = [pixels[:, side] - camera.project(points) for side, camera in enumerate(cameras)]
    return slopes, np.concatenate(missing, axis=1)


def _slopes(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Return how pixels change with points (k, 3): (k, 2, 3) [px/m], distortion included."""
    step = 1e-5  # [m]; pixels are computed to 1e-12 of their size
    moves = step * np.eye(3)
    ahead, behind = (camera.project(points[:, None] + sign * moves) for sign in (1.0, -1.0))
    return np.swapaxes(ahead - behind, 1, 2) / (2.0 * step)


def _on_unit_plane(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Return where rays of pixels (k, 2) are at one metre of depth, (k, 2) float64 [m], in the camera's frame."""
    rays = camera.rays(pixels) @ camera.camera_to_world[:3, :3]
    return np.ascontiguousarray(rays[:, :2])


def _check_in_front(points: np.ndarray, left: Camera, right: Camera) -> None:
    with np.errstate(invalid="ignore"):
        behind = ~np.isfinite(points).all(axis=1) | (left.depth_of(points) <= 0.0) | (right.depth_of(points) <= 0.0)
    if behind.any():
        raise InvalidInputError(f"the rays of point {int(np.argmax(behind))} do not meet in front of both cameras")


def _each_frame(name: str, given: Camera | Sequence[Camera], frames: int) -> list[Camera]:
    cameras = [given] * frames if isinstance(given, Camera) else list(given)
    if len(cameras) != frames or not all(isinstance(camera, Camera) for camera in cameras):
        raise InvalidInputError(f"{name} must be a Camera, or {frames} of them, one a frame, got {len(cameras)}")
    return cameras


def _images(name: str, given: Any, cameras: list[Camera], frames: int) -> dict[int, np.ndarray]:
    """The images by frame, as float32."""
    by_frame = given if isinstance(given, Mapping) else dict(enumerate(given))
    seen = {}
    for k in sorted(by_frame):
        if not 0 <= k < frames:
            raise InvalidInputError(f"there is a {name} image of frame {k}; the video has frames 0 to {frames - 1}")
        image = by_frame[k] if isinstance(by_frame[k], np.ndarray) else read_image(by_frame[k])
        seen[k] = check_image(image, cameras[k], f"the {name} image of frame {k}").astype(np.float32)
    if 0 not in seen:
        raise InvalidInputError(f"the first frame needs a {name} image; it shows what the hands look like")
    return seen
