"""Candidates on a cloth of any outline: its sharp corners, points between them, and points inside, at a spacing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nuno.camera.cloth_outline import ClothOutline
from nuno.errors import InvalidInputError
from nuno.estimate.pick_settings import MAX_CANDIDATES, PickSettings
from nuno.mesh.polygon import along_outline, contains, distance_to_outline, staggered

if TYPE_CHECKING:
    from nuno.camera.rectangle import ClothRectangle

USUAL = 40
"""About so many candidates there are where no spacing is asked for, hardly more than the 36 of a rectangle."""
STEP = 0.005
"""[m] A spacing that is not asked for is a multiple of this."""
FROM_OUTLINE = 0.6
"""Least distance of an inner candidate from the outline, in spacings."""


def outline_points(cloth: ClothOutline, spacing: float) -> np.ndarray:
    """Return positions (k, 2) [m] on a cloth from C00, those of its outline first.

    Args:
        cloth: The cloth.
        spacing: About how far candidates are from each other [m].
    """
    polygon = cloth.polygon
    rim = along_outline(polygon, spacing)
    # of corners that are nearer to each other than half a spacing, such as a rough edge has, one is enough
    kept: list[int] = []
    for k, point in enumerate(rim):
        if all(np.linalg.norm(rim[j] - point) > 0.5 * spacing for j in kept):
            kept.append(k)
    inner = staggered(polygon.min(axis=0), polygon.max(axis=0), spacing)
    inner = inner[contains(polygon, inner)]
    if len(inner):
        inner = inner[distance_to_outline(polygon, inner) > FROM_OUTLINE * spacing]
    return np.concatenate([rim[kept], inner])


def usual_spacing(cloth: ClothOutline) -> float:
    """Return the spacing [m] that gives about `USUAL` candidates.

    Of a spacing s there are about n = length / s + (area - length s / 2) / (0.87 s^2).
    """
    length, area, cell = cloth.perimeter, cloth.area, np.sqrt(0.75)
    half = 0.5 * length * (1.0 - 0.5 / cell)
    spacing = (half + np.sqrt(half**2 + USUAL * area / cell)) / USUAL
    return max(1.0, np.ceil(spacing / STEP - 1e-9)) * STEP


def with_outline_candidates(settings: PickSettings, cloth: ClothRectangle, spacing: float | None) -> PickSettings:
    """Return the settings with candidates on the cloth that was found; those of a rectangle stay as they are.

    Candidates that were given as fractions stay where they are on the cloth's smallest rectangle, or at the nearest
    point of the cloth; a grid gives way to points at a spacing. All are labelled by their positions [m] from C00.

    Args:
        settings: The settings.
        cloth: The cloth before.
        spacing: Of candidates [m]; None is the usual one.

    Raises:
        InvalidInputError: too many candidates, or a spacing for a rectangle.
    """
    if not isinstance(cloth, ClothOutline):
        if spacing is not None:
            raise InvalidInputError(
                'spacing is for outlines, and the cloth is taken as a rectangle; shape="outline" takes any as it is, '
                "and candidates=(n, m) sets a rectangle's grid"
            )
        return settings
    sides = np.array((cloth.long_m, cloth.short_m))
    wanted: float | None = None
    if spacing is None and not np.issubdtype(settings.labels.dtype, np.integer):
        positions = settings.uv * sides
        outside = ~contains(cloth.polygon, positions)
        positions[outside] = nearest_on_outline(cloth.polygon, positions[outside])
    else:
        wanted = usual_spacing(cloth) if spacing is None else spacing
        if cloth.perimeter / wanted + cloth.area / wanted**2 > MAX_CANDIDATES:
            raise InvalidInputError(f"spacing {wanted:g} m gives more than {MAX_CANDIDATES} candidates on this cloth")
        positions = outline_points(cloth, wanted)
    # what a network has learned of rectangles is not asked about other shapes
    return replace(settings, labels=positions, uv=positions / sides, grid=(2, 2), learned=False, spacing=wanted)


def nearest_on_outline(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the nearest points (k, 2) on a polygon's outline (n, 2) to points (k, 2)."""
    along = np.roll(polygon, -1, axis=0) - polygon
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip(((points[:, None] - polygon) * along).sum(axis=2) / square, 0.0, 1.0)
    near = polygon + part[..., None] * along
    best = np.linalg.norm(near - points[:, None], axis=2).argmin(axis=1)
    return np.asarray(near[np.arange(len(points)), best])
