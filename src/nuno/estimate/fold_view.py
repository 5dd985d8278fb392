"""A replayed fold as the camera sees it: the cloth behind the table's edge and the hands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, View, view
from nuno.estimate.futures import DRAWN_THICKNESS
from nuno.shapes.shape import Sphere

if TYPE_CHECKING:
    from nuno.bodies.body import Body

FAR = 1.0e3
"""[m] How far below everything a hand is put that is not to be drawn."""
SHOWN_TABLE, SHOWN_HAND = raster.LAST_LABEL, raster.LAST_LABEL - 1
AMBIENT = 0.35
"""Share of the light that reaches a face from everywhere."""
LAMP = np.array((-0.35, -0.25, 0.9))
CLOTH_COLOUR = "#4d85cc"
"""The colour of the cloth in recordings."""
UPPER, LOWER, HAND, TABLE = (0.30, 0.52, 0.80), (0.92, 0.62, 0.27), (0.22, 0.22, 0.24), (0.86, 0.86, 0.84)


def hand_spheres(positions: np.ndarray, seen: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The hands as one mesh a frame: vertices (frames, n, 3) [m], faces (m, 3).

    Args:
        positions: (frames, hands, 3) [m].
        seen: (frames, hands) bool, which of them are there.
        radius: [m]
    """
    points, triangles = Sphere(radius).mesh()
    centres = np.where(seen[..., None], positions, (0.0, 0.0, -FAR))
    vertices = (centres[:, :, None] + points).reshape(len(positions), -1, 3)
    faces = np.concatenate([triangles + k * len(points) for k in range(positions.shape[1])])
    return vertices, faces


def draw_masks(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, *, table: Body, hands: tuple[np.ndarray, np.ndarray],
    device: str,
) -> np.ndarray:  # fmt: skip
    """Return where the cloth is seen, and hidden neither by the table's edge nor by the hands, frame by frame.

    Args:
        vertices: (frames, n, 3) float [m].
        faces: (m, 3) int.
        camera: The camera.
        table: The table; an endless one hides nothing.
        hands: From `hand_spheres`.
        device: Where to draw.

    Returns:
        (frames, h, w) bool.
    """
    looking = view(camera)
    keys = raster.key_images(len(vertices), Region.full(camera), device)
    _begin_with(table, keys, looking, 1)
    raster.draw(keys, _points(vertices, device), _faces(faces, device), looking, 0, thickness=DRAWN_THICKNESS)
    raster.draw(keys, _points(hands[0], device), _faces(hands[1], device), looking, 1)
    return raster.masks_of(keys).numpy()


def paint(
    vertices: np.ndarray, faces: np.ndarray, camera: Camera, *, table: Body, hands: tuple[np.ndarray, np.ndarray],
    device: str,
) -> np.ndarray:  # fmt: skip
    """Pictures of the imagined scene, (frames, h, w, 3) uint8 RGB; the cloth's two sides have two colours.

    The arguments are those of `draw_masks`.
    """
    looking = view(camera)
    keys = raster.key_images(len(vertices), Region.full(camera), device, ids=True)
    _begin_with(table, keys, looking, SHOWN_TABLE)
    raster.draw(keys, _points(vertices, device), _faces(faces, device), looking, None, thickness=DRAWN_THICKNESS)
    raster.draw(keys, _points(hands[0], device), _faces(hands[1], device), looking, SHOWN_HAND)
    ids = raster.ids_of(keys).numpy()
    picture = np.ones((*ids.shape, 3))
    picture[ids == SHOWN_TABLE], picture[ids == SHOWN_HAND] = TABLE, HAND
    lamp = LAMP / np.linalg.norm(LAMP)
    for k, image in enumerate(ids):
        cloth = (image >= 0) & (image < len(faces))
        a, b, c = (vertices[k][faces[:, corner]] for corner in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        towards = ((camera.camera_to_world[:3, 3] - a) * normal).sum(axis=1) > 0
        light = AMBIENT + (1.0 - AMBIENT) * np.clip(np.where(towards, 1.0, -1.0) * (normal @ lamp), 0.0, 1.0)
        colour = np.where(towards[:, None], UPPER, LOWER) * light[:, None]
        picture[k][cloth] = colour[image[cloth]]
    return (np.clip(picture, 0.0, 1.0) * 255).astype(np.uint8)


def _begin_with(table: Body, keys: wp.array, looking: View, label: int) -> None:
    """Reset key images to the table, where it has a border."""
    device: Any = keys.device
    layer = raster.key_images(1, Region(0, 0, looking.width, looking.height), device, ids=keys.dtype == wp.int64)
    if table.shape.kind != "plane":
        raster.draw(
            layer, _points(np.asarray(table.vertices)[None], device), _faces(table.faces, device), looking, label
        )
    raster.clear(keys, layer)


def _points(values: np.ndarray, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=wp.vec3, device=device)


def _faces(values: np.ndarray, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.int32), dtype=wp.vec3i, device=device)
