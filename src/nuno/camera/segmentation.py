"""Finding the cloth in an image: flat on the table before, lifted by the hand after."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.camera.camera import Camera
from nuno.camera.flat import first_look
from nuno.camera.flat_pixels import refine
from nuno.camera.image import check_image, check_mask
from nuno.camera.regions import fill_doubtful_holes, grow, parts_at, sharpen, shrink
from nuno.camera.scene_without_cloth import compare
from nuno.camera.surface_colours import discriminant, guided_filter
from nuno.camera.table import Table, plane_coordinates, table_margin
from nuno.camera.template_segmentation import segment_by_template
from nuno.errors import ClothNotFoundError, InvalidInputError
from nuno.validation import checked

_CERTAIN = 6.0  # [nats] no single pixel says more than this
_IN_DOUBT = 2.0  # [nats] a smoothed ratio below this says little
_NEAR = 12  # [px] around the cloth what is in doubt counts


@checked
def segment_before(
    image: ArrayLike, camera: Camera, table: Table, *, hint: ArrayLike | None = None, template: ArrayLike | None = None
) -> np.ndarray:
    """Find the cloth that lies flat on the table.

    The cloth is the largest region on the table's plane that does not look like the table around it. A first
    look, at a quarter of the resolution, finds the region; then colour densities of the cloth and of the
    table around it, and an edge-aware filter over their ratio, decide pixel by pixel.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: The camera that took it.
        table: The table; where its extents are not known, the cloth must be surrounded by table in the image.
        hint: Where the cloth is: a pixel (u, v) on it, or a box (u0, v0, u1, v1) around it.
        template: (n, 2) the cloth's outline [m], where it is known: where colours find something else, or nothing,
            `nuno.find_shape` decides, which finds the outline also among things of the cloth's own colour.

    Returns:
        (h, w) bool.

    Raises:
        ImageError: the image does not fit the camera.
        ClothNotFoundError: nothing on the table differs from it.
        InvalidInputError: a hint that is neither a pixel nor a box of the image, or a template that is no outline.
    """
    rgb = check_image(image, camera)
    spot = _check_hint(hint, camera)

    def by_colours() -> np.ndarray:
        blob, surface = first_look(rgb, camera, table, spot)
        return refine(rgb, blob, surface)

    return by_colours() if template is None else segment_by_template(rgb, camera, table, template, spot, by_colours)


@checked
def segment_after(
    image: ArrayLike, camera: Camera, table: Table, before_image: ArrayLike, before_mask: ArrayLike,
    hand_position: ArrayLike, *, hand_radius: float = 0.014, hidden: ArrayLike | None = None,
) -> np.ndarray:  # fmt: skip
    """Find the cloth that the hand has lifted, as far as the hand does not occlude it.

    Each pixel is explained either by the cloth (its colours from before, in more or less light) or by the
    background (the image before, or the table's colours where the cloth hid it; lit, or in the cloth's
    shadow). The ratio of the two, smoothed up to edges, gives the region; the part at the hand, within the
    cloth's reach, is the cloth.

    Args:
        image: (h, w, 3) uint8 RGB.
        camera: The camera that took both images.
        table: The table.
        before_image: (h, w, 3) uint8 RGB, with the cloth flat on the table.
        before_mask: (h, w) bool, the cloth there.
        hand_position: (3,) float, the point of the cloth in the hand [m].
        hand_radius: Radius of the hand around it [m].
        hidden: (h, w) bool, pixels that show something before the cloth, such as the robot's own arm.

    Returns:
        (h, w) bool.

    Raises:
        ImageError: an image or the mask does not fit the camera.
        ClothNotFoundError: nothing near the hand looks like the cloth.
        InvalidInputError: a hand position or radius that is not finite.
    """
    return look_after(
        image, camera, table, before_image, before_mask, hand_position, hand_radius=hand_radius, hidden=hidden
    )[0]


def look_after(
    image: ArrayLike, camera: Camera, table: Table, before_image: ArrayLike, before_mask: ArrayLike,
    hand_position: ArrayLike, *, hand_radius: float = 0.014, hidden: ArrayLike | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The same as ``segment_after``, and besides what is in doubt.

    Returns:
        The cloth, and the regions in and beside it of which colours and texture hardly tell whether they are the
        cloth: two (h, w) bool. The outline, which is always a mixture, is not among them.
    """
    rgb = check_image(image, camera, "the image after")
    before = check_image(before_image, camera, "the image before")
    mask = check_mask(before_mask, camera, "the mask before")
    hand = np.asarray(hand_position, dtype=float)
    if hand.shape != (3,) or not np.isfinite(hand).all() or not (np.isfinite(hand_radius) and hand_radius >= 0):
        raise InvalidInputError(
            "the hand needs a position of three finite numbers and a radius from 0 up [m], "
            f"got {hand_position!r} and {hand_radius!r}"
        )
    if not mask.any():
        raise ClothNotFoundError("the mask before is empty, so nothing is known of the cloth's colours")

    reach = _sphere(camera, hand, _length_limit(mask, camera, table.height), step=4)
    if not reach.any():
        raise ClothNotFoundError(f"the hand at {hand.tolist()} m and all within the cloth's reach is not in the image")
    covered = None if hidden is None else check_mask(hidden, camera, "hidden")
    top, elsewhere = _table_top(camera, table), reach
    if covered is not None:
        top, elsewhere = top & ~covered, reach | covered
    background = compare(before, rgb, mask, top, elsewhere)
    ratio = np.log(background.cloth / background.density())
    grip = _sphere(camera, hand, hand_radius)
    if covered is not None:
        grip |= covered
    ratio = np.clip(ratio, -_CERTAIN, _CERTAIN)
    ratio[grip | ~reach] = -_CERTAIN
    likely, unlikely = (ratio > 2.0) & reach, (ratio < -2.0) & reach
    if likely.sum() < 20:
        raise ClothNotFoundError(
            "no cloth: nothing within reach of the hand has the colours of the cloth before; a mask would help"
        )
    if unlikely.sum() >= 20:
        guide = discriminant(background.view, likely, unlikely)
        ratio = guided_filter(ratio, guide, radius=3, epsilon=0.05)
    found = parts_at((ratio > 0) & ~grip, ratio, grip, camera.project(hand))
    if found.sum() < 20:
        raise ClothNotFoundError(
            "no cloth: nothing near the hand has the colours of the cloth before; a mask would help"
        )
    # A cloth has no holes; the table is seen through a loop of it only where the colours say so twice as clearly.
    found = fill_doubtful_holes(found, ratio, area=12, doubt=2.0)
    found = sharpen(found, background.view, background.noise) & reach
    if covered is not None:
        found &= ~covered
    return found, _doubtful(found, ratio, reach & ~grip)


