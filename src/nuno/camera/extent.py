"""The part of an image that bodies take up, found on the device where their vertices are."""
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, arg-type, valid-type, call-overload"

from collections.abc import Sequence

import numpy as np
import warp as wp

from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, View, view
from nuno.camera.projection import SUBPIXELS, project
from nuno.numbers.cpu_compiler import compile_quickly

compile_quickly(__name__)

_LOW_X, _LOW_Y, _HIGH_X, _HIGH_Y, _BEHIND = (wp.constant(i) for i in range(5))
_NOTHING = (1 << 30, 1 << 30, -(1 << 30), -(1 << 30), 0)


@wp.kernel
def _widen(positions: wp.array2d[wp.vec3], v: View, row: int, extents: wp.array2d[int]):
    """Widen a row of extents [1/256 px] to one vertex; those that are not finite are left out."""
    world, i = wp.tid()
    p = v.rotation * (positions[world, i] - v.origin)
    if wp.isfinite(p):
        if p[2] <= 1.0e-9:
            extents[row, _BEHIND] = 1
        else:
            at = project(p, v)
            # nearly all vertices lie within what others have spread to: they need no atomic
            if at[0] < extents[row, _LOW_X]:
                wp.atomic_min(extents, row, _LOW_X, at[0])
            if at[1] < extents[row, _LOW_Y]:
                wp.atomic_min(extents, row, _LOW_Y, at[1])
            if at[0] > extents[row, _HIGH_X]:
                wp.atomic_max(extents, row, _HIGH_X, at[0])
            if at[1] > extents[row, _HIGH_Y]:
                wp.atomic_max(extents, row, _HIGH_Y, at[1])


def regions_of(positions: wp.array, cameras: Sequence[Camera], *, margin: int = 2) -> list[Region]:
    """For each camera the smallest rectangle of its image that holds all vertices, plus a margin [px].

    As ``Region.around``: the whole image if a vertex is behind the camera; one pixel if all are beside the image.

    Args:
        positions: (worlds, n) vec3 [m]; those that are not finite are left out.
        cameras: The cameras.
        margin: [px]
    """
    extents: wp.array = wp.array(np.tile(np.int32(_NOTHING), (len(cameras), 1)), dtype=int, device=positions.device)
    for row, camera in enumerate(cameras):
        wp.launch(_widen, dim=positions.shape, inputs=[positions, view(camera), row, extents], device=positions.device)
    return [_region(found, camera, margin) for found, camera in zip(extents.numpy(), cameras, strict=True)]


def _region(found: np.ndarray, camera: Camera, margin: int) -> Region:
    low, high = found[:2] // SUBPIXELS - margin, -(-found[2:4] // SUBPIXELS) + margin
    if found[4] or (found[:2] > found[2:4]).any():
        return Region.full(camera)
    last = np.array([camera.width - 1, camera.height - 1])
    low = np.clip(low, 0, last)
    high = np.clip(high, low, last)
    return Region(int(low[0]), int(low[1]), int(high[0] - low[0] + 1), int(high[1] - low[1] + 1))
