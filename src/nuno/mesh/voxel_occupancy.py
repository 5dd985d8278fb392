"""The part of each voxel of a lattice that is inside a closed mesh, from where straight lines cross the surface."""

from __future__ import annotations

import numpy as np

SAMPLES = 8  # lines per voxel along each of its edges
TOUCH = 1e-6  # of the lattice's extent: parts that overlap by less only touch


def filled_fraction(points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int]) -> tuple[np.ndarray, int]:
    """Return how much of each voxel is inside.

    Lines of a regular pattern run along each of the axes, 64 through every face of a voxel; along a line the part
    inside is exact. The three directions are averaged.

    Args:
        points: (n, 3) float, in edges of a voxel from the lattice's corner.
        faces: (m, 3) int, closed, counterclockwise from outside.
        cells: Voxels along x, y, z.

    Returns:
        fraction (nx, ny, nz), and how many lines run through a place that is inside more than once, or less than not
        at all: where the mesh overlaps itself. It is 0 where lines along one of the axes see no such place.
    """
    total, overlaps = np.zeros(cells), []
    for axis in range(3):
        axes = [(axis + 1) % 3, (axis + 2) % 3, axis]
        part, crossed = _along_last_axis(points[:, axes], faces, (cells[axes[0]], cells[axes[1]], cells[axes[2]]))
        total += np.transpose(part, np.argsort(axes))
        overlaps.append(crossed)
    # Rounding may turn the order of two crossings of one line around, but not along all axes.
    return np.clip(total / 3.0, 0.0, 1.0), sum(overlaps) if min(overlaps) else 0


def inside_nodes(points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int]) -> np.ndarray:
    """Return (nx + 1, ny + 1, nz + 1) bool, the lattice's nodes that are inside; one on the surface may be either.

    Lines through the nodes run along each of the axes; where rounding lets one slip between two faces, the other two
    decide.

    Args:
        points: (n, 3) float, in edges of a voxel from the lattice's corner.
        faces: (m, 3) int, closed, counterclockwise from outside.
        cells: Voxels along x, y, z.
    """
    votes = np.zeros([count + 1 for count in cells], dtype=int)
    for axis in range(3):
        axes = [(axis + 1) % 3, (axis + 2) % 3, axis]
        nx, ny, nz = (cells[t] + 1 for t in axes)
        moved = points[:, axes].copy()
        moved[:, :2] = (moved[:, :2] + 0.5) / SAMPLES  # a line of the pattern through every node
        line, height, sign = _crossings(moved, faces, (nx, ny))
        sound = np.bincount(line, sign, minlength=nx * ny) == 0
        above = np.clip(np.floor(height).astype(int) + 1, 0, nz)
        depth = np.bincount(line * (nz + 1) + above, sign, minlength=nx * ny * (nz + 1)).reshape(-1, nz + 1)
        inside = np.cumsum(depth, axis=1)[:, :nz] > 0.5
        vote = np.where(sound[:, None], np.where(inside, 1, -1), 0).reshape(nx, ny, nz)
        votes += np.transpose(vote, np.argsort(axes))
    return votes > 0


