"""A cloth laid over a disc, and the share of what hangs over it that is seen from above."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from world_with import rows

import nuno


def drape_coefficients(
    size: tuple[float, float], plate: float, cells: tuple[int, int], material: nuno.Cloth, worlds: int = 1, *,
    seconds: float = 4.0, **options: Any,
) -> np.ndarray:  # fmt: skip
    """Return (projected area - plate) / (cloth area - plate) of cloths let go level on a disc, one a world.

    Args:
        size: The cloth's sides [m].
        plate: The disc's diameter [m].
        cells: The sheet's.
        material: One, whose values may differ by world.
        worlds: How many.
        seconds: When to look.
        options: Of the world.
    """
    world = nuno.World(device="cpu", **options)
    world.add(nuno.cylinder(0.5 * plate, 0.02, name="plate", position=(0, 0, 0.99)))
    world.add(nuno.sheet(size, cells=cells, name="cloth", position=(0, 0, 1.0025)))
    if worlds > 1:
        world = world.imagine(worlds)
    cloth = world.attach(world.find("cloth"), material)
    world.set_friction("plate", "cloth", 1.0)  # the middle stays where it is, as under the second disc of a drape meter
    world.run(seconds)
    full = size[0] * size[1]
    disc = 0.25 * np.pi * plate**2
    return np.array([(seen_from_above(x, cloth.faces) - disc) / (full - disc) for x in rows(cloth)])


def seen_from_above(vertices: np.ndarray, faces: np.ndarray, pixel: float = 5e-4) -> float:
    """Return the area of all triangles' projection together [m2]."""
    flat = (vertices[:, :2] - vertices[:, :2].min(axis=0)) / pixel * 16
    image = np.zeros(np.ceil(flat.max(axis=0)[::-1] / 16 + 2).astype(int), np.uint8)
    for corners in np.rint(flat).astype(np.int32)[faces]:
        cv2.fillConvexPoly(image, corners, 1, shift=4)
    # fillConvexPoly draws the outline too, half a pixel more all round: taken off by the rim's length
    outlines, _ = cv2.findContours(image, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    rim = sum(cv2.arcLength(line, True) for line in outlines)
    return float(image.sum() - 0.5 * rim) * pixel**2
