"""The pattern of a cloth, taken from the image before and looked for in the image after.

A future says which point of the cloth is in front at every pixel of the image after, and how it is turned to the light.
With T the colour of that point in the image before, n its normal on the side that is seen, and y the colour in the
image after, two models of y are fitted, both for light that is not known:

- patterned: y = T (a + b . n)
- plain: y = mean of T (a + b . n)

a and b, (1 + 3) numbers, are the least squares fit over the pixels. What the pattern explains beyond light and folds
is pattern = 1/2 log(patterned residual / plain residual): the lower, the better the future, and exactly 0 for a cloth
without any pattern, so that plain cloths are ranked by their silhouettes alone. Both sides of the cloth are taken to
look alike.

How a lifted cloth folds is known the better the nearer to the hand, so pixels weigh exp(-distance / `REACH`), and the
pattern is blurred to `BLUR`: finer detail would ask for futures that are right to millimetres.
"""
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, assignment, arg-type, valid-type"

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp

from nuno.camera import raster
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region
from nuno.camera.rectangle import ClothRectangle
from nuno.numbers.cpu_compiler import compile_quickly

compile_quickly(__name__)

SCALE = 0.25
"""Patterns are compared at a quarter of the image's resolution: futures are not right to a pixel."""
REACH = 0.08
"""[m] Distance from the hand over which a pixel's weight falls to 1/e."""
BLUR = 0.01
"""[m] Standard deviation of the pattern's blur."""
TEXEL = 0.004
"""[m] Size of a pixel of the pattern's map."""
FLOOR = 0.003
"""Variance, relative to the square of the cloth's brightness, that noise and the camera explain."""
_RIM = 2.0  # [px] next to the cloth's edge colours are taken from further inside: at the edge table mixes in
_RIDGE = 1e-3  # of the mean diagonal, where too few normals are seen to tell light from turn

_FACE = wp.constant(wp.int64((1 << raster.ID_BITS) - 1))


@dataclass(frozen=True, eq=False)
class Pattern:
    """The cloth's pattern before, and the image after where it is looked for.

    Attributes:
        rectangle: The cloth before.
        texture: (rows, columns, 3) float32, colours over the cloth, u along columns and v along rows; relative to the
            mean brightness of the cloth.
        mean: (3,) float, the texture's mean colour.
        camera: The camera at the resolution of comparison.
        region: The part of its image that counts.
        image: (h, w, 3) float32, the region's colours after, relative to the same brightness.
        weights: (h, w) float32, 0 where there is no cloth.
        variance: Weighted variance of the image's colours, summed over channels.
    """

    rectangle: ClothRectangle
    texture: np.ndarray
    mean: np.ndarray
    camera: Camera
    region: Region
    image: np.ndarray
    weights: np.ndarray
    variance: float
    _on: dict[str, tuple[wp.array, wp.array, wp.array]] = field(default_factory=dict)

    def on(self, device: str | wp.Device) -> tuple[wp.array, wp.array, wp.array]:
        """Texture, image and weights on a device, for this pattern and those that differ from it by the camera."""
        name = str(wp.get_device(device))
        if name not in self._on:
            self._on[name] = (
                _upload(self.texture, wp.vec3, device), _upload(self.image, wp.vec3, device),
                _upload(self.weights, float, device),
            )  # fmt: skip
        return self._on[name]


def _upload(values: np.ndarray, dtype: type, device: Any) -> wp.array:
    return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=dtype, device=device)


def find_pattern(
    before: np.ndarray, after: np.ndarray, mask: np.ndarray, rectangle: ClothRectangle, camera: Camera, hand: np.ndarray
) -> Pattern | None:
    """Map the cloth's colours before, and prepare the image after for comparison.

    Args:
        before: (h, w, 3) uint8 RGB, the cloth flat.
        after: (h, w, 3) uint8 RGB, the cloth in the hand.
        mask: (h, w) bool, the cloth after, without what the hand hides.
        rectangle: The cloth before.
        camera: The camera of both images.
        hand: (3,) float, the held point [m].

    Returns:
        The pattern, or None where too little of the cloth is seen to compare: no whole pixel of `SCALE` inside the
        mask, or a black cloth.
    """
    import cv2

    texture = _texture(before, rectangle, camera)
    mean = texture.mean(axis=(0, 1), dtype=float)
    brightness = float(np.sqrt((mean**2).mean()))
    small = camera.scaled(SCALE)

    def shrink(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), (small.width, small.height), interpolation=cv2.INTER_AREA)

    inside = shrink(mask) > 0.99
    if brightness < 1.0 or not inside.any():
        return None
    u, v = np.meshgrid(np.arange(small.width), np.arange(small.height))
    centre = small.project(hand)
    distance = np.hypot(u - centre[0], v - centre[1]) * small.depth_of(hand) / small.fx
    rows, columns = np.nonzero(inside.any(axis=1))[0], np.nonzero(inside.any(axis=0))[0]
    region = Region(
        int(columns[0]), int(rows[0]), int(columns[-1] - columns[0] + 1), int(rows[-1] - rows[0] + 1)
    )  # fmt: skip
    part = np.s_[region.y0 : region.y0 + region.height, region.x0 : region.x0 + region.width]
    weights = np.where(inside, np.exp(-distance / REACH), 0.0)[part].astype(np.float32)
    image = shrink(after)[part] / np.float32(brightness)
    share = weights[..., None].astype(float) / weights.sum(dtype=float)
    variance = float((share * (image - (share * image).sum(axis=(0, 1))) ** 2).sum())
    return Pattern(
        rectangle, texture / np.float32(brightness), mean / brightness, small, region, image, weights, variance
    )


