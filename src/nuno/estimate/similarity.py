"""Similarity of a simulated silhouette and a real one: the paper's eq. (1), overlap, and contour distance.

All scores are built from integer counts and from distances in steps of 1/1024 px, summed as 64-bit integers,
so they are exact in order: the same bits for a world alone and anywhere in a batch, on any number of threads.
"""
# ruff: noqa: UP018, RUF046  (in Warp int(0) is a variable, 0 a constant that loops cannot change)
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, call-overload, assignment, arg-type, valid-type"

from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from nuno.camera.image_region import Region
from nuno.camera.raster import MASK_BACKGROUND
from nuno.errors import InvalidInputError, UnknownNameError
from nuno.estimate.mask_threshold import cut, images_of, is_real
from nuno.numbers.cpu_compiler import compile_quickly

compile_quickly(__name__)

SCORES = ("eq1", "iou", "chamfer")
DISTANCE_STEPS = 1024  # a pixel; contours are a few thousand pixels, so sums stay far below 2**63

_STEPS = wp.constant(float(DISTANCE_STEPS))
_NONE = wp.constant(1 << 14)  # a column distance that means "no contour in this row"; its square fits 32 bits
_AREA, _BOTH, _SUM_X, _SUM_Y, _CONTOUR, _TO_REAL, _TO_SIM = (wp.constant(i) for i in range(7))
_SUM_COUNT = 7


