"""Silhouettes of many imagined cloths as tensors: drawn, compared all with all, given noise, cut out.

For `outline_pairs.py`; PyTorch and Warp share the memory. Scores are those of `nuno.estimate.similarity`, to rounding.
"""
# ruff: noqa: UP018, RUF046  (in Warp int(0) is a variable, 0 a constant that loops cannot change)

from __future__ import annotations

from typing import Any

import numpy as np
import torch
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, view
from nuno.estimate.futures import DRAWN_THICKNESS
from nuno.estimate.learned import BORDER
from nuno.estimate.outline_net import LEVELS, SIZE
from nuno.estimate.rotations import view_of_turned

NOISE_LENGTH = 4.0  # [px] of 640

wp.set_module_options({"enable_backward": False})


@wp.kernel
def _across(rim: wp.array3d[wp.uint8], out: wp.array3d[wp.int16]):
    n, y = wp.tid()
    width = rim.shape[2]
    last = int(-10000)
    for x in range(width):
        if rim[n, y, x] != wp.uint8(0):
            last = x
        out[n, y, x] = wp.int16(wp.min(x - last, 10000))
    last = int(20000)
    for k in range(width):
        x = width - 1 - k
        if rim[n, y, x] != wp.uint8(0):
            last = x
        out[n, y, x] = wp.int16(wp.min(last - x, int(out[n, y, x])))


@wp.kernel
def _distance(across: wp.array3d[wp.int16], most: float, out: wp.array3d[wp.float16]):
    n, y, x = wp.tid()
    best = int(across[n, y, x]) * int(across[n, y, x])
    k = int(1)
    while k < across.shape[1] and k * k < best:
        if y - k >= 0:
            best = wp.min(best, k * k + int(across[n, y - k, x]) * int(across[n, y - k, x]))
        if y + k < across.shape[1]:
            best = wp.min(best, k * k + int(across[n, y + k, x]) * int(across[n, y + k, x]))
        k += 1
    out[n, y, x] = wp.float16(wp.min(most, wp.sqrt(float(best))))


def masks(positions: wp.array, faces: wp.array, camera: Camera, hand: np.ndarray, turn: float, world: Any) -> Any:
    """(n, h, w) bool tensor: the cloths behind the table's edge, turned about the hand's vertical [rad]."""
    region, device = Region.full(camera), positions.device
    layer = raster.key_images(1, region, device)
    table = world.find("table")
    points = wp.array(np.asarray(table.vertices, dtype=np.float32)[None], dtype=wp.vec3, device=device)
    raster.draw(layer, points, on_device(table.faces, device), view(camera, region), 1)
    keys = raster.key_images(positions.shape[0], region, device)
    raster.clear(keys, layer)
    looking = view(view_of_turned(camera, hand, turn), region)
    raster.draw(keys, positions, faces, looking, 0, thickness=DRAWN_THICKNESS)
    return (wp.to_torch(keys) & 1) == 0


def on_device(faces: np.ndarray, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(faces, dtype=np.int32), dtype=wp.vec3i, device=device)


def rims(images: Any, hidden: Any) -> Any:
    """Contours of masks (n, h, w), as `nuno.estimate.similarity` has them."""
    background = ~(images | hidden)
    near = torch.zeros_like(images)
    near[:, :, 1:] |= background[:, :, :-1]
    near[:, :, :-1] |= background[:, :, 1:]
    near[:, 1:] |= background[:, :-1]
    near[:, :-1] |= background[:, 1:]
    return images & near


def distances(rim: Any) -> Any:
    """Distance [px] to the nearest contour pixel, (n, h, w) half precision."""
    found = wp.from_torch(rim.to(torch.uint8).contiguous())
    across = wp.empty(found.shape, dtype=wp.int16, device=found.device)
    out = wp.empty(found.shape, dtype=wp.float16, device=found.device)
    wp.launch(_across, dim=found.shape[:2], inputs=[found, across], device=found.device)
    wp.launch(_distance, dim=found.shape, inputs=[across, float(np.hypot(*rim.shape[1:])), out], device=found.device)
    return wp.to_torch(out)