def _doubtful(found: np.ndarray, ratio: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return where the ratio (h, w), in and beside what was found (h, w) bool, says little."""
    outline = grow(found, 2) & ~shrink(found, 2)
    doubt = (np.abs(ratio) < _IN_DOUBT) & grow(found, _NEAR) & ~outline & seen
    return cv2.morphologyEx(doubt.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).astype(bool)


def _check_hint(hint: ArrayLike | None, camera: Camera) -> np.ndarray | None:
    """A hint as (2,) or (4,) float, or None."""
    if hint is None:
        return None
    values = np.asarray(hint, dtype=float).ravel()
    if values.size not in (2, 4) or not np.isfinite(values).all():
        raise InvalidInputError(f"a hint is a pixel (u, v) or a box (u0, v0, u1, v1), got {hint!r}")
    size = np.array([camera.width, camera.height] * (values.size // 2))
    if (values < -0.5).any() or (values > size - 0.5).any() or (values.size == 4 and (values[2:] <= values[:2]).any()):
        raise InvalidInputError(
            f"the hint {values.tolist()} does not lie in the {camera.width} x {camera.height} image"
        )
    return values


def _length_limit(mask: np.ndarray, camera: Camera, height: float) -> float:
    """The longest distance [m] across the cloth, flat at a height [m]: its reach from the hand."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    ground = camera.back_project(np.concatenate(contours)[:, 0].astype(float), height)[:, :2]
    hull = cv2.convexHull(ground.astype(np.float32))[:, 0]
    return 1.03 * float(np.linalg.norm(hull[:, None] - hull[None], axis=-1).max())


def _table_top(camera: Camera, table: Table) -> np.ndarray:
    """(h, w) bool, the table's top, or its whole plane where its extents are not known; to about 2 px."""
    xy = plane_coordinates(camera, table.height, step=4)
    return _enlarge(np.isfinite(xy[..., 0]) if table.half_extents is None else table_margin(table, xy) > 0, camera)


def _sphere(camera: Camera, centre: np.ndarray, radius: float, step: int = 1) -> np.ndarray:
    """(h, w) bool, the pixels whose rays meet a sphere around a centre (3,) [m]; to about step / 2 px."""
    to = centre - camera.camera_to_world[:3, 3]
    distance2 = float(to @ to)
    if distance2 <= radius * radius:
        return np.ones((camera.height, camera.width), dtype=bool)
    u = np.arange(camera.width // step) * step + (step - 1) / 2
    v = np.arange(camera.height // step) * step + (step - 1) / 2
    if step == 1:
        # A small sphere: only the rays near its middle need a look.
        middle = camera.project(centre)
        size = 2.0 * max(camera.fx, camera.fy) * radius / np.sqrt(distance2 - radius * radius) + 2.0
        if not np.isfinite(middle).all():
            return np.zeros((camera.height, camera.width), dtype=bool)
        u, v = u[np.abs(u - middle[0]) < size], v[np.abs(v - middle[1]) < size]
    found = np.zeros((camera.height // step, camera.width // step), dtype=bool)
    if u.size and v.size:
        rays = camera.rays(np.stack(np.meshgrid(u, v), axis=-1))
        along = (rays @ to) / np.linalg.norm(rays, axis=-1)
        rows, columns = (v / step).astype(int), (u / step).astype(int)
        found[np.ix_(rows, columns)] = (distance2 - along**2 < radius**2) & (along > 0)
    return found if step == 1 else _enlarge(found, camera)


def _enlarge(coarse: np.ndarray, camera: Camera) -> np.ndarray:
    size = (camera.width, camera.height)
    return cv2.resize(coarse.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST).astype(bool)
