"""Images of a World as a camera sees it: masks, depth and body indices, offscreen, of all its worlds at once.

Everything is drawn on the world's device by :mod:`nuno.camera.raster` and stays there: results are Warp
arrays (``.numpy()`` copies them). Bodies that are the same in all worlds are drawn once and shared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, view
from nuno.errors import InvalidInputError, UnknownNameError

if TYPE_CHECKING:
    from nuno.numbers.device_array import DeviceArray

CHUNK_BYTES = 512 * 2**20  # key images held at a time; 8,192 worlds of 320 x 240 px would be 2.5 GB at once
# With distortion, static meshes are split until an edge spans 1/20 of its depth: for k1 = 0.3, half a metre
# off the axis at one metre, straight edges then leave the curve by 3e-4 of the focal length (0.14 px at 500).
DISTORTED_EDGE = 0.05
_MAX_SPLITS = 64  # of a mesh's extent, so that a mesh that touches the camera stays drawable


def render_masks(
    world: Any, camera: Camera, body: Any, *, region: Region | None = None, without: Iterable[Any] = (),
    cloth_thickness: float = 0.0,
) -> DeviceArray:  # fmt: skip
    """Return where a body is seen, and not hidden by another.

    Args:
        world: A World.
        camera: The camera; ``camera.scaled(0.5)`` draws a quarter of the pixels.
        body: One of the world's bodies, or its name. A body of another world stands for the one of the same
            name (a body and its imagined copies).
        region: What part of the image to draw; None is all of it.
        without: Bodies (or names) to leave out, e.g. the hand.
        cloth_thickness: [m], how thick cloths are drawn; 0 draws their middle surface.

    Returns:
        bool Warp array on the world's device, (h, w) for a single world, else (worlds, h, w).

    Raises:
        UnknownNameError: the world has no such body.
        InvalidInputError: the region is not inside the image, or the camera's distortion cannot be drawn.
    """
    target = body_index(world, body)
    label = [0 if k == target else 1 for k in range(len(world.bodies))]
    hidden = _hidden(world, without)
    if target in hidden:
        raise InvalidInputError(f"the body {world.bodies[target].name!r} is to be drawn and to be left out")
    return _render(world, camera, region, label, hidden, cloth_thickness, wp.bool, raster.masks_of)


def render_depth(
    world: Any, camera: Camera, *, region: Region | None = None, without: Iterable[Any] = (),
    cloth_thickness: float = 0.0,
) -> DeviceArray:  # fmt: skip
    """Depth along the optical axis.

    Args:
        world: A World.
        camera: The camera.
        region: What part of the image to draw; None is all of it.
        without: Bodies (or names) to leave out.
        cloth_thickness: [m], how thick cloths are drawn.

    Returns:
        float32 Warp array [m] in steps of 10 um, inf where nothing is seen; shape and device as of
        :func:`render_masks`.

    Raises:
        UnknownNameError: a body to leave out is not in the world.
        InvalidInputError: the region is not inside the image, or the camera's distortion cannot be drawn.
    """
    label = [0] * len(world.bodies)
    hidden = _hidden(world, without)
    return _render(world, camera, region, label, hidden, cloth_thickness, wp.float32, raster.depths_of)


def render_ids(
    world: Any, camera: Camera, *, region: Region | None = None, without: Iterable[Any] = (),
    cloth_thickness: float = 0.0,
) -> DeviceArray:  # fmt: skip
    """Return which body is seen: its index in ``world.bodies``, -1 where nothing is.

    Args:
        world: A World.
        camera: The camera.
        region: What part of the image to draw; None is all of it.
        without: Bodies (or names) to leave out; indices stay those of ``world.bodies``.
        cloth_thickness: [m], how thick cloths are drawn.

    Returns:
        int32 Warp array, shape and device as of :func:`render_masks`. At equal depth the lower index is seen.

    Raises:
        UnknownNameError: a body to leave out is not in the world.
        InvalidInputError: the region is not inside the image, or the camera's distortion cannot be drawn.
    """
    label = list(range(len(world.bodies)))
    hidden = _hidden(world, without)
    return _render(world, camera, region, label, hidden, cloth_thickness, wp.int32, raster.ids_of)


def body_index(world: Any, body: Any) -> int:
    """Return a body's index in ``world.bodies``; the body may be one of another world, or a name.

    Raises:
        UnknownNameError: the world has no such body.
    """
    bodies = list(world.bodies)
    for k, candidate in enumerate(bodies):
        if candidate is body:
            return k
    name = body if isinstance(body, str) else body.name if hasattr(body, "name") else repr(body)
    for k, candidate in enumerate(bodies):
        if candidate.name == name:
            return k
    raise UnknownNameError("body", str(name), [str(b.name) for b in bodies])


def _hidden(world: Any, without: Iterable[Any]) -> set[int]:
    return {body_index(world, body) for body in without}


def _render(
    world: Any, camera: Camera, region: Region | None, labels: list[int], hidden: set[int],
    cloth_thickness: float, dtype: Any, read: Callable[..., wp.array],
) -> Any:  # fmt: skip
    if not isinstance(camera, Camera):
        raise InvalidInputError(f"a Camera is needed to draw with, got {type(camera).__name__}")
    region = Region.full(camera) if region is None else region
    seen = view(camera, region)
    device, worlds = world.device, int(world.world_count)
    with_ids = read is raster.ids_of

    def embedded(body: Any) -> bool:
        return getattr(body.shape, "is_soft", False)

    def draw(keys: wp.array, body: Any, vertices: Any, label: int) -> None:
        thickness = cloth_thickness if getattr(body.shape, "is_cloth", False) else 0.0
        if body.shape.kind == "plane":  # endless, so not drawn as triangles
            raster.draw_depth(keys, _plane_depth(camera, region, vertices[0], body.faces), label)
            return
        faces = np.asarray(body.skin()[1] if embedded(body) else body.faces)
        if seen.distorted and not body.is_dynamic:
            vertices, faces = _split(camera, vertices[0], faces)
            vertices = vertices[None]
        points: Any = vertices
        if not isinstance(vertices, wp.array):
            points = wp.array(np.ascontiguousarray(vertices, dtype=np.float32), dtype=wp.vec3, device=device)
        triangles: wp.array = wp.array(np.ascontiguousarray(faces, dtype=np.int32), dtype=wp.vec3i, device=device)
        raster.draw(keys, points, triangles, seen, label, thickness=thickness)

    layer = raster.key_images(1, region, device, ids=with_ids)
    differing: list[tuple[Any, Any, int]] = []
    for k, body in enumerate(world.bodies):
        if k in hidden:
            continue
        if worlds > 1 and _moves_on_device(world, body):
            differing.append((body, world.state(body)["positions"], labels[k]))
            continue
        vertices = np.asarray(body.skin()[0] if embedded(body) else body.vertices)
        if vertices.ndim == 2:
            vertices = vertices[None]
        if (vertices[-1] == vertices[0]).all() and (vertices[1:] == vertices[0]).all():
            draw(layer, body, vertices[:1], labels[k])
        else:
            differing.append((body, vertices, labels[k]))

    out = wp.empty((worlds, region.height, region.width), dtype=dtype, device=device)
    size = max(1, CHUNK_BYTES // ((8 if with_ids else 4) * region.width * region.height))
    keys = raster.key_images(min(size, worlds), region, device, ids=with_ids)
    for first in range(0, worlds, size):
        last = min(first + size, worlds)
        chunk = keys[: last - first]
        raster.clear(chunk, layer)
        for body, vertices, label in differing:
            if body.shape.kind == "plane" or (seen.distorted and not body.is_dynamic):
                for k in range(first, last):  # what draw() computes of one world's vertices
                    draw(chunk[k - first : k - first + 1], body, vertices[k : k + 1], label)
            else:
                draw(chunk, body, vertices[first:last], label)
        read(chunk, out=out[first:last])
    return out[0] if worlds == 1 else out


def _moves_on_device(world: Any, body: Any) -> bool:
    """Return True if the drawn vertices are those that a batch's solver has, which need not pass the host."""
    return getattr(body.shape, "is_cloth", False) and body.is_dynamic and hasattr(world, "state")


def _plane_depth(camera: Camera, region: Region, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Depth (h, w) [m] of the endless plane through a mesh's first face; inf beyond the horizon."""
    a, b, c = vertices[np.asarray(faces)[0]].astype(float)
    normal = np.cross(b - a, c - a)
    v, u = np.mgrid[region.y0 : region.y0 + region.height, region.x0 : region.x0 + region.width]
    towards = camera.rays(np.stack([u, v], axis=-1)) @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = ((a - camera.camera_to_world[:3, 3]) @ normal) / towards
    return np.where(depth > 0.0, depth, np.inf)


def _split(camera: Camera, vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a mesh's triangles until edges are short enough to be drawn straight under distortion."""
    from trimesh import remesh

    extent = float(np.ptp(vertices, axis=0).max())
    nearest = float(camera.depth_of(vertices).min())
    longest = max(DISTORTED_EDGE * nearest, extent / _MAX_SPLITS)
    if not np.isfinite(longest) or longest <= 0.0:
        return vertices, faces
    return remesh.subdivide_to_size(vertices, faces, longest, max_iter=20)
