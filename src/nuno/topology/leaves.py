"""A cloth's elements grouped into leaves of neighbouring vertices: what self-contact looks through.

Leaves come from halving the rest shape again and again, so that leaves with neighbouring numbers are neighbours too,
and groups of consecutive leaves can be passed over together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAF_VERTICES = 4
"""Vertices of a block, at most."""


MIN_REGION, MAX_REGION = 4, 16
"""Consecutive leaves whose displacements are looked at together, to tell how long a list is good: finer regions tell it
longer, and each is asked beside each other."""
REGIONS = 32
"""About so many regions a cloth has, within these bounds."""
FLAT_SIDE = 5
"""Vertices along a side of the regions of a sheet's grid that are found to be flat enough to be passed over."""


LOWER_RIGHT = 5
"""Kinds of creases, the first ones, that are at the lower right corner."""


def region_leaves(leaves: int) -> int:
    """Return how many consecutive leaves of so many make a region; the last one may have fewer."""
    return min(max(leaves // REGIONS, MIN_REGION), MAX_REGION)


def crease_ends(columns: int) -> tuple[tuple[int, int], ...]:
    """Return for each kind of crease where the other edge ends, counted from the lowest vertex of the diagonal's cell.

    First come those at the lower right of the two corners off the diagonal: two seams that leave it, and the diagonals
    of the cells to the right, below and to the right below. Then the two seams that leave the upper left one, whose
    diagonals see these from their own cells.

    Args:
        columns: Vertices in a row of the grid.
    """
    right, up = 1, columns
    return (
        (right, right + 1), (right - up, right), (right, right + up + 1), (-up, right), (right - up, right + 1),
        (up - 1, up), (up, up + up),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Leaves:
    """Vertices, triangles and edges sorted by leaf; each belongs to one.

    Attributes:
        vertex: (n,) int, vertex indices sorted by leaf.
        vertex_start: (count + 1,) int, where each leaf's vertices start.
        face: (m, 3) int, triangles sorted by leaf.
        face_start: (count + 1,) int.
        edge: (e, 2) int, edges sorted by leaf.
        edge_start: (count + 1,) int.
        corner: (k,) int, all vertices that a leaf's own elements have, sorted by leaf.
        corner_start: (count + 1,) int.
        crease: (c, 4) int, further pairs of edges that collide, with each other only.
        region_corner: (r,) int, all vertices of the elements of each region of `region_leaves` leaves.
        region_start: (regions + 1,) int.
        columns: Vertices in a row of a sheet's grid, if the grid has regions of `FLAT_SIDE` vertices a side; else 0.
        span: (4 w,) int, the first and last column and the first and last row of each leaf's corners on that grid,
            each of the four for all leaves, in a row of whole sixteens.
        crease_corner: (c,) int, the lowest vertex of the window of 3 by 3 vertices that holds each crease.
        crease_key: (c,) int, the lowest vertex of the cell whose diagonal each crease has, and n more for each number
            of its kind (`crease_ends`).
    """

    vertex: np.ndarray
    vertex_start: np.ndarray
    face: np.ndarray
    face_start: np.ndarray
    edge: np.ndarray
    edge_start: np.ndarray
    corner: np.ndarray
    corner_start: np.ndarray
    crease: np.ndarray
    region_corner: np.ndarray
    region_start: np.ndarray
    columns: int
    span: np.ndarray
    crease_corner: np.ndarray
    crease_key: np.ndarray

    @property
    def count(self) -> int:
        """Number of leaves."""
        return len(self.vertex_start) - 1


def make_leaves(
    rest: np.ndarray,
    faces: np.ndarray,
    edges: np.ndarray,
    crease: np.ndarray,
    size: int = LEAF_VERTICES,
    columns: int = 0,
) -> Leaves:
    """Halve the rest shape again and again along its axes until at most ``size`` vertices are left in a leaf.

    Args:
        rest: (n, 3) float, rest shape [m].
        faces: (m, 3) int, triangles.
        edges: (e, 2) int, the edges that collide.
        crease: (c, 4) int, further pairs of edges that collide, with each other only.
        size: Vertices of a leaf, at most.
        columns: Vertices in a row of a sheet's grid; 0 for what is no sheet.
    """
    count = len(rest)
    levels = max(0, int(np.ceil(np.log2(max(1.0, count / size)))))
    group = np.zeros(count, dtype=np.int64)
    extent = np.ptp(rest, axis=0)
    axes = np.argsort(-extent)[:2]
    span = extent[axes].astype(float)
    for _ in range(levels):
        k = int(np.argmax(span))
        order = np.lexsort((rest[:, axes[k]], group))
        start = np.searchsorted(group[order], np.arange(group.max() + 2))
        rank = np.empty(count, dtype=np.int64)
        rank[order] = np.arange(count) - start[group[order]]
        half = (np.diff(start) + 1) // 2
        group = 2 * group + (rank >= half[group])
        group = np.unique(group, return_inverse=True)[1]
        span[k] /= 2
    order = np.argsort(group, kind="stable")
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    leaves = int(group.max()) + 1

    def sort(elements: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        owner = group[elements[np.arange(len(elements)), np.argmin(place[elements], axis=1)]]
        by_owner = np.argsort(owner, kind="stable")
        return elements[by_owner], np.searchsorted(owner[by_owner], np.arange(leaves + 1)), owner[by_owner]

    face, face_start, face_owner = sort(faces)
    edge, edge_start, edge_owner = sort(edges)
    own = np.concatenate([group * count + np.arange(count), (face_owner[:, None] * count + face).ravel()])
    own = np.unique(np.concatenate([own, (edge_owner[:, None] * count + edge).ravel()]))
    starts = np.arange(leaves + 1)
    side = region_leaves(leaves)
    region = np.unique(own // count // side * count + own % count)
    region_start = np.searchsorted(region // count, np.arange(-(-leaves // side) + 1))
    corner, corner_start = own % count, np.searchsorted(own // count, starts)
    if min(columns, count // max(1, columns)) < FLAT_SIDE:
        columns = 0
    return Leaves(
        order, np.searchsorted(group[order], starts), face, face_start, edge, edge_start, corner, corner_start, crease,
        region % count, region_start, columns, *_grid(corner, corner_start, crease, columns, count),
    )  # fmt: skip


def _grid(
    corner: np.ndarray, start: np.ndarray, crease: np.ndarray, columns: int, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where leaves and creases are on a sheet's grid: `Leaves.span`, `crease_corner` and `crease_key`."""
    leaves = len(start) - 1
    span = np.zeros((4, -(-leaves // 16) * 16), dtype=np.int64)
    if columns == 0:
        return span.ravel(), *np.zeros((2, len(crease)), dtype=np.int64)
    for k, place in enumerate((corner % columns, corner // columns)):
        span[2 * k, :leaves] = np.minimum.reduceat(place, start[:-1])
        span[2 * k + 1, :leaves] = np.maximum.reduceat(place, start[:-1])
    left = np.minimum((crease % columns).min(axis=1), columns - 3)
    low = np.minimum((crease // columns).min(axis=1), count // columns - 3)
    return span.ravel(), low * columns + left, _keys(crease, columns, count)


def _keys(crease: np.ndarray, columns: int, count: int) -> np.ndarray:
    """Return `Leaves.crease_key`."""
    keys = np.zeros(len(crease), dtype=np.int64)
    for first, second in ((crease[:, :2], crease[:, 2:]), (crease[:, 2:], crease[:, :2])):
        cell = first[:, 0]
        for kind, ends in enumerate(crease_ends(columns)):
            such = (first[:, 1] == cell + columns + 1) & (second == cell[:, None] + ends).all(axis=1)
            keys[such] = cell[such] + kind * count
    return keys
