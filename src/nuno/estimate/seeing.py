"""The picked cloth in the image after: its silhouette at two resolutions, and its pattern."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.cloth_outline import cloth_colours
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.segmentation import look_after
from nuno.camera.table import Table
from nuno.errors import ImageError
from nuno.estimate.pattern import Pattern, find_pattern
from nuno.estimate.similarity import Silhouette

IMAGE_SCALE = 0.5
"""Silhouettes are compared at half the image's resolution: edges are known to no better than a pixel or two."""
TURNED_SCALE = 0.25
"""Turned futures are compared at a quarter: they are right to a few degrees only, and it takes a third of the time."""
FAR_FROM_HAND = 10.0
"""[px] of the full image. A cloth that a hand holds is seen beside it; nearer than this, fine folds may be missed."""
MUCH_DOUBT = 0.1
"""Share of the cloth's area that may be in doubt before a warning says so: 5 % of masks that were good have more."""
COVERED_SHARE = 0.6
"""Of the middle of the hand's disc that shows cloth, where it is not the hand; where the hand is, 0.15 at most did."""
MIDDLE = 0.3
"""Of the disc's radius are left out of that at its rim, where cloth is seen about the hand."""
AWAY = "the cloth found in the image after begins "
"""How a warning begins that there is no cloth at the hand."""
COVERED = "the image after shows cloth where the hand is told to be"
"""How a warning begins that there is no hand."""
OUTSIDE = "the hand is told to be out of the image after"
"""How a warning begins that the place of the hand is not seen."""
CUT_SHARE = 0.05
"""Share of the cloth's outline on the image's border from which it is told that the cloth goes on there."""
HAND_MARGIN = 2
"""[px] of the full image around the hand that count neither as cloth nor as background."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The image after, as segmented: the cloth's silhouette and what hides it.

    Attributes:
        mask: (h, w) bool, the cloth.
        hidden: (h, w) bool, pixels of the hand and of what else hides the cloth.
        camera: The camera at `IMAGE_SCALE`.
        silhouette: The cloth's silhouette there, without what the hand hides.
        coarse: The same at `TURNED_SCALE`.
        pattern: The cloth's pattern; None where it is not asked for, or too little is seen.
        warnings: What is odd about where the cloth is seen.
        hand_is: 1 where the hand is seen to be higher than it is told, -1 where lower, else 0.
    """

    mask: np.ndarray
    hidden: np.ndarray
    camera: Camera
    silhouette: Silhouette
    coarse: tuple[Camera, Silhouette]
    pattern: Pattern | None
    warnings: tuple[str, ...] = ()
    hand_is: int = 0


def begin_to_see(
    before: np.ndarray | None, after: np.ndarray | None, mask_before: np.ndarray | None, mask_after: np.ndarray | None,
    *, camera: Camera, table: Table, rectangle: ClothRectangle, hand: np.ndarray, hand_radius: float,
    hidden: np.ndarray | None, with_pattern: bool, meanwhile: bool,
) -> Callable[[], Seen]:  # fmt: skip
    """Look at the image after, and return a function that waits for what it shows, and raises what went wrong.

    Args:
        before: (h, w, 3) uint8 RGB; may be None, as ``mask_before``, where ``mask_after`` is given.
        after: The same, of the cloth in the hand.
        mask_before: (h, w) bool, the cloth before.
        mask_after: The cloth after, where it is known.
        camera: The camera of both images.
        table: The table.
        rectangle: The cloth before.
        hand: (3,) the held point [m].
        hand_radius: Radius of what hides the cloth around it [m].
        hidden: (h, w) bool, what else is hidden, or None.
        with_pattern: Whether to look for the pattern.
        meanwhile: On a thread, while the first pick is imagined, which leaves a core idle now and then, or all on a
            GPU; else at once.
    """

    def look() -> Seen:
        mask, doubt = mask_after, None
        if mask is None:
            assert before is not None and after is not None and mask_before is not None
            mask, doubt = look_after(
                after, camera, table, before, mask_before, hand, hand_radius=hand_radius, hidden=hidden
            )
        ignored = _hidden(camera, hand, hand_radius)
        outside = _outside(mask, ignored, camera.project(hand))
        if hidden is not None:
            ignored |= hidden
        small, silhouette = _silhouette(mask, camera, ignored, IMAGE_SCALE)
        coarse = _silhouette(mask, camera, ignored, TURNED_SCALE)
        pattern = None
        if with_pattern and before is not None and after is not None:
            colours = cloth_colours(before, mask_before, rectangle)
            pattern = find_pattern(colours, after, mask & ~ignored, rectangle, camera, hand)
        away = _oddities(mask, ignored)
        covered = _uncovered(mask, ignored) if mask_after is None and hidden is None else ()
        hand_is = 1 if covered else -1 if away and _begins_below(mask, camera, hand) else 0
        odd = outside + away + _doubts(mask, doubt) + covered
        return Seen(mask, ignored, small, silhouette, coarse, pattern, odd, hand_is)

    if not meanwhile:
        seen = look()
        return lambda: seen
    thread = ThreadPoolExecutor(1, thread_name_prefix="nuno-seeing")
    looking = thread.submit(look)
    thread.shutdown(wait=False)
    return looking.result


