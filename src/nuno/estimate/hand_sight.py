"""Detecting whether a hand whose position is known is seen in an image, or has left."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from nuno.camera.camera import Camera

CORE = 0.7
"""Share of the hand's radius in the image that surely shows it."""


def disc(camera: Camera, centre: np.ndarray, radius: float, margin: float = 0.0) -> np.ndarray:
    """(h, w) bool, the pixels of a ball at ``centre`` (3,) [m] of ``radius`` [m], and ``margin`` [px] around it."""
    empty = np.zeros((camera.height, camera.width), dtype=bool)
    depth = float(camera.depth_of(centre))
    if depth <= radius:
        return empty
    middle = camera.project(centre)
    reach = radius * max(camera.fx, camera.fy) / depth + margin
    low = np.maximum(np.ceil(middle - reach), 0).astype(int)
    high = np.minimum(np.floor(middle + reach), (camera.width - 1, camera.height - 1)).astype(int)
    if (high < low).any():
        return empty
    u, v = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
    empty[v, u] = (u - middle[0]) ** 2 + (v - middle[1]) ** 2 <= reach**2
    return empty


def hands_seen(
    images: Mapping[int, np.ndarray], camera: Camera, positions: np.ndarray, held: np.ndarray, radius: float,
    before: np.ndarray | None, cloth: np.ndarray | None,
) -> np.ndarray:  # fmt: skip
    """Tell in which frames each hand is there to hide the cloth.

    A hand that holds is there. One that does not is there where the image looks as it did while it held, and neither
    like the cloth nor like the scene before; frames without an image are as the last one with one. Without images of
    a hand that holds it is taken to be where it is said to be.

    Args:
        images: RGB (h, w, 3) uint8 by frame.
        camera: The camera.
        positions: (frames, hands, 3) [m].
        held: (frames, hands) bool.
        radius: Of a hand [m].
        before: The first image, or None.
        cloth: (h, w) bool, the cloth in it, or None.

    Returns:
        (frames, hands) bool.
    """
    seen = np.ones(held.shape, dtype=bool)
    if before is None or cloth is None or not cloth.any():
        return seen
    colour = np.median(before[cloth], axis=0)
    for hand in range(held.shape[1]):
        cores = {k: disc(camera, positions[k, hand], CORE * radius) for k in images}
        shown = {k: np.median(images[k][core], axis=0) for k, core in cores.items() if core.any()}
        holding = [shown[k] for k in shown if held[k, hand]]
        if not holding:
            continue
        usual = np.median(holding, axis=0)
        there = True
        for k in range(len(held)):
            if held[k, hand]:
                there = True
            elif k in shown:
                others = (colour, np.median(before[cores[k]], axis=0))
                there = all(np.linalg.norm(shown[k] - usual) <= np.linalg.norm(shown[k] - other) for other in others)
            else:
                there = there and k not in images  # out of the image it hides nothing
            seen[k, hand] = there
    # a frame without an image, right after the hand let go, is as the next one that shows it
    for hand in range(held.shape[1]):
        following = True
        for k in range(len(held) - 1, -1, -1):
            if k in images or held[k, hand]:
                following = bool(seen[k, hand])
            elif not following:
                seen[k, hand] = False
    return seen