def compare(real: Any, imagined: Any, hidden: Any, pixel: float) -> tuple[Any, Any]:
    """Contour distances [px of 640] and overlaps of all pairs, (reals, imagined) each."""
    real_rim, rim = rims(real, hidden), rims(imagined, hidden)

    def product(a: Any, b: Any) -> Any:
        return a.flatten(1).float() @ b.flatten(1).float().T

    both = product(real, imagined)
    area, other = real.flatten(1).sum(1).float(), imagined.flatten(1).sum(1).float()
    overlap = both / (area[:, None] + other[None] - both).clamp(min=1)
    there = product(real_rim, distances(rim)) / real_rim.flatten(1).sum(1).float()[:, None].clamp(min=1)
    count = rim.flatten(1).sum(1).float()
    back = product(distances(real_rim), rim) / count[None].clamp(min=1)
    contour = torch.where(count[None] > 0, (there + back) / 2, float(np.hypot(*real.shape[1:])))
    return contour * pixel, overlap


def with_noise(images: Any, noise_px: float, pixel: float, generator: Any) -> Any:
    """Masks (n, h, w) whose edges are displaced by smooth noise [px of 640], as shares of pixels."""
    n, height, width = images.shape
    reach = int(6 * NOISE_LENGTH / pixel) | 1
    bell = torch.exp(-0.5 * ((torch.arange(reach, device=images.device) - reach // 2) * pixel / NOISE_LENGTH) ** 2)
    noise = torch.randn(2 * n, 1, height, width, device=images.device, generator=generator)
    for shape, padding in (((1, 1, 1, reach), (0, reach // 2)), ((1, 1, reach, 1), (reach // 2, 0))):
        noise = torch.nn.functional.conv2d(noise, bell.view(shape), padding=padding)
    noise = (noise * (noise_px / pixel / noise.std())).view(n, 2, height, width)
    y, x = torch.meshgrid(*(torch.arange(k, device=images.device) for k in (height, width)), indexing="ij")
    return _sampled(images.float(), x + noise[:, 0], y + noise[:, 1])


def _sampled(images: Any, x: Any, y: Any) -> Any:
    height, width = images.shape[1:]
    at = torch.stack([2 * x / (width - 1) - 1, 2 * y / (height - 1) - 1], dim=-1)
    return torch.nn.functional.grid_sample(images[:, None], at, align_corners=True)[:, 0]


def pictures(images: Any, boxes: Any) -> np.ndarray:
    """Squares (n, 3: middle x, y, side) of images (n, h, w), SIZE px wide, two pixels of 4 bits in a byte."""
    steps = (torch.arange(2 * SIZE, device=images.device) + 0.5) / (2 * SIZE) - 0.5
    found = []
    for k in range(0, len(images), 4096):
        box = boxes[k : k + 4096]
        x, y = (box[:, axis, None] + steps * box[:, 2, None] for axis in (0, 1))
        shape = (len(box), 2 * SIZE, 2 * SIZE)
        samples = _sampled(images[k : k + 4096].float(), x[:, None].expand(shape), y[:, :, None].expand(shape))
        part = torch.nn.functional.avg_pool2d(samples[:, None], 2)[:, 0]
        levels = (part * LEVELS).round().to(torch.uint8).flatten(1)
        found.append(((levels[:, ::2] << 4) | levels[:, 1::2]).cpu().numpy())
    return np.concatenate(found)


def boxes_of(real: Any) -> Any:
    """(n, 3) middle x, y and side of the squares about masks (n, h, w)."""
    ends = []
    for axis in (1, 2):  # columns, rows
        hit = real.any(axis)
        index = torch.arange(hit.shape[1], device=real.device)
        ends.append((torch.where(hit, index, hit.shape[1]).amin(1), torch.where(hit, index, -1).amax(1)))
    (left, right), (top, bottom) = ends
    side = BORDER * (torch.maximum(right - left, bottom - top) + 1)
    return torch.stack([(left + right) / 2, (top + bottom) / 2, side], dim=1).float()
