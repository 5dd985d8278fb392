"""The pixels of a camera that a follower looks at: every so many, each with its ray."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nuno.camera.camera import Camera


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """Every ``step``-th pixel of a camera's image, each way.

    The step is odd, so that the pixels of the grid are pixels of the image, and not between them.

    Attributes:
        full: The camera whose images are given.
        step: [px].
        camera: One whose pixels are those of the grid.
        rays: (h, w, 3) float, through those pixels, one metre deep, in the world.
        origin: (3,) [m], where the camera is.
    """

    full: Camera
    step: int
    camera: Camera
    rays: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, camera: Camera, points: np.ndarray, pixels: int) -> PixelGrid:
        """Return the grid on which what spans ``points`` (n, 3) [m] covers about so many pixels, or fewer."""
        seen = camera.project(points)
        seen = seen[np.isfinite(seen).all(axis=1)]
        area = float(camera.width * camera.height)
        if len(seen):
            size = np.minimum(seen.max(axis=0), (camera.width, camera.height)) - np.maximum(seen.min(axis=0), 0.0)
            area = float(np.prod(np.maximum(size, 1.0)))
        step = 2 * int(0.5 * np.sqrt(max(area, 1.0) / pixels)) + 1
        return cls.every(camera, min(step, _odd(min(camera.width, camera.height) // 8)))

    @classmethod
    def every(cls, camera: Camera, step: int) -> PixelGrid:
        """Return the grid of every ``step``-th pixel; ``step`` is odd."""
        shift = step // 2
        columns, rows = (camera.width - shift - 1) // step + 1, (camera.height - shift - 1) // step + 1
        reduced = replace(
            camera, width=columns, height=rows, fx=camera.fx / step, fy=camera.fy / step,
            cx=(camera.cx - shift) / step, cy=(camera.cy - shift) / step,
        )  # fmt: skip
        v, u = np.mgrid[0:rows, 0:columns]
        rays = camera.rays(np.stack([u * step + shift, v * step + shift], axis=-1).astype(float))
        return cls(camera, step, reduced, rays, camera.camera_to_world[:3, 3])

    def take(self, image: np.ndarray) -> np.ndarray:
        """Return the grid's pixels of an image (height, width, ...) of the full camera."""
        shift = self.step // 2
        return image[shift :: self.step, shift :: self.step]

    def points(self, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return points (k, 3) [m] of chosen pixels (h, w) bool at depths (h, w) [m]."""
        return self.origin + self.rays[pixels] * depth[pixels][:, None]


def _odd(number: int) -> int:
    return max(1, number - 1 + number % 2)