def _outside(mask: np.ndarray, hand_pixels: np.ndarray, hand: np.ndarray) -> tuple[str, ...]:
    """Warnings where the image after does not show the hand's pixels (h, w), or the cloth (h, w) goes on beyond it.

    Args:
        mask: (h, w) bool, the cloth.
        hand_pixels: (h, w) bool.
        hand: (2,) the pixel of the held point, wherever it is.
    """
    import cv2

    found = []
    height, width = mask.shape
    if not hand_pixels.any():
        found.append(
            f"{OUTSIDE}, at pixel ({hand[0]:.0f}, {hand[1]:.0f}) of {width} x {height}: whether it is there and holds "
            "the cloth is not seen; take the image with the hand in it"
        )
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if outlines:
        outline = np.concatenate(outlines)[:, 0]
        cut = float(((outline <= 0) | (outline >= (width - 1, height - 1))).any(axis=1).mean())
        if cut >= CUT_SHARE:
            found.append(
                f"{cut:.0%} of the cloth's outline in the image after lies on the image's border: what is beyond it is "
                "not compared; a camera farther away, or turned, sees all of it"
            )
    return tuple(found)


def _oddities(mask: np.ndarray, ignored: np.ndarray) -> tuple[str, ...]:
    """Return what is odd about where the cloth (h, w) is seen, with the pixels (h, w) of the hand and what hides it."""
    import cv2

    if not mask.any() or not ignored.any():
        return ()
    away = float(cv2.distanceTransform((~ignored).astype(np.uint8), cv2.DIST_L2, 5)[mask].min())
    if away <= max(float(np.sqrt(ignored.sum() / np.pi)), FAR_FROM_HAND):
        return ()
    return (f"{AWAY}{away:.0f} px away from the hand: does it hold the cloth?",)


def _begins_below(mask: np.ndarray, camera: Camera, hand: np.ndarray) -> bool:
    """Return True if the cloth (h, w) that is nearest to the hand (3,) [m] is seen under it, to 60 degrees."""
    middle, below = camera.project(np.stack([hand, hand - (0.0, 0.0, 0.01)]))
    away = np.argwhere(mask)[:, ::-1] - middle
    nearest = away[np.linalg.norm(away, axis=1).argmin()]
    return bool(nearest @ (below - middle) >= 0.5 * np.linalg.norm(nearest) * np.linalg.norm(below - middle))


def _uncovered(mask: np.ndarray, ignored: np.ndarray) -> tuple[str, ...]:
    """A warning where the mask (h, w) that was found goes on over the middle of the hand's pixels (h, w)."""
    import cv2

    depth = cv2.distanceTransform(ignored.astype(np.uint8), cv2.DIST_L2, 5)
    middle = depth > MIDDLE * depth.max()
    if float((mask & middle).sum()) < COVERED_SHARE * max(int(middle.sum()), 1):
        return ()
    return (f"{COVERED}: is it behind the cloth, or are hand and camera told wrongly?",)


def _doubts(mask: np.ndarray, doubt: np.ndarray | None) -> tuple[str, ...]:
    """A warning where much of the mask (h, w) found in the image after, or beside it, is in doubt (h, w)."""
    share = 0.0 if doubt is None else float(doubt.sum() / max(mask.sum(), 1))
    if share <= MUCH_DOUBT:
        return ()
    return (
        f"the cloth in the image after is much like the table or its shadow: {share:.0%} of it is in doubt; "
        "a mask, after_mask, would help",
    )


def _hidden(camera: Camera, hand: np.ndarray, radius: float) -> np.ndarray:
    """(h, w) bool, the pixels that the hand may hide."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    centre = camera.project(hand)
    reach = radius * max(camera.fx, camera.fy) / camera.depth_of(hand) + HAND_MARGIN
    return (u - centre[0]) ** 2 + (v - centre[1]) ** 2 <= reach**2


def _silhouette(mask: np.ndarray, camera: Camera, hidden: np.ndarray, scale: float) -> tuple[Camera, Silhouette]:
    """The camera and the real silhouette, without the hand's pixels, at a share of the image's resolution."""
    import cv2

    small = camera.scaled(scale)

    def shrink(image: np.ndarray) -> np.ndarray:
        return cv2.resize(image.astype(np.float32), (small.width, small.height), interpolation=cv2.INTER_AREA)

    if not (mask & ~hidden).any():
        raise ImageError("the mask after is empty but for the hand, so there is no silhouette to compare with")
    return small, Silhouette(shrink(mask & ~hidden) >= 0.5, shrink(hidden) > 0.25)