class Silhouette:
    """A real mask, prepared once for comparison with many simulated ones.

    A contour pixel is a pixel of the mask with a 4-neighbour in the image that is not in the mask. Ignored
    pixels count neither as mask nor as background, and make no contour: where a hand hides the cloth, the
    visible edge is the hand's. Likewise where the image ends.

    Attributes:
        mask: (h, w) bool, the real mask without ignored pixels.
        ignore: (h, w) bool, pixels that do not count.
        contour: (k, 2) int, contour pixels (x, y) of the mask.
        distance: (h, w) float32 [px], Euclidean distance to the nearest contour pixel; the image's diagonal
            everywhere if there is no contour.
        diagonal: [px], the image's diagonal.

    Args:
        mask: (h, w) bool, or numbers of which the non-zero ones are the mask.
        ignore: (h, w) likewise, or None.

    Raises:
        InvalidInputError: a mask is not a two-dimensional image of numbers, or the two differ in size.
    """

    def __init__(self, mask: ArrayLike, ignore: ArrayLike | None = None) -> None:
        real = _image(mask, "mask")
        self.ignore = np.zeros_like(real) if ignore is None else _image(ignore, "ignore mask")
        if self.ignore.shape != real.shape:
            raise InvalidInputError(f"the ignore mask has shape {self.ignore.shape}, the mask {real.shape}")
        self.mask = real & ~self.ignore
        self.diagonal = float(np.hypot(*real.shape))
        rim = contour(self.mask, self.ignore)
        self.contour = np.argwhere(rim)[:, ::-1].astype(np.int32)
        self.distance = np.full(real.shape, self.diagonal, dtype=np.float32)
        if len(self.contour):
            import cv2

            self.distance = cv2.distanceTransform((~rim).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        self._on: dict[str, tuple[wp.array, ...]] = {}

    def on(self, device: str | wp.Device) -> tuple[wp.array, ...]:
        """Device arrays: state (h, w) (bit 0 mask, bit 1 ignored), distance (h, w) in steps, contour (k,)."""
        name = str(wp.get_device(device))
        if name not in self._on:
            state = self.mask.astype(np.uint8) | (self.ignore.astype(np.uint8) << 1)
            steps = np.rint(self.distance.astype(np.float64) * DISTANCE_STEPS).astype(np.int32)
            points: wp.array = wp.array(self.contour.reshape(-1, 2), dtype=wp.vec2i, device=device)
            self._on[name] = (
                wp.array(state, dtype=wp.uint8, device=device),
                wp.array(steps, dtype=wp.int32, device=device),
                points,
            )  # fmt: skip
        return self._on[name]


def _image(mask: ArrayLike, name: str) -> np.ndarray:
    image = np.asarray(mask)
    if image.ndim != 2 or image.size == 0 or image.dtype.kind not in "biuf":
        raise InvalidInputError(f"the {name} must be a (h, w) image of numbers, got {image.dtype} {image.shape}")
    if max(image.shape) >= 1 << 14:
        raise InvalidInputError(f"the {name} is {image.shape[1]} x {image.shape[0]} px; at most 16383 are supported")
    return image != 0


def contour(mask: np.ndarray, ignore: np.ndarray | None = None) -> np.ndarray:
    """Contour pixels (h, w) bool of a mask (h, w): with a 4-neighbour that is neither mask nor ignored."""
    mask = np.asarray(mask, dtype=bool)
    background = ~mask if ignore is None else ~(mask | ignore)
    near = np.zeros_like(mask)
    near[:, 1:] |= background[:, :-1]
    near[:, :-1] |= background[:, 1:]
    near[1:] |= background[:-1]
    near[:-1] |= background[1:]
    inside = mask if ignore is None else mask & ~ignore
    return inside & near


@wp.func
def _is_background(
    keys: wp.array3d[wp.int32], state: wp.array2d[wp.uint8], world: int, x: int, y: int, x0: int, y0: int
):
    """Return True if a pixel (image coordinates) is in the image, not in the simulated mask, and not ignored."""
    if x < 0 or y < 0 or x >= state.shape[1] or y >= state.shape[0]:
        return False
    if (state[y, x] & wp.uint8(2)) != wp.uint8(0):
        return False
    column = x - x0
    row = y - y0
    if column < 0 or row < 0 or column >= keys.shape[2] or row >= keys.shape[1]:
        return True
    return (keys[world, row, column] & 1) != 0


@wp.kernel
def _score_rows(
    keys: wp.array3d[wp.int32],
    state: wp.array2d[wp.uint8],
    distance: wp.array2d[wp.int32],
    x0: int,
    y0: int,
    with_contour: int,
    across_out: wp.array3d[wp.int16],
    sums_out: wp.array2d[wp.int64],
):
    """One thread counts one row of one world, and notes the columns' distances to its contour pixels."""
    world, row = wp.tid()
    y = row + y0
    width = keys.shape[2]
    area = int(0)
    both = int(0)
    sum_x = int(0)
    rim = int(0)
    to_real = wp.int64(0)
    last = int(-_NONE)
    for column in range(width):
        if (keys[world, row, column] & 1) == 0:
            x = column + x0
            pixel = int(state[y, x])
            if (pixel & 2) == 0:
                area += 1
                sum_x += x
                both += pixel
                if with_contour != 0:
                    if (
                        _is_background(keys, state, world, x - 1, y, x0, y0)
                        or _is_background(keys, state, world, x + 1, y, x0, y0)
                        or _is_background(keys, state, world, x, y - 1, x0, y0)
                        or _is_background(keys, state, world, x, y + 1, x0, y0)
                    ):
                        rim += 1
                        to_real += wp.int64(distance[y, x])
                        last = column
        if with_contour != 0:
            across_out[world, row, column] = wp.int16(wp.min(column - last, _NONE))
    if with_contour != 0 and rim > 0:
        next_one = int(_NONE)  # the way back: the nearest contour pixel on the right
        for step in range(width):
            column = width - 1 - step
            here = int(across_out[world, row, column])
            if here == 0:
                next_one = 0
            here = wp.min(here, next_one)
            across_out[world, row, column] = wp.int16(here)
            next_one = wp.min(next_one + 1, _NONE)
    if area > 0:
        wp.atomic_add(sums_out, world, _AREA, wp.int64(area))
        wp.atomic_add(sums_out, world, _BOTH, wp.int64(both))
        wp.atomic_add(sums_out, world, _SUM_X, wp.int64(sum_x))
        wp.atomic_add(sums_out, world, _SUM_Y, wp.int64(area) * wp.int64(y))
    if rim > 0:
        wp.atomic_add(sums_out, world, _CONTOUR, wp.int64(rim))
        wp.atomic_add(sums_out, world, _TO_REAL, to_real)


@wp.kernel
def _real_to_simulated(
    points: wp.array[wp.vec2i],
    across: wp.array3d[wp.int16],
    x0: int,
    y0: int,
    sums_out: wp.array2d[wp.int64],
):
    """One thread finds the distance from one real contour pixel to the contour of one world, exactly.

    Rows are visited outward from the pixel's own until they are farther than the best so far.
    """
    world, point = wp.tid()
    if sums_out[world, _CONTOUR] == wp.int64(0):
        return
    height = across.shape[1]
    width = across.shape[2]
    x = points[point][0] - x0
    y = points[point][1] - y0
    column = wp.clamp(x, 0, width - 1)
    outside = wp.abs(x - column)  # a pixel left or right of the region is that much farther from all of it
    best = int(2 * _NONE * _NONE)
    start = wp.clamp(y, 0, height - 1)
    up = start
    down = start + 1
    searching = int(1)
    while searching != 0:
        searching = 0
        if up >= 0 and (up - y) * (up - y) < best:
            step = int(across[world, up, column])
            if step < _NONE:
                best = wp.min(best, (up - y) * (up - y) + (step + outside) * (step + outside))
            up -= 1
            searching = 1
        if down < height and (down - y) * (down - y) < best:
            step = int(across[world, down, column])
            if step < _NONE:
                best = wp.min(best, (down - y) * (down - y) + (step + outside) * (step + outside))
            down += 1
            searching = 1
    wp.atomic_add(sums_out, world, _TO_SIM, wp.int64(wp.rint(wp.sqrt(float(best)) * _STEPS)))


@wp.kernel
def _to_keys(masks: wp.array3d[Any], keys_out: wp.array3d[wp.int32]):
    world, row, column = wp.tid()
    key = int(MASK_BACKGROUND)
    if masks[world, row, column]:
        key = 0
    keys_out[world, row, column] = key


for _kind in (wp.bool, wp.uint8):
    wp.overload(_to_keys, {"masks": wp.array3d[_kind]})


def load(device: str | wp.Device) -> None:
    """Compile or load the kernels for a device now, as is needed before several threads launch them."""
    wp.load_module(__name__, device=device)


def score_masks(
    keys: wp.array, real: Silhouette, *, region: Region | None = None, with_contour: bool = True
) -> dict[str, np.ndarray]:
    """Compare the masks of many worlds with a real one, on the masks' device.

    With S the simulated and R the real mask, N the number of pixels that are not ignored, and d the distance
    [px] to the nearest pixel of the other contour:

    - ``eq1`` = (|S and R| + |not S and not R|) / N, the paper's eq. (1); 0 to 1, higher is better;
    - ``iou`` = |S and R| / |S or R|; 1 if both are empty;
    - ``chamfer`` = (mean of d over S's contour + mean of d over R's contour) / 2 [px], lower is better; 0 if
      neither has a contour, the image's diagonal if just one has (a mask is empty, or fills the image);
    - ``area``: |S| [px]; ``centroid`` (worlds, 2): mean (x, y) of S [px], (-1, -1) if S is empty.

    Args:
        keys: (worlds, h, w) int32 key images of :mod:`nuno.camera.raster`, or bool or uint8 masks, as a Warp
            array or a NumPy array of masks (compared on the CPU). A slice of worlds may be given, also by
            several threads (after :func:`load`).
        real: The real silhouette, of the size of the whole image.
        region: What part of the image ``keys`` holds; pixels outside of it are background. None: all of it.
        with_contour: Without it the chamfer distance is left out, which saves most of the time.

    Returns:
        The scores by name, (worlds,) float64 each.

    Raises:
        InvalidInputError: shapes or types do not fit.
    """
    return begin_scores(keys, real, region=region, with_contour=with_contour)()


def begin_scores(
    keys: wp.array, real: Silhouette, *, region: Region | None = None, with_contour: bool = True
) -> Callable[[], dict[str, np.ndarray]]:
    """Begin what :func:`score_masks` does, and return a function that waits for the scores."""
    height, width = real.mask.shape
    region = Region(0, 0, width, height) if region is None else region
    keys = _keys(keys)
    if keys.shape[1:] != (region.height, region.width) or (
        region.x0 < 0 or region.y0 < 0 or region.x0 + region.width > width or region.y0 + region.height > height
    ):
        raise InvalidInputError(
            f"masks of {keys.shape[2]} x {keys.shape[1]} px and {region} do not fit a real mask of "
            f"{width} x {height} px; render with a camera of the mask's size, or pass the region"
        )
    worlds, device = keys.shape[0], keys.device
    state, distance, points = real.on(device)
    sums = wp.zeros((worlds, _SUM_COUNT), dtype=wp.int64, device=device)
    across = wp.empty(keys.shape if with_contour else (1, 1, 1), dtype=wp.int16, device=device)
    wp.launch(
        _score_rows, dim=(worlds, region.height), device=device,
        inputs=[keys, state, distance, region.x0, region.y0, int(with_contour), across, sums],
    )  # fmt: skip
    if with_contour and len(real.contour):
        wp.launch(
            _real_to_simulated, dim=(worlds, len(real.contour)), device=device,
            inputs=[points, across, region.x0, region.y0, sums],
        )  # fmt: skip
    return lambda: _from_sums(sums.numpy(), real, with_contour)


def _keys(masks: wp.array | np.ndarray) -> wp.array:
    if isinstance(masks, np.ndarray):
        if masks.ndim != 3 or masks.dtype.kind not in "biuf":
            raise InvalidInputError(f"masks must be (worlds, h, w) numbers, got {masks.dtype} {masks.shape}")
        masks = wp.array(masks != 0, dtype=wp.bool, device="cpu")
    if masks.ndim != 3 or masks.dtype not in (wp.int32, wp.bool, wp.uint8):
        raise InvalidInputError(
            f"masks must be (worlds, h, w) int32, bool or uint8, got {masks.dtype.__name__} {masks.shape}"
        )
    if masks.dtype == wp.int32:
        return masks
    keys = wp.empty(masks.shape, dtype=wp.int32, device=masks.device)
    wp.launch(_to_keys, dim=masks.shape, inputs=[masks, keys], device=masks.device)
    return keys


def _from_sums(sums: np.ndarray, real: Silhouette, with_contour: bool) -> dict[str, np.ndarray]:
    area, both, sum_x, sum_y, rim, to_real, to_sim = sums.astype(np.float64).T
    real_area = float(real.mask.sum())
    pixels = float(real.mask.size - real.ignore.sum())
    union = area + real_area - both
    scores = {
        "eq1": (both + (pixels - union)) / max(pixels, 1.0),
        "iou": np.where(union > 0, both / np.maximum(union, 1.0), 1.0),
        "area": area,
        "centroid": np.where(area > 0, np.stack([sum_x, sum_y]) / np.maximum(area, 1.0), -1.0).T,
    }
    if with_contour:
        count = len(real.contour)
        means = (to_real / np.maximum(rim, 1.0) + to_sim / max(count, 1)) / (2.0 * DISTANCE_STEPS)
        if count:
            scores["chamfer"] = np.where(rim > 0, means, real.diagonal)
        else:
            scores["chamfer"] = np.where(rim > 0, real.diagonal, 0.0)
    return scores


def similarity(
    masks: ArrayLike | wp.array, real_mask: ArrayLike | Silhouette, score: str = "eq1", *,
    ignore: ArrayLike | None = None, threshold: float | None = None,
) -> Any:  # fmt: skip
    """Return how alike masks are to a real mask.

    With S the simulated and R the real mask, N the number of pixels that are not ignored, and d the distance
    [px] to the nearest pixel of the other contour:

    - "eq1" = (``|S and R|`` + ``|not S and not R|``) / N, the paper's eq. (1); 0 to 1, higher is better;
    - "iou" = ``|S and R|`` / ``|S or R|``;
    - "chamfer" = (mean of d over S's contour + mean of d over R's contour) / 2 [px], lower is better.

    Args:
        masks: (worlds, h, w) or (h, w): NumPy of bool or whole numbers (non-zero is in), Warp of bool or uint8.
        real_mask: (h, w) likewise, or a prepared `Silhouette`.
        score: "eq1", "iou", "chamfer", or "all".
        ignore: (h, w) pixels that do not count, bool or whole numbers; a Silhouette has its own.
        threshold: Where masks of real numbers, such as probabilities, are cut: what is above it is in the mask.

    Returns:
        (worlds,) float64, or a float for one mask; for "all", a dict of these by name.

    Raises:
        UnknownNameError: there is no such score.
        InvalidInputError: shapes or types do not fit, the real mask is empty, or masks of real numbers without a
            threshold.
    """
    if not isinstance(score, str) or score not in (*SCORES, "all"):
        raise UnknownNameError("score", score, [*SCORES, "all"])
    batch = masks if isinstance(masks, wp.array) else images_of(masks, "masks")
    has_real = is_real(batch)
    if isinstance(real_mask, Silhouette):
        if ignore is not None:
            raise InvalidInputError("a Silhouette carries its own ignore mask; pass ignore= to Silhouette instead")
        real = real_mask
    else:
        given = images_of(real_mask, "real_mask")
        has_real = has_real or is_real(given)
        outside = None if ignore is None else cut(images_of(ignore, "ignore"), None, "ignore")
        real = Silhouette(cut(given, threshold, "real_mask"), outside)
    if threshold is not None and not has_real:
        raise InvalidInputError("threshold is for masks of real numbers; these are bool or whole numbers")
    if not real.mask.any():
        raise InvalidInputError("the real mask is empty: there is nothing that masks could be alike to")
    batch = cut(batch, threshold, "masks")
    if isinstance(batch, wp.array) and batch.dtype not in (wp.bool, wp.uint8):
        raise InvalidInputError(f"masks on a device must be bool or uint8, got {batch.dtype.__name__}")
    single = batch.ndim == 2
    if single:
        batch = batch.reshape((1, *batch.shape))
    scores = score_masks(batch, real, with_contour=score in ("chamfer", "all"))
    if single:
        scores = {name: value[0] if value.ndim > 1 else float(value[0]) for name, value in scores.items()}
    return scores if score == "all" else scores[score]
