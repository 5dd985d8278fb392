"""The table that a cloth lies on, and where it is in an image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera
from nuno.errors import InvalidInputError
from nuno.validation import check_fields


@dataclass(frozen=True)
class Table:
    """A horizontal table top, axis aligned.

    Attributes:
        height: z of the top [m].
        half_extents: Half of the top's size along x and y [m], or None when it is not known.
        centre: x, y of the top's middle [m]; None stands for (0, 0) where half_extents are given.
        thickness: Thickness of the top [m].
    """

    height: float
    half_extents: tuple[float, float] | None = None
    centre: tuple[float, float] | None = None
    thickness: float = 0.04

    def __post_init__(self) -> None:
        check_fields(self)
        numbers = [self.height, self.thickness, *(self.half_extents or ()), *(self.centre or ())]
        if not np.isfinite(np.asarray(numbers, dtype=float)).all():
            raise InvalidInputError(f"a table's numbers must be finite, got {self}")
        if self.thickness < 0:
            raise InvalidInputError(f"a table's thickness must not be negative, got {self.thickness} m")
        if self.half_extents is not None and (len(self.half_extents) != 2 or min(self.half_extents) <= 0):
            raise InvalidInputError(f"half_extents must be two positive lengths [m], got {self.half_extents}")
        if self.centre is not None and len(self.centre) != 2:
            raise InvalidInputError(f"a table's centre is (x, y) [m], got {self.centre}")


def plane_coordinates(camera: Camera, height: float, step: int = 1) -> np.ndarray:
    """Return where every pixel's ray meets the plane z = height.

    Args:
        camera: The camera.
        height: The plane's z [m].
        step: Take every ``step``-th block of pixels, at the block's middle.

    Returns:
        (h // step, w // step, 2) float, x and y [m]; NaN where a ray does not meet the plane.
    """
    u = np.arange(camera.width // step) * step + (step - 1) / 2
    v = np.arange(camera.height // step) * step + (step - 1) / 2
    rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
    origin = camera.camera_to_world[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (height - origin[2]) / rays[..., 2]
    distance = np.where(np.isfinite(distance) & (distance > 0), distance, np.nan)
    return origin[:2] + distance[..., None] * rays[..., :2]


def table_margin(table: Table, xy: np.ndarray) -> np.ndarray:
    """Return how far inside the table's border points of its plane lie.

    Args:
        table: The table, with known half_extents.
        xy: (..., 2) float, points [m].

    Returns:
        (...,) float, distance to the nearest border, as a fraction of the half extent across it: 1 in the
        middle, 0 at the border, negative outside and where xy is NaN.

    Raises:
        InvalidInputError: the table's extents are not known.
    """
    if table.half_extents is None:
        raise InvalidInputError("the table's half_extents are not known, so it has no border")
    relative = np.abs(xy - np.asarray(table.centre or (0.0, 0.0))) / np.asarray(table.half_extents)
    return np.nan_to_num(1.0 - relative.max(axis=-1), nan=-1.0)
