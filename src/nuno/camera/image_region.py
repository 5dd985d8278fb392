"""The camera as the rasteriser has it: the part of the image to draw, and a kernel argument."""

from dataclasses import dataclass

import numpy as np
import warp as wp

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError

_coefficients = wp.types.vector(length=12, dtype=wp.float32)


@dataclass(frozen=True)
class Region:
    """A rectangle of an image: only its pixels are stored and drawn; everything else counts as background.

    Attributes:
        x0: Left column [px].
        y0: Top row [px].
        width: Columns [px].
        height: Rows [px].
    """

    x0: int
    y0: int
    width: int
    height: int

    @classmethod
    def full(cls, camera: Camera) -> "Region":
        """The whole image of a camera."""
        return cls(0, 0, camera.width, camera.height)

    def check(self, camera: Camera) -> None:
        """Raise InvalidInputError unless the rectangle lies inside the camera's image."""
        if (
            min(self.x0, self.y0) < 0
            or min(self.width, self.height) < 1
            or self.x0 + self.width > camera.width
            or self.y0 + self.height > camera.height
        ):
            raise InvalidInputError(f"{self} does not lie inside an image of {camera.width} x {camera.height} px")


@wp.struct
class View:
    """A camera and a region, as the kernels have them."""

    rotation: wp.mat33  # world to camera
    origin: wp.vec3  # of the camera in the world [m]
    fx: float
    fy: float
    cx: float
    cy: float
    near: float  # [m]
    x0: int
    y0: int
    width: int
    height: int
    distorted: int
    radius2: float  # square of the largest radius at which the distortion is evaluated, at 1 m of depth
    coefficients: _coefficients  # type: ignore[valid-type]  # k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4


def view(camera: Camera, region: Region | None = None, *, near: float = 0.01) -> View:
    """The kernel argument for a camera.

    Args:
        camera: The camera. Of its distortion, up to 12 of OpenCV's coefficients are supported (not the tilt).
        region: What part of the image is drawn; None is all of it.
        near: Near plane [m], at which triangles are cut off.

    Raises:
        InvalidInputError: the region is not inside the image, near is not positive, or unsupported
            distortion.
    """
    region = Region.full(camera) if region is None else region
    region.check(camera)
    if not near > 0.0:
        raise InvalidInputError(f"near must be positive [m], got {near}")
    v = View()
    pose = camera.camera_to_world
    v.rotation = wp.mat33(*[float(x) for x in pose[:3, :3].T.ravel()])
    v.origin = wp.vec3(*[float(x) for x in pose[:3, 3]])
    v.fx, v.fy, v.cx, v.cy, v.near = camera.fx, camera.fy, camera.cx, camera.cy, near
    v.x0, v.y0, v.width, v.height = region.x0, region.y0, region.width, region.height
    given = np.zeros(0) if camera.distortion is None else camera.distortion
    if given.any():
        if len(given) not in (4, 5, 8, 12) and (len(given) != 14 or given[12:].any()):
            raise InvalidInputError(
                f"distortion has {len(given)} coefficients; 4, 5, 8 or 12 of OpenCV's can be drawn (no tilt)"
            )
        v.distorted = 1
        coefficients = np.pad(given[:12], (0, 12 - len(given[:12])))
        v.coefficients = _coefficients(*coefficients.tolist())
        v.radius2 = _radius2_limit(camera, coefficients)
    return v


def _radius2_limit(camera: Camera, c: np.ndarray) -> float:
    """Square of the largest radius [m at 1 m depth] at which the distortion is trusted.

    Distortion polynomials turn back beyond the field that they were fitted to, and would bring points from
    far outside back into the image. Beyond this radius points are drawn with the scale that holds there: that
    of the image's farthest corner, or where the polynomial turns if that is nearer.
    """
    x = max(camera.cx + 0.5, camera.width - 0.5 - camera.cx) / camera.fx
    y = max(camera.cy + 0.5, camera.height - 0.5 - camera.cy) / camera.fy
    corner = 1.05 * np.hypot(x, y)  # the tangential and thin-prism terms are small beside these 5 %
    r = np.linspace(0.0, 4.0 * corner, 4001)
    r2 = r * r
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = r * (1 + r2 * (c[0] + r2 * (c[1] + r2 * c[4]))) / (1 + r2 * (c[5] + r2 * (c[6] + r2 * c[7])))
    past = np.flatnonzero((drawn[1:] <= drawn[:-1]) | ~np.isfinite(drawn[1:]) | (drawn[:-1] > corner))
    return float(r2[past[0]] if len(past) else r2[-1])
