"""Convex hulls as tables: planes of faces, a grid that finds the highest, and corners with the cells that see them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import warp as wp

from nuno.shapes.shape import Hull
from nuno.state.cloth_state import Shapes

SAGITTA = 1.0 / 24.0
"""Of a cell's side: as deep as a cell's edge cuts into a ball of three cells, which is left to the vertices."""
SCALES = 1e-3 * 1.5 ** np.arange(17)
"""[m] Sides of cells for which corners are looked at, 1 mm to 0.66 m."""
DIRECTIONS = 4
"""Lines through a corner along which the surface about it is looked at."""
NEAREST, OTHERS = 32, 256
"""Planes that are looked at for a corner: the nearest ones, and of many others some from all sides."""
ON_PLANE = 1e-7
"""[m] A corner that is nearer to a face's plane than this is the face's."""
SPARE = 5e-4
"""[m] Corners that stand out of the hull of the others by no more than this are left to vertices and edges."""
FEW = 16
"""Planes up to which all are looked at, without a grid."""
AROUND = 0.04
"""[m] How far around a hull its grid goes: as far as edges that touch it reach out."""
CELLS = 24
"""Cells along the longest side of a grid."""
ROUNDING = 1e-5
"""[m] By which cells overlap: a point may be said to be in the next one."""
AT_ONCE = 1_000_000
"""Cells times planes that are looked at at once."""
DEEP = 0.02
"""[m] What is deeper in is rarely asked for, and has no list."""


@dataclass(frozen=True, eq=False)
class HullTable:
    """A hull in a frame about the middle of its bounding box.

    Attributes:
        planes: (k, 4) float32, of its faces, outward normals and distances [m].
        corners: (m, 4) float32, places and from which side of cells on each is sharp [m], the least first.
        middle: (3,) float [m], of the box, in the shape's frame.
        half: (3,) float [m], the box's half sides.
        low: (4,) float32, the grid's low corner [m], and its cells a metre.
        cells: (3,) int, cells of the grid along x, y and z; 0 for no grid.
        counts: (cells,) int, how many planes each cell has; 0 for all.
        cell_planes: (sum of counts,) int32, their numbers.
    """

    planes: np.ndarray
    corners: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    low: np.ndarray
    cells: np.ndarray
    counts: np.ndarray
    cell_planes: np.ndarray


@lru_cache(maxsize=256)
def hull_table(shape: Hull) -> HullTable:
    """Return a hull's table."""
    points = shape.mesh()[0]
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    planes = in_separating_order(shape.planes)
    planes[:, 3] -= planes[:, :3] @ middle
    outer = outer_corners(points - middle)
    corners = np.column_stack([outer, corner_scales(outer, planes)])
    corners = corners[np.argsort(corners[:, 3], kind="stable")]
    planes, corners = planes.astype(np.float32), corners.astype(np.float32)
    return HullTable(planes, corners, middle, half, *_grid(planes.astype(float), half))


