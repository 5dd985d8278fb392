"""The pinhole camera, in OpenCV's axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import as_array, checked, finite_array, number

MAX_PIXELS = 16384
"""Of a side of an image: 1 GB of depth a world, where both sides have as many."""
_DISTORTIONS = (4, 5, 8, 12, 14)  # how many coefficients OpenCV's models have


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated pinhole camera: x right, y down, z forward; integer pixels are centres.

    Attributes:
        width: Image width [px].
        height: Image height [px].
        fx: Focal length along x [px].
        fy: Focal length along y [px].
        cx: Principal point x [px].
        cy: Principal point y [px].
        camera_to_world: (4, 4) float, X_world = R X_camera + t [m].
        distortion: OpenCV's coefficients (k1, k2, p1, p2[, k3 ...]), or None.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: np.ndarray = field(default_factory=lambda: np.eye(4))
    distortion: np.ndarray | None = None

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, width: int, height: int, fx: float, fy: float, cx: float, cy: float,
            camera_to_world: ArrayLike = ..., distortion: ArrayLike | None = None,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        pose = finite_array("camera_to_world", self.camera_to_world, (4, 4))
        rotation = pose[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3:
            raise InvalidInputError("the upper left (3, 3) of camera_to_world must be a rotation, which this is not")
        if np.linalg.det(rotation) < 0:
            raise InvalidInputError("the upper left (3, 3) of camera_to_world must be a rotation, got a reflection")
        if np.abs(pose[3] - (0.0, 0.0, 0.0, 1.0)).max() > 1e-6:
            raise InvalidInputError(
                f"the last row of camera_to_world must be 0, 0, 0, 1, got {pose[3].tolist()}; is it transposed?"
            )
        for name in ("width", "height"):
            object.__setattr__(self, name, _pixels(name, getattr(self, name)))
        for name in ("fx", "fy"):
            number(name, getattr(self, name), above=0.0)
        for name in ("cx", "cy"):
            number(name, getattr(self, name))
        object.__setattr__(self, "camera_to_world", pose)
        if self.distortion is not None:
            distortion = as_array("distortion", self.distortion)
            if distortion.size:
                distortion = finite_array("distortion", distortion.ravel(), *((n,) for n in _DISTORTIONS))
            object.__setattr__(self, "distortion", distortion if distortion.size else None)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Camera:
        """Build a camera from the ``camera`` entry of an input.json.

        Raises:
            InvalidInputError: an entry is missing or not usable.
        """
        names = ("width", "height", "fx", "fy", "cx", "cy", "camera_to_world")
        if not isinstance(data, Mapping):
            raise InvalidInputError(f"a camera is an object with {', '.join(names)}, got {type(data).__name__}")
        missing = [name for name in names if name not in data]
        if missing:
            raise InvalidInputError(f"the camera lacks {', '.join(missing)}; it needs {', '.join(names)}")
        try:
            return cls(**{name: data[name] for name in names}, distortion=data.get("distortion"))
        except InvalidInputError as error:
            raise InvalidInputError(f"camera: {error}") from error

    @classmethod
    def look_at(
        cls, eye: ArrayLike, target: ArrayLike, fov: float, *, width: int = 640, height: int = 480,
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> Camera:  # fmt: skip
        """Return a camera at a point that looks at another, upright, with square pixels and no distortion.

        Args:
            eye: (3,) [m], where the camera is.
            target: (3,) [m], what is in the middle of the image.
            fov: Field of view from the image's upper edge to its lower one [rad], below pi.
            width: Image width [px].
            height: Image height [px].
            up: (3,), the direction that points up in the image. Where the camera looks along it, straight down say,
                +y points up, or +x where that is the same line.

        Raises:
            InvalidInputError: the two points are one, or a value that is not finite or out of range.
        """
        place, aim = finite_array("eye", eye, (3,)), finite_array("target", target, (3,))
        upward = finite_array("up", up, (3,))
        angle = number("fov", fov)
        if not 0.0 < angle < np.pi:
            raise InvalidInputError(
                f"fov must be in (0, pi) rad, got {angle!r}" + (f"; np.radians({angle:g})?" if angle >= np.pi else "")
            )
        forward = aim - place
        distance, length = float(np.linalg.norm(forward)), float(np.linalg.norm(upward))
        if distance < 1e-9:
            raise InvalidInputError(f"eye and target are the same point, {place.tolist()}")
        if length < 1e-9:
            raise InvalidInputError(f"up must be a direction, got {upward.tolist()}")
        forward /= distance
        for upright in (upward / length, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])):
            right = np.cross(forward, upright)
            if np.linalg.norm(right) > 1e-6:
                break
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.stack([right, np.cross(forward, right), forward], axis=1), place
        columns, rows = _pixels("width", width), _pixels("height", height)
        focal = 0.5 * rows / float(np.tan(0.5 * angle))
        return cls(columns, rows, focal, focal, 0.5 * (columns - 1), 0.5 * (rows - 1), pose)

    @property
    def matrix(self) -> np.ndarray:
        """(3, 3) float, the intrinsic matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def world_to_camera(self) -> np.ndarray:
        """(4, 4) float, the inverse of ``camera_to_world``."""
        return np.linalg.inv(self.camera_to_world)

    @checked
    def scaled(self, factor: float) -> Camera:
        """The same view with ``factor`` times as many pixels each way (pixel centres stay centres)."""
        return replace(
            self, width=max(1, round(self.width * factor)), height=max(1, round(self.height * factor)),
            fx=self.fx * factor, fy=self.fy * factor,
            cx=(self.cx + 0.5) * factor - 0.5, cy=(self.cy + 0.5) * factor - 0.5,
        )  # fmt: skip

    @checked
    def depth_of(self, points: ArrayLike) -> np.ndarray:
        """Depth [m] (..., ) of world points (..., 3) along the optical axis; negative behind the camera."""
        pose = self.camera_to_world
        return (_rows("points", points, 3) - pose[:3, 3]) @ pose[:3, 2]

    @checked
    def project(self, points: ArrayLike) -> np.ndarray:
        """Pixels (..., 2) of world points (..., 3) [m]; NaN for points behind the camera."""
        points = _rows("points", points, 3)
        pose = self.camera_to_world
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        depth = np.where(local[..., 2] > 1e-9, local[..., 2], np.nan)
        xy = local[..., :2] / depth[..., None]
        if self.distortion is not None:
            import cv2

            flat = np.concatenate([xy.reshape(-1, 2), np.ones((xy.size // 2, 1))], axis=1)
            pixels = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self.matrix, self.distortion)[0]
            return pixels.reshape((*points.shape[:-1], 2))
        return xy * (self.fx, self.fy) + (self.cx, self.cy)

    @checked
    def rays(self, pixels: ArrayLike) -> np.ndarray:
        """Directions (..., 3) in the world through pixels (..., 2), scaled to one metre of depth."""
        pixels = _rows("pixels", pixels, 2)
        if self.distortion is not None:
            import cv2

            xy = cv2.undistortPoints(pixels.reshape(-1, 1, 2), self.matrix, self.distortion).reshape(pixels.shape)
        else:
            xy = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
        local = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1)
        return local @ self.camera_to_world[:3, :3].T

    @checked
    def back_project(self, pixels: ArrayLike, height: float) -> np.ndarray:
        """World points (..., 3) [m] where the rays of pixels (..., 2) meet the plane z = height.

        Raises:
            InvalidInputError: a ray does not meet the plane in front of the camera.
        """
        rays = self.rays(pixels)
        origin = self.camera_to_world[:3, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (height - origin[2]) / rays[..., 2]
        if not (np.isfinite(distance) & (distance > 0)).all():
            raise InvalidInputError(f"a pixel's ray does not meet the plane z = {height} in front of the camera")
        return origin + distance[..., None] * rays


def _rows(name: str, value: ArrayLike, size: int) -> np.ndarray:
    rows = np.asarray(value, dtype=float)
    if rows.ndim < 1 or rows.shape[-1] != size:
        raise InvalidInputError(f"{name} must have the shape (..., {size}), got {rows.shape}")
    return rows


def _pixels(name: str, value: Any) -> int:
    pixels = number(f"{name} in pixels", value, low=1.0, high=MAX_PIXELS)
    if pixels != int(pixels):
        raise InvalidInputError(f"{name} must be a whole number of pixels, got {value!r}")
    return int(pixels)
