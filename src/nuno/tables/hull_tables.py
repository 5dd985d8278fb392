"""Convex hulls as tables: the planes of their faces, and their corners with the cells to which they are sharp."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nuno.shapes.shape import Hull

SAGITTA = 1.0 / 24.0
"""Of a cell's side: as deep as a cell's edge cuts into a ball of three cells, which is left to the vertices."""
SCALES = 1e-3 * 1.25 ** np.arange(32)
"""[m] Sides of cells for which corners are looked at, 1 mm to 1 m."""
DIRECTIONS = 6
"""Lines through a corner along which the surface about it is looked at."""
ON_PLANE = 1e-7
"""[m] A corner that is nearer to a face's plane than this is the face's."""


@lru_cache(maxsize=256)
def hull_tables(shape: Hull) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a hull's tables about the middle of its bounding box.

    Returns:
        Planes (k, 4) of its faces, outward normals and distances [m]; corners (m, 4), places and from which side of
        cells on each is sharp [m], the least first; the box's middle (3,) and half sides (3,).
    """
    points = shape.mesh()[0]
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    planes = in_separating_order(shape.planes)
    planes[:, 3] -= planes[:, :3] @ middle
    corners = np.column_stack([points - middle, sharp_from(points - middle, planes)])
    corners = corners[np.argsort(corners[:, 3], kind="stable")]
    return planes.astype(np.float32), corners.astype(np.float32), middle, 0.5 * (high - low)


def in_separating_order(planes: np.ndarray) -> np.ndarray:
    """Return planes (k, 4) in an order in which each looks elsewhere than all before it.

    What is beside a hull is then found to be so by the first few.
    """
    order = [0]
    likeness = planes[:, :3] @ planes[0, :3]
    for _ in range(1, len(planes)):
        likeness[order[-1]] = np.inf
        order.append(int(np.argmin(likeness)))
        likeness = np.maximum(likeness, planes[:, :3] @ planes[order[-1], :3])
    return np.array(planes[order])


def sharp_from(corners: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return from which side of cells on (m,) [m] the corners of a hull stand through triangles; inf for never.

    Of cells of side h, the vertices about a corner are some h / 2 away. Along the line through it on which the surface
    falls the least, it must have fallen by h / 24 there. Along an edge of the hull it does not fall: a corner within
    one is left to the triangles' edges.

    Args:
        corners: (m, 3) [m].
        planes: (k, 4), as `hull_tables` returns.
    """
    normals, offsets = planes[:, :3], planes[:, 3]
    angles = np.arange(2 * DIRECTIONS) * (np.pi / DIRECTIONS)
    found = np.full(len(corners), np.inf)
    for k, corner in enumerate(corners):
        under = normals @ corner - offsets
        n = normals[under > -ON_PLANE].sum(axis=0)
        n /= np.linalg.norm(n)
        first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        first /= np.linalg.norm(first)
        ways = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * np.cross(n, first)
        # down to the planes that look up from beside the corner: (scales, ways, planes)
        up = normals @ n
        steps = 0.5 * SCALES[:, None, None] * (ways @ normals.T)
        falls = ((under + steps)[:, :, up > 1e-3] / up[up > 1e-3]).max(axis=2)
        least = 0.5 * (falls[:, :DIRECTIONS] + falls[:, DIRECTIONS:]).min(axis=1)
        sharp = least > SAGITTA * SCALES
        if sharp.any():
            found[k] = SCALES[sharp.argmax()]
    return found