def _grid(planes: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return ``low``, ``cells``, ``counts`` and ``cell_planes`` of a `HullTable`."""
    low = half + AROUND
    side = 2.0 * low.max() / CELLS
    cells = np.ceil(2.0 * low / side).astype(int) if len(planes) > FEW else np.zeros(3, int)
    numbers = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    reach = (0.5 * side + ROUNDING) * np.abs(planes[:, :3]).sum(axis=1)
    kept = [np.zeros((0, len(planes)), dtype=bool)]
    for some in np.array_split(numbers, 1 + len(numbers) * len(planes) // AT_ONCE):
        heights = ((some + 0.5) * side - low) @ planes[:, :3].T - planes[:, 3]
        # somewhere in a cell a plane may be the highest, if it comes higher than another one is in all of the cell
        highest = heights + reach
        least = (heights - reach).max(axis=1, initial=-np.inf)
        near = highest.max(axis=1, initial=-np.inf) > -DEEP
        kept.append((highest > least[:, None]) & near[:, None])
    cell_planes = [np.nonzero(some)[1] for some in kept]
    corner = np.append(-low, 1.0 / side).astype(np.float32)
    return (
        corner,
        cells,
        np.concatenate([some.sum(axis=1) for some in kept]),
        np.concatenate(cell_planes).astype(np.int32),
    )


def put_hulls(shapes: Shapes, hulls: Mapping[int, HullTable], count: int, device: Any) -> None:
    """Set what the table of ``count`` shapes has of those that are hulls, by their numbers."""
    faces, corner_ends = (np.zeros((max(1, count), 2), dtype=np.int32) for _ in range(2))
    grids, lows = np.zeros((max(1, count), 4), dtype=np.int32), np.zeros((max(1, count), 4), dtype=np.float32)
    # none of these is empty on a device
    planes, corners = [np.zeros((1, 4), dtype=np.float32)], [np.zeros((1, 4), dtype=np.float32)]
    counts, cell_planes = [np.zeros(1, dtype=int)], [np.zeros(1, dtype=np.int32)]
    for k, hull in hulls.items():
        for ends, numbers, own in ((faces, planes, hull.planes), (corner_ends, corners, hull.corners)):
            first = sum(map(len, numbers))
            ends[k] = first, first + len(own)
            numbers.append(own)
        grids[k] = sum(map(len, counts)), *hull.cells
        lows[k] = hull.low
        counts.append(hull.counts)
        cell_planes.append(hull.cell_planes)
    # a cell's list begins where that before it ends; one number stands before all
    cell_ends = 1 + np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    shapes.faces, shapes.corner_ends = (wp.array(ends, dtype=wp.vec2i, device=device) for ends in (faces, corner_ends))
    shapes.planes, shapes.corners, shapes.hull_low = (
        wp.array(each, dtype=wp.vec4, device=device) for each in (np.concatenate(planes), np.concatenate(corners), lows)
    )
    shapes.hull_grid = wp.array(grids, dtype=wp.vec4i, device=device)
    shapes.cell_ends = wp.array(cell_ends.astype(np.int32), dtype=int, device=device)
    shapes.cell_planes = wp.array(np.concatenate(cell_planes), dtype=int, device=device)


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


def outer_corners(points: np.ndarray) -> np.ndarray:
    """Return those of a hull's corners (n, 3) whose own hull leaves none out by more than ``SPARE``."""
    from scipy.spatial import ConvexHull, QhullError

    ways = np.stack(np.meshgrid(*3 * [(-1.0, 0.0, 1.0)]), axis=-1).reshape(-1, 3)
    chosen = np.unique((points @ ways.T).argmax(axis=0))
    for _ in range(len(points)):
        try:
            planes = ConvexHull(points[chosen]).equations
        except QhullError:  # those are in one plane
            return points
        heights = points @ planes[:, :3].T + planes[:, 3]
        farthest = heights.argmax(axis=0)
        farthest = farthest[heights.max(axis=0) > SPARE]
        if not len(farthest):
            break
        chosen = np.union1d(chosen, farthest)
    return points[chosen]


def corner_scales(corners: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return from which side of cells on (m,) [m] the corners of a hull stand through triangles; inf for never.

    Of cells of side h, the vertices about a corner are some h / 2 away. Along the line through it on which the surface
    falls the least, it must have fallen by h / 24 there. Along an edge of the hull it does not fall: a corner within
    one is left to the triangles' edges.

    Args:
        corners: (m, 3) [m].
        planes: (k, 4), as in a `HullTable`.
    """
    angles = np.arange(2 * DIRECTIONS) * (np.pi / DIRECTIONS)
    found = np.full(len(corners), np.inf)
    few = planes[:: max(1, len(planes) // OTHERS)]
    for k, corner in enumerate(corners):
        under = planes[:, :3] @ corner - planes[:, 3]
        n = planes[under > -ON_PLANE, :3].sum(axis=0)
        n /= np.linalg.norm(n)
        first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
        first /= np.linalg.norm(first)
        ways = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * np.cross(n, first)
        near = planes
        if len(planes) > NEAREST + OTHERS:
            near = np.concatenate([planes[np.argpartition(-under, NEAREST)[:NEAREST]], few])
        # down to the planes that look up from beside the corner: (scales, ways, planes)
        up = near[:, :3] @ n
        near, up = near[up > 1e-3], up[up > 1e-3]
        steps = 0.5 * SCALES[:, None, None] * (ways @ near[:, :3].T)
        falls = ((near[:, :3] @ corner - near[:, 3] + steps) / up).max(axis=2)
        least = 0.5 * (falls[:, :DIRECTIONS] + falls[:, DIRECTIONS:]).min(axis=1)
        stands_out = least > SAGITTA * SCALES
        if stands_out.any():
            found[k] = SCALES[stands_out.argmax()]
    return found