def _texture(image: np.ndarray, rectangle: ClothRectangle, camera: Camera) -> np.ndarray:
    """Colours over the cloth (rows, columns, 3) float32, u along columns and v along rows, blurred."""
    import cv2

    columns, rows = (max(8, round(side / TEXEL)) for side in (rectangle.long_m, rectangle.short_m))
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    u, v = (np.clip(x, rim, 1.0 - rim)[..., None] for x, rim in zip((u, v), _rims(rectangle, camera), strict=True))
    first, along, _, across = rectangle.corners
    pixels = camera.project(first + u * (along - first) + v * (across - first)).astype(np.float32)
    colours = cv2.remap(
        image.astype(np.float32), pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return cv2.GaussianBlur(colours, (0, 0), BLUR / TEXEL)


def _rims(rectangle: ClothRectangle, camera: Camera) -> np.ndarray:
    """Shares (2,) of the longer and shorter side that lie within `_RIM` of an edge in the image."""
    pixels = camera.project(rectangle.grid_points(21, 21))
    along, across = pixels[1:, :-1] - pixels[:-1, :-1], pixels[:-1, 1:] - pixels[:-1, :-1]
    area = np.abs(along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0])
    # how far a step of 1/20 of one side leads away from the edge along the other
    away = [(area / np.linalg.norm(other, axis=-1)).min() for other in (across, along)]
    return np.minimum(_RIM / (20.0 * np.maximum(away, 1e-6)), 0.2)


@wp.func
def _colour(texture: wp.array2d[wp.vec3], u: float, v: float):
    """Colour at a point of the cloth, interpolated between texels."""
    x = wp.clamp(u * float(texture.shape[1]) - 0.5, 0.0, float(texture.shape[1] - 1))
    y = wp.clamp(v * float(texture.shape[0]) - 0.5, 0.0, float(texture.shape[0] - 1))
    column = wp.min(int(x), texture.shape[1] - 2)
    row = wp.min(int(y), texture.shape[0] - 2)
    s = x - float(column)
    t = y - float(row)
    above = (1.0 - s) * texture[row, column] + s * texture[row, column + 1]
    below = (1.0 - s) * texture[row + 1, column] + s * texture[row + 1, column + 1]
    return (1.0 - t) * above + t * below


@wp.kernel
def _sum_rows(
    keys: wp.array3d[wp.int64],
    positions: wp.array2d[wp.vec3],
    faces: wp.array[wp.vec3i],
    uv: wp.array[wp.vec2],
    texture: wp.array2d[wp.vec3],
    image: wp.array2d[wp.vec3],
    weights: wp.array2d[float],
    rays: wp.array2d[wp.vec3],
    origin: wp.vec3,
    mean: wp.vec3,
    squares_out: wp.array2d[wp.mat44],  # patterned model
    products_out: wp.array2d[wp.vec4],
    plain_squares_out: wp.array2d[wp.mat44],
    plain_products_out: wp.array2d[wp.vec4],
    totals_out: wp.array2d[wp.vec2],
):
    """One thread sums both models' normal equations over one row of one world."""
    world, row = wp.tid()
    squares = wp.mat44()
    products = wp.vec4()
    plain_squares = wp.mat44()
    plain_products = wp.vec4()
    totals = wp.vec2()
    for column in range(weights.shape[1]):
        weight = weights[row, column]
        face = int(keys[world, row, column] & _FACE)
        if weight > 0.0 and face < faces.shape[0]:
            corners = faces[face]
            a = positions[world, corners[0]]
            b = positions[world, corners[1]]
            c = positions[world, corners[2]]
            normal = wp.cross(b - a, c - a)
            ray = rays[row, column]
            facing = wp.dot(ray, normal)
            size = wp.dot(normal, normal)
            if facing != 0.0 and size > 0.0:
                point = origin + wp.dot(a - origin, normal) / facing * ray
                # a pixel of a triangle seen edge-on may meet its plane beside it
                at_b = wp.clamp(wp.dot(wp.cross(point - a, c - a), normal) / size, 0.0, 1.0)
                at_c = wp.clamp(wp.dot(wp.cross(b - a, point - a), normal) / size, 0.0, 1.0)
                place = (1.0 - at_b - at_c) * uv[corners[0]] + at_b * uv[corners[1]] + at_c * uv[corners[2]]
                n = normal * (-wp.sign(facing) / wp.sqrt(size))
                light = wp.vec4(1.0, n[0], n[1], n[2])
                colour = _colour(texture, place[0], place[1])
                seen = image[row, column]
                turned = weight * wp.outer(light, light)
                squares += wp.dot(colour, colour) * turned
                products += weight * wp.dot(colour, seen) * light
                plain_squares += wp.dot(mean, mean) * turned
                plain_products += weight * wp.dot(mean, seen) * light
                totals += wp.vec2(weight * wp.dot(seen, seen), weight)
    squares_out[world, row] = squares
    products_out[world, row] = products
    plain_squares_out[world, row] = plain_squares
    plain_products_out[world, row] = plain_products
    totals_out[world, row] = totals


