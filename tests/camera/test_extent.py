"""Which part of an image vertices take up: exact against their pixels."""

import numpy as np
import pytest
import warp as wp

from nuno.camera.camera import Camera
from nuno.camera.extent import regions_of
from nuno.camera.image_region import Region

CAMERA = Camera(120, 90, 100.0, 100.0, 59.5, 44.5, np.eye(4))


def vertices(*pixels, depth=1.0):
    """(1, n) array of vec3 [m] that project to pixels."""
    rays = CAMERA.rays(np.array(pixels, dtype=float))
    return wp.array(np.float32(rays * depth)[None], dtype=wp.vec3, device="cpu")


def test_a_region_holds_all_vertices():
    """Their pixels rounded outwards, and a margin."""
    found = regions_of(vertices((20.25, 30.75), (50.5, 40.5), (30.0, 35.0)), [CAMERA], margin=1)
    assert found == [Region(19, 29, 34, 14)]


def test_each_camera_has_its_own():
    """Another that is 0.1 m to the right, at 1 m, sees the same 10 px further left."""
    pose = np.eye(4)
    pose[0, 3] = 0.1
    right = Camera(120, 90, 100.0, 100.0, 59.5, 44.5, pose)
    found = regions_of(vertices((20.25, 30.75), (50.5, 40.5)), [CAMERA, right], margin=0)
    assert found == [Region(20, 30, 32, 12), Region(10, 30, 32, 12)]


def test_vertices_behind_beside_and_not_finite():
    """Behind the camera: the whole image; beside it: one pixel; not finite: left out, and nothing left is the whole."""
    behind = vertices((20.0, 30.0), (50.0, 40.0), depth=-1.0)
    beside = vertices((-500.0, -500.0), (-400.0, -400.0))
    lost = wp.array(np.float32([[(np.nan, 0.0, 1.0), (0.0, 0.0, 1.0)]]), dtype=wp.vec3, device="cpu")
    nothing = wp.array(np.full((1, 2, 3), np.nan, np.float32), dtype=wp.vec3, device="cpu")
    assert regions_of(behind, [CAMERA]) == [Region.full(CAMERA)]
    assert regions_of(beside, [CAMERA]) == [Region(0, 0, 1, 1)]
    assert regions_of(lost, [CAMERA], margin=0) == [Region(59, 44, 2, 2)]
    assert regions_of(nothing, [CAMERA]) == [Region.full(CAMERA)]


@pytest.mark.cuda
def test_regions_on_cuda_are_those_of_the_cpu():
    """Integers of the same vertices, but for rounding of a 1/256 px where a pixel's border is near."""
    points = np.float32(np.random.default_rng(3).normal((0.0, 0.0, 2.0), 0.2, (40, 500, 3)))
    here, there = (
        regions_of(wp.array(points, dtype=wp.vec3, device=device), [CAMERA], margin=3)[0]
        for device in ("cpu", "cuda:0")
    )
    for name in ("x0", "y0", "width", "height"):
        assert abs(getattr(here, name) - getattr(there, name)) <= 1
