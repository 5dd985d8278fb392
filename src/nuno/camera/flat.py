"""A flat cloth on a table: a first look for the region."""

from __future__ import annotations

from contextlib import suppress

import cv2
import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.regions import fill_holes, grow, shrink
from nuno.camera.surface_colours import Illumination
from nuno.camera.table import Table, plane_coordinates, table_margin
from nuno.errors import ClothNotFoundError

STEP = 4  # the first look is at blocks of 4 x 4 pixels: noise and fine texture average out
_DIFFERENT = 4.0  # standard deviations of the table's own colour
_CLOTH_SIDES = (0.08, 1.3)  # [m] what a cloth may measure across; less is a stain
_SMALLEST = 20  # [blocks] of a region that may be a cloth
_BORDERS = (0.08, 0.04, 0.02)  # [m] widths of a table's border that a large cloth may leave
HELP = "a box around the cloth as a hint, or its mask, would help"
RECTANGLE = 0.8  # share of the smallest rectangle around it that a flat cloth fills; a disc has 0.785


def first_look(rgb: np.ndarray, camera: Camera, table: Table, hint: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Find the cloth roughly.

    Args:
        rgb: (h, w, 3) uint8.
        camera: The camera.
        table: The table; with half_extents, or else the cloth is sought as a rectangle that the table
            surrounds.
        hint: (2,) a pixel on the cloth, (4,) a box around it, or None.

    Returns:
        The cloth, and where the table may be seen: two (h // 4, w // 4) bool.

    Raises:
        ClothNotFoundError: there is none.
    """
    h, w = rgb.shape[0] // STEP, rgb.shape[1] // STEP
    small = cv2.resize(rgb[: h * STEP, : w * STEP], (w, h), interpolation=cv2.INTER_AREA).astype(np.float32)
    xy = plane_coordinates(camera, table.height, STEP)
    box = None
    if hint is not None and len(hint) == 4:
        box = np.zeros((h, w), dtype=bool)
        u0, v0, u1, v1 = np.round((hint + 0.5) / STEP).astype(int)
        box[max(v0, 0) : max(v1, v0 + 1), max(u0, 0) : max(u1, u0 + 1)] = True
    if table.half_extents is not None:
        margin = table_margin(table, xy)
        surface = shrink(margin > 0, 1)
        rim = surface & (margin < 0.3)
    else:
        surface = shrink(np.isfinite(xy[..., 0]), 1)
        rim = np.zeros_like(surface)
    if box is not None:
        around = grow(box, max(4, int(0.2 * np.sqrt(box.sum()))))
        surface &= around
        rim = surface & ~box
    if surface.sum() < 30:
        raise ClothNotFoundError(
            "no cloth: the camera does not see the table, or not where the hint is; are both in one frame, in metres?"
        )
    if not rim.any() and table.half_extents is None:
        return _surrounded(small, xy, hint)
    rim = rim if rim.sum() > 30 else surface
    flat = _without_light(small, np.where(rim, 1.0, 0.1) * surface)
    distance = _difference(cv2.blur(flat, (3, 3)), rim, surface)
    differs = (distance > _DIFFERENT) & (surface if box is None else surface & box)
    found = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    found = cv2.morphologyEx(found, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    pixel = None if box is not None else hint
    if box is not None:
        return _choose(found, distance, pixel, None), surface
    failed = None
    try:
        blob = _choose(found, distance, pixel, xy if hint is None else None)
        if _covers_rim(blob, surface):  # the table's border, which differs from a cloth that covers most of the table
            raise ClothNotFoundError("no cloth: what differs from the rest of the table is its border")
        if _likeness(blob, xy) >= RECTANGLE:
            return blob, surface
    except ClothNotFoundError as error:
        failed = error
    # A cloth much like the table may show by less difference over more blocks, and by its texture.
    with suppress(ClothNotFoundError):
        return _faint(flat, _texture(rgb, h, w), rim, surface, xy, pixel), surface
    # A table that is mostly covered, or larger than the picture's, says little of its own colour: then what an even
    # surface surrounds is looked for, as where the table's extents are not known.
    # What stands under the table is no cloth, nor is its whole top, which the floor surrounds.
    with suppress(ClothNotFoundError):
        other, even = _surrounded(small, xy, hint)
        on = (other & surface).sum()
        like_a_cloth = failed is None or 0.9 * other.sum() < on < 0.9 * surface.sum()
        if like_a_cloth and not _covers_rim(other, surface):
            return other, even
    # A cloth may leave no more of the table than a narrow border.
    if table.half_extents is not None:
        with suppress(ClothNotFoundError):
            return _unlike_border(small, margin, surface, xy, pixel), surface
    if failed is not None:
        # A cloth that hangs over the table's near border may fill most of the border's pixels.
        with suppress(ClothNotFoundError):
            return _unlike_far_rim(small, rim, surface, xy, camera, pixel), surface
        raise ClothNotFoundError(f"{failed}; {HELP}") from None
    return blob, surface


def _without_light(small: np.ndarray, weights: np.ndarray, degree: int = 2) -> np.ndarray:
    """Return the logarithm (h, w, 3) of an image without the table's light, fitted where weights (h, w) are."""
    light = Illumination(small, weights, degree=degree)
    return np.asarray(np.log(np.maximum(small, 2.0) / light.field((slice(0, len(small)), slice(0, small.shape[1])))))


def _covers_rim(blob: np.ndarray, surface: np.ndarray) -> bool:
    """Return True if a region (h, w) bool goes all around a surface (h, w) bool, so that it is no cloth on it."""
    ring = surface & ~shrink(surface, 1)
    return bool((blob & ring).sum() > 0.9 * ring.sum())


def _unlike_border(
    small: np.ndarray, margin: np.ndarray, surface: np.ndarray, xy: np.ndarray, pixel: np.ndarray | None
) -> np.ndarray:
    """Return a rectangle (h, w) bool that differs from a narrow border of the table.

    Args:
        small: (h, w, 3) float32, the image.
        margin: (h, w) float, how far within the table a block is [m].
        surface: (h, w) bool, the table's whole top.
        xy: (h, w, 2) float, coordinates on the plane [m].
        pixel: (2,) of a hint, or None.
    """
    for width in _BORDERS:
        border = surface & (margin < width)
        if border.sum() < 30:
            continue
        flat = _without_light(small, border.astype(float), degree=1)
        distance = _difference(cv2.blur(flat, (3, 3)), border, border)
        with suppress(ClothNotFoundError):
            blob = _choose(((distance > _DIFFERENT) & surface).astype(np.uint8), distance, pixel, xy)
            if _likeness(blob, xy) >= RECTANGLE and not _covers_rim(blob, surface):
                return blob
    raise ClothNotFoundError("no cloth: no rectangle differs from the table's border")


def _unlike_far_rim(
    small: np.ndarray, rim: np.ndarray, surface: np.ndarray, xy: np.ndarray, camera: Camera, pixel: np.ndarray | None
) -> np.ndarray:
    """A region (h, w) bool that differs from the far half of the table's rim; arguments as of `first_look`."""
    away = np.linalg.norm(xy - camera.camera_to_world[:2, 3], axis=-1)
    far = rim & (away > 0.5 * (away[rim].min() + away[rim].max()))
    if far.sum() < 30:
        raise ClothNotFoundError("no cloth: too little of the table's far rim is seen")
    flat = _without_light(small, far.astype(float), degree=1)
    distance = _difference(cv2.blur(flat, (3, 3)), far, surface)
    found = ((distance > _DIFFERENT) & surface).astype(np.uint8)
    blob = _choose(cv2.morphologyEx(found, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), distance, pixel, xy)
    if blob.sum() > 0.9 * surface.sum():
        raise ClothNotFoundError("no cloth: the whole table differs from its far rim")
    return blob


def _texture(rgb: np.ndarray, h: int, w: int) -> np.ndarray:
    """(h, w) float32, the logarithm of the deviation of brightness within 9 x 9 px, at blocks of an image."""
    grey = cv2.cvtColor(rgb[: h * STEP, : w * STEP], cv2.COLOR_RGB2GRAY).astype(np.float32)
    variance = cv2.blur(grey * grey, (9, 9)) - cv2.blur(grey, (9, 9)) ** 2
    return 0.5 * np.log(cv2.resize(np.maximum(variance, 0.0), (w, h), interpolation=cv2.INTER_AREA) + 1.0)


def _faint(
    flat: np.ndarray, texture: np.ndarray, rim: np.ndarray, surface: np.ndarray, xy: np.ndarray,
    pixel: np.ndarray | None,
) -> np.ndarray:  # fmt: skip
    """A rectangle (h, w) bool on the table that differs little from it, but in colours or texture all over.

    Args:
        flat: (h, w, 3) float32, the image without the table's light, logarithms.
        texture: (h, w) float32.
        rim: (h, w) bool, where the table is seen.
        surface: (h, w) bool, its whole top.
        xy: (h, w, 2) float, coordinates on the plane [m].
        pixel: (2,) of a hint, or None.
    """
    inner = shrink(surface, 2)  # the table's edge is a texture too
    if (rim & inner).sum() < 30:
        raise ClothNotFoundError("no cloth: too little of the table is seen")
    distance = _difference(np.dstack([cv2.blur(flat, (3, 3)), texture]), rim & inner, inner)
    # Checks differ from the table one by one, and not in the mean: so it is their differences that are averaged.
    distance = np.where(inner, np.minimum(distance, 10.0), 0.0).astype(np.float32)
    weight = np.maximum(cv2.blur(inner.astype(np.float32), (5, 5)), np.float32(1e-3))
    distance = cv2.blur(distance, (5, 5)) / weight
    limit, _ = cv2.threshold((25.0 * distance[inner]).astype(np.uint8), 0, 255, cv2.THRESH_OTSU)
    found = ((25.0 * distance > limit) & inner).astype(np.uint8)
    blob = _choose(cv2.morphologyEx(found, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), distance, pixel, xy)
    around = inner & ~grow(blob, 3)
    even = around.sum() > 30 and np.quantile(distance[blob], 0.2) > np.quantile(distance[around], 0.95)
    if not even or _likeness(blob, xy) < RECTANGLE:
        raise ClothNotFoundError("no cloth: nothing like a rectangle differs from the table")
    return blob


def _difference(flat: np.ndarray, rim: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """Return each pixel's difference from the table's colour in an image (h, w, channels), in standard deviations.

    The table's colours are those of its rim (h, w) bool and of all that is like them on its surface (h, w)
    bool. Of the rim only the half nearest to its median counts at first: a cloth may cover much of it.
    """
    centre = np.median(flat[rim], axis=0)
    values = flat[rim]
    away = np.linalg.norm(values - centre, axis=1)
    values, widen = values[away <= np.median(away)], 2.5  # half of a normal cloud has 0.4 times its spread
    for _ in range(4):
        covariance = widen**2 * np.cov((values - centre).T) + 0.015**2 * np.eye(flat.shape[-1])
        offset = flat - centre
        distance = np.sqrt(np.einsum("...i,ij,...j->...", offset, np.linalg.inv(covariance), offset))
        inliers = surface & (distance < 3.0)
        if inliers.sum() < 30:
            break
        values, widen = flat[inliers], 1.0
        centre = values.mean(axis=0)
    return distance


def _choose(found: np.ndarray, distance: np.ndarray, pixel: np.ndarray | None, xy: np.ndarray | None) -> np.ndarray:
    """The part (h, w) bool at a pixel of the full image, or else the one that is largest and differs most.

    Where plane coordinates xy (h, w, 2) are given, it must have a cloth's size on the plane.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(found, connectivity=4)
    stats[0, cv2.CC_STAT_AREA] = 0
    large = stats[:, cv2.CC_STAT_AREA] >= _SMALLEST
    if not large.any():
        raise ClothNotFoundError(
            f"no cloth: nothing of at least {_SMALLEST * STEP**2} pixels on the table differs from it"
        )
    if pixel is None:
        mass = np.bincount(labels.ravel(), weights=np.minimum(distance, 20).ravel(), minlength=count)
        best = fill_holes(labels == int(np.where(large, mass, 0.0).argmax()))
        if xy is not None:
            contours, _ = cv2.findContours(best.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
            size, _ = _size_on_plane(max(contours, key=len)[:, 0], xy)
            if min(size) < _CLOTH_SIDES[0]:
                raise ClothNotFoundError(
                    f"no cloth: what differs from the table is only {size[0]:.2f} x {size[1]:.2f} m, "
                    f"and without a hint a cloth is at least {_CLOTH_SIDES[0]} m across"
                )
        return best
    part = _label_near(np.where(large[labels], labels, 0), pixel)
    if part == 0:
        raise ClothNotFoundError(f"no cloth at the hint {pixel.tolist()}: it looks like the table there")
    return fill_holes(labels == part)


def _label_near(labels: np.ndarray, pixel: np.ndarray) -> int:
    """The label at a pixel of the full image or within 2 blocks of it, or 0."""
    rows, columns = np.nonzero(labels)
    away = np.hypot(*(np.stack([columns, rows]) - ((pixel + 0.5) / STEP - 0.5)[:, None]))
    return int(labels[rows[away.argmin()], columns[away.argmin()]]) if len(away) and away.min() <= 2.0 else 0


def _surrounded(small: np.ndarray, xy: np.ndarray, pixel: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle on the plane that one even surface surrounds, and that surface with it.

    For a range of how much colour may change from block to block, even surfaces are followed as far as they
    go; what such a surface encloses, and makes a rectangle of a cloth's size on the table's plane, may be the
    cloth. The largest one is.
    """
    smooth = cv2.medianBlur(np.clip(small, 0, 255).astype(np.uint8), 5).astype(np.float32)
    change = cv2.morphologyEx(smooth, cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)).max(axis=-1)
    best, answer = 0.0, None
    for limit in (6.0, 9.0, 13.0, 18.0, 25.0, 35.0):
        even = (change < limit) & np.isfinite(xy[..., 0])
        _, labels, stats, _ = cv2.connectedComponentsWithStats(even.astype(np.uint8), connectivity=4)
        for label in np.flatnonzero(stats[:, cv2.CC_STAT_AREA] > 0.03 * even.size):
            if label == 0:
                continue
            surface = cv2.morphologyEx((labels == label).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
            contours, tree = cv2.findContours(surface, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
            for contour, (_, _, _, parent) in zip(contours, tree[0], strict=True):
                if parent < 0 or len(contour) < 16:
                    continue
                hole = np.zeros(surface.shape, dtype=np.uint8)
                cv2.drawContours(hole, [contour], -1, 1, thickness=cv2.FILLED)
                blob = hole.astype(bool) & ~surface.astype(bool)
                if blob.sum() < _SMALLEST or (pixel is not None and _label_near(blob.astype(int), pixel) == 0):
                    continue
                size, likeness = _size_on_plane(contour[:, 0], xy)
                if likeness < RECTANGLE or not _CLOTH_SIDES[0] <= min(size) <= max(size) <= _CLOTH_SIDES[1]:
                    continue
                if likeness * np.sqrt(blob.sum()) > best:
                    best, answer = (
                        likeness * np.sqrt(blob.sum()),
                        (fill_holes(blob), fill_holes(surface.astype(bool))),
                    )
    if answer is None:
        raise ClothNotFoundError(
            "no cloth: nothing that the table surrounds is a rectangle on its plane; "
            "the table's half_extents, or a box around the cloth as a hint, would help"
        )
    return answer


def _likeness(blob: np.ndarray, xy: np.ndarray) -> float:
    """Return the share of its smallest rectangle on the plane that a region (h, w) bool fills; 0 outside the plane."""
    contours, _ = cv2.findContours(blob.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return _size_on_plane(max(contours, key=len)[:, 0], xy)[1]


def _size_on_plane(outline: np.ndarray, xy: np.ndarray) -> tuple[tuple[float, float], float]:
    """Sides [m] of the smallest rectangle on the plane around an outline (k, 2), and how full it is."""
    ground = xy[outline[:, 1], outline[:, 0]]
    if not np.isfinite(ground).all():
        return (0.0, 0.0), 0.0
    ground = (ground - ground.mean(axis=0)).astype(np.float32)
    _, size, _ = cv2.minAreaRect(ground)
    return (float(size[0]), float(size[1])), cv2.contourArea(ground) / max(size[0] * size[1], 1e-9)