def load(device: str | wp.Device) -> None:
    """Compile or load the kernel for a device now, as is needed before several threads launch it."""
    wp.load_module(__name__, device=device)


def compare_pattern(
    keys: wp.array, positions: wp.array, faces: wp.array, uv: np.ndarray, pattern: Pattern
) -> np.ndarray:
    """Return how much of the image after the pattern explains, beyond light and folds.

    Where the cloth is in the image but not in a future, both models leave the image's whole variance.

    Args:
        keys: (worlds, h, w) int64 key images of the pattern's region, labels the faces' indices.
        positions: (worlds, n) vec3, vertices [m], on the same device.
        faces: (m,) vec3i.
        uv: (n, 2) float, where the vertices are on the cloth.
        pattern: What is looked for.

    Returns:
        (worlds,) float, half the logarithm of the ratio of residuals; 0 or more says that the pattern does not fit.
    """
    return begin_pattern(keys, positions, faces, uv, pattern)()


def begin_pattern(
    keys: wp.array, positions: wp.array, faces: wp.array, uv: np.ndarray, pattern: Pattern
) -> Callable[[], np.ndarray]:
    """Begin what `compare_pattern` does, and return a function that waits for the answer."""
    device, worlds, height = keys.device, keys.shape[0], keys.shape[1]
    region, camera = pattern.region, pattern.camera
    u, v = np.meshgrid(np.arange(region.width) + region.x0, np.arange(region.height) + region.y0)
    kinds = (wp.mat44, wp.vec4, wp.mat44, wp.vec4, wp.vec2)
    sums = [wp.empty((worlds, height), dtype=kind, device=device) for kind in kinds]
    wp.launch(
        _sum_rows, dim=(worlds, height), device=device,
        inputs=[
            keys, positions, faces, _upload(uv, wp.vec2, device), *pattern.on(device),
            _upload(camera.rays(np.stack([u, v], axis=-1)), wp.vec3, device),
            wp.vec3(*camera.camera_to_world[:3, 3].tolist()), wp.vec3(*pattern.mean.tolist()),
        ],
        outputs=sums,
    )  # fmt: skip
    return lambda: _unexplained([s.numpy().sum(axis=1, dtype=float) for s in sums], pattern)


def _unexplained(sums: list[np.ndarray], pattern: Pattern) -> np.ndarray:
    """Half the logarithm of the ratio of residuals (worlds,), from the sums over each world's pixels."""
    squares, products, plain_squares, plain_products, totals = sums
    whole = pattern.weights.sum(dtype=float)
    missed = pattern.variance * np.maximum(1.0 - totals[:, 1] / whole, 0.0) + FLOOR
    left = [
        np.maximum(totals[:, 0] - _explained(a, b), 0.0) / whole + missed
        for a, b in ((squares, products), (plain_squares, plain_products))
    ]
    return 0.5 * np.log(left[0] / left[1])


def _explained(squares: np.ndarray, products: np.ndarray) -> np.ndarray:
    """Sum of squares (worlds,) that the least squares fit takes away, with a slight ridge."""
    ridge = _RIDGE * np.trace(squares, axis1=1, axis2=2) / 4.0 + 1e-12
    solved = np.linalg.solve(squares + ridge[:, None, None] * np.eye(4), products[..., None])
    return (products[:, None, :] @ solved)[:, 0, 0]
