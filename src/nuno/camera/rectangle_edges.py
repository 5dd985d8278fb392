"""The measured edge of a cloth along the sides of the rectangle that it is taken for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.camera.camera import Camera
from nuno.camera.edges import edge_in_image, edge_in_mask, side_pixels
from nuno.camera.rim_shadow import cloth_at_shadow
from nuno.errors import EstimationError

_ENDS = 0.06  # share of a side next to a corner that is not measured: there the other side bends the edge
_MIN_SHARE = 0.2  # share of a side that must show an edge
_SCATTER = 0.25  # [px] median scatter of an edge about its line that noise explains
_AGREE = 1.0  # [px] how far an edge may be from the one that most others agree on


@dataclass(frozen=True, eq=False)
class EdgePoints:
    """Points of a cloth's edge.

    Attributes:
        pixels: (n, 2) float.
        normals: (n, 2) float, unit normals of the sides there, outward in the image.
        sides: (n,) int, 0 to 3, the side after each corner.
    """

    pixels: np.ndarray
    normals: np.ndarray
    sides: np.ndarray


def measured_edges(
    corners: np.ndarray, mask: np.ndarray, image: np.ndarray | None, camera: Camera, height: float
) -> EdgePoints:
    """Measure a cloth's edge near the sides of a rectangle.

    Args:
        corners: (4, 2) float, the rectangle's on the plane [m], anticlockwise seen from above.
        mask: (h, w) float32, the cloth, blurred (`nuno.camera.edges.edge_in_mask`).
        image: (h, w, 3) float32, or None where only the mask is known.
        camera: The camera.
        height: The plane's z [m].

    Raises:
        EstimationError: most of a side shows no edge.
    """
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    lines = [side_pixels(corners[side], corners[(side + 1) % 4], camera, height, _ENDS) for side in range(4)]
    shadows = [None] * 4 if image is None else _shadows(image, lines, camera, height)
    for side, (pixels, normals, seen) in enumerate(lines):
        pixels, normals, count = pixels[seen], normals[seen], len(seen)
        edge = edge_in_mask(mask, pixels, normals)
        shift = shadows[side]
        if shift is not None:
            edge = pixels + shift[:, None] * normals
        elif image is not None:
            edge = _refined(pixels, normals, edge, edge_in_image(image, pixels, normals))
        good = np.isfinite(edge).all(axis=1)
        if good.sum() < _MIN_SHARE * count:
            raise EstimationError(
                f"only {good.sum() / count:.0%} of one side of the cloth shows an edge: it is cut off, "
                "or the region is not a rectangle on the plane"
            )
        found.append((edge[good], normals[good], np.full(int(good.sum()), side)))
    pixels, normals, sides = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return EdgePoints(pixels, normals, sides)


def _shadows(
    image: np.ndarray, lines: list[tuple[np.ndarray, np.ndarray, np.ndarray]], camera: Camera, height: float
) -> list[np.ndarray | None]:
    """The cloth's edge along each side that casts a shadow; of two opposite sides only one can: others are a border."""
    found: list[np.ndarray | None] = []
    for pixels, normals, seen in lines:
        middle = len(pixels) // 2
        ground = camera.back_project(np.stack([pixels[middle], pixels[middle] + normals[middle]]), height)
        metres = float(np.linalg.norm(ground[1] - ground[0]))
        found.append(cloth_at_shadow(image, pixels[seen], normals[seen], metres))
    return [None if found[(side + 2) % 4] is not None else found[side] for side in range(4)]


def _refined(line: np.ndarray, normals: np.ndarray, mask_edge: np.ndarray, image_edge: np.ndarray) -> np.ndarray:
    """The edge (k, 2) along a line (k, 2): the image's, or the mask's where the image's is in doubt.

    The mask is right on average but may be rough; the image is fine where a plain cloth meets a plain
    table. Where a pattern runs along the side, the image's edges jump between the cloth's and the pattern's.
    """
    offsets = [((edge - line) * normals).sum(axis=1) for edge in (mask_edge, image_edge)]
    middles = [float(np.median(offset[np.isfinite(offset)])) for offset in offsets if np.isfinite(offset).any()]
    if len(middles) < 2 or np.isfinite(offsets[1]).mean() < 0.5 or abs(middles[1] - middles[0]) > _AGREE:
        return mask_edge
    scatter = [float(np.nanmedian(np.abs(offset - middle))) for offset, middle in zip(offsets, middles, strict=True)]
    if scatter[1] > max(scatter[0], _SCATTER):
        return mask_edge
    image_edge[np.abs(offsets[1] - middles[1]) > _AGREE] = np.nan
    return image_edge
