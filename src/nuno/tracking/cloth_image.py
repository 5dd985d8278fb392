"""The cloth as a camera would see it: which face each pixel shows, how deep, and what hides it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from nuno.bodies.body import Body
from nuno.camera import raster
from nuno.camera.image_region import Region, view
from nuno.camera.render import render_depth
from nuno.tracking.pixel_grid import PixelGrid

LEVEL = 0.001
"""[m] What is so little in front of the cloth does not hide it: a table of which the cloth lies on."""


@dataclass(frozen=True, eq=False)
class ClothImage:
    """One world's cloth in one camera.

    Attributes:
        depth: (h, w) float [m], of the cloth alone; inf where it is not.
        faces: (h, w) int, which face is seen there; -1 where it is not.
        seen: (h, w) bool, where the cloth is seen, and hidden by no other body of the world.
    """

    depth: np.ndarray
    faces: np.ndarray
    seen: np.ndarray


def depth_of_others(world: Any, body: Body, grid: PixelGrid) -> np.ndarray:
    """Return the depth of all other bodies, (1 or worlds, h, w) [m]."""
    depth: np.ndarray = render_depth(world, grid.camera, without=[body]).numpy()
    return depth if depth.ndim == 3 else depth[None]


def draw_cloth(world: Any, body: Body, grid: PixelGrid, others: np.ndarray) -> list[ClothImage]:
    """Return what the camera would see of the body in each world, behind the ``others`` of `depth_of_others`."""
    device = world.device
    positions = world.state(body)["positions"]
    faces: Any = wp.array(np.ascontiguousarray(body.shape.mesh()[1], np.int32), dtype=wp.vec3i, device=device)
    keys = raster.key_images(positions.shape[0], Region.full(grid.camera), device, ids=True)
    raster.draw(keys, positions, faces, view(grid.camera), None)
    depths, labels = raster.depths_of(keys).numpy(), raster.ids_of(keys).numpy()
    seen = (labels >= 0) & (depths <= others + LEVEL)
    return [ClothImage(*parts) for parts in zip(depths, labels, seen, strict=True)]