def _along_last_axis(points: np.ndarray, faces: np.ndarray, cells: tuple[int, int, int]) -> tuple[np.ndarray, int]:
    nx, ny, nz = cells
    line, height, sign = _crossings(points, faces, (nx * SAMPLES, ny * SAMPLES))
    # A line that rounding lets slip between two faces leaves the mesh more often than it enters; it does not count.
    balance = np.bincount(line, sign, minlength=nx * ny * SAMPLES**2)
    sound = balance == 0
    keep = sound[line]
    line, height, sign = line[keep], height[keep], sign[keep]
    order = np.lexsort((height, line))
    depth = np.cumsum(sign[order])  # how often what lies above a crossing is inside; every line adds up to 0
    gap = np.diff(height[order], append=np.inf)
    overlaps = len(np.unique(line[order][((depth > 1) | (depth < 0)) & (gap > TOUCH * max(cells))]))

    i, j = np.divmod(line, ny * SAMPLES)
    column = i // SAMPLES * ny + j // SAMPLES
    k = np.clip(height.astype(int), 0, nz - 1)
    # Above a crossing its sign counts: in part in the voxel that it lies in, in whole in those above.
    there = np.bincount(column * nz + k, sign * (k + 1 - height), minlength=nx * ny * nz).reshape(nx, ny, nz)
    above = np.zeros((nx, ny, nz + 1))
    above[..., 1:] = np.bincount(column * nz + k, sign, minlength=nx * ny * nz).reshape(nx, ny, nz)
    lines = sound.reshape(nx, SAMPLES, ny, SAMPLES).sum(axis=(1, 3))
    inside = there + np.cumsum(above, axis=2)[..., :-1]
    return inside / np.maximum(lines, 1)[..., None], overlaps


def _crossings(points: np.ndarray, faces: np.ndarray, lines: tuple[int, int]) -> tuple[np.ndarray, ...]:
    """Return line (c,), height (c,) and sign (c,): 1 where a line upwards enters, -1 where it leaves."""
    corners = points[faces]
    low = np.ceil(corners[..., :2].min(axis=1) * SAMPLES - 0.5).astype(int)
    high = np.floor(corners[..., :2].max(axis=1) * SAMPLES - 0.5).astype(int)
    low, high = np.maximum(low, 0), np.minimum(high, np.array(lines) - 1)
    span = np.maximum(high - low + 1, 0)
    found: list[tuple[np.ndarray, ...]] = []
    for batch in _batches(span.prod(axis=1)):
        count = span[batch].prod(axis=1)
        face = np.repeat(batch, count)
        within = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
        i = low[face, 0] + within // span[face, 1]
        j = low[face, 1] + within % span[face, 1]
        x, y = (i + 0.5) / SAMPLES, (j + 0.5) / SAMPLES
        left = [_left_of(corners[face, a], corners[face, b], x, y) for a, b in ((1, 2), (2, 0), (0, 1))]
        side = np.stack([side for side, _ in left])
        hit = side.all(axis=0) | ~side.any(axis=0)
        area = np.stack([area[hit] for _, area in left])
        sign = np.where(side[0, hit], -1.0, 1.0)  # counterclockwise from above looks up: a line upwards leaves there
        whole = area.sum(axis=0)
        level = corners[face[hit]][..., 2].T
        height = np.where(whole == 0.0, level.mean(axis=0), (area * level).sum(axis=0) / np.where(whole == 0, 1, whole))
        found.append((i[hit] * lines[1] + j[hit], height, sign))
    if not found:
        return np.zeros(0, dtype=int), np.zeros(0), np.zeros(0)
    return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))


def _batches(count: np.ndarray, size: int = 1_000_000) -> list[np.ndarray]:
    """Return the indices of faces with something to do, in blocks of bounded work."""
    busy = np.flatnonzero(count)
    return [part for part in np.split(busy, np.flatnonzero(np.diff(np.cumsum(count[busy]) // size)) + 1) if len(part)]


def _left_of(a: np.ndarray, b: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return True if (x, y) is left of the edge from a to b, seen from above, and twice the area that they span.

    Both faces of an edge take the same product with its ends in the same order, so that no line slips between them; a
    line through an edge counts as shifted by an infinitely small (dx, dy), dx much greater than dy.
    """
    swap = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    p, q = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)
    along_x, along_y = q[:, 0] - p[:, 0], q[:, 1] - p[:, 1]
    area = along_x * (y - p[:, 1]) - along_y * (x - p[:, 0])
    tie = np.where(along_y != 0.0, along_y < 0.0, along_x > 0.0)
    left = np.where(area == 0.0, tie, area > 0.0)
    return left != swap, np.where(swap, -area, area)
