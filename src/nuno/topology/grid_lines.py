"""grid lines: the edges of a sheet strung into lines along warp and weft."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nuno.topology.cloth_topology import Elements


@lru_cache(maxsize=8)
def find_grid_lines(edges: Elements) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Order edges so that each grid line's follow one another, the second vertex of one the first of the next.

    What it returns is kept for who asks again, and not to be written to.

    Args:
        edges: Edges whose ``axis`` is 0 (warp) or 1 (weft); none but the ends of a grid line branch.

    Returns:
        order (m,) int, which edge comes when; starts (grid lines + 1,) int32, where each grid line begins in that
        order; and kinds (3,) int32, the first grid line along warp, the first along weft, and the number of grid lines.
    """
    order: list[np.ndarray] = []
    lengths: list[np.ndarray] = []
    kinds = [0]
    for axis in (0, 1):
        own = np.nonzero(edges.axis == axis)[0]
        head, tail = edges.vertices[own].T
        follows = np.full(int(edges.vertices.max(initial=0)) + 1, -1, dtype=np.int64)
        follows[head] = np.arange(len(own))
        now = np.sort(follows[np.setdiff1d(head, tail)])
        now = now[np.argsort(head[now], kind="stable")]
        steps = []
        while (now >= 0).any():
            steps.append(now)
            now = np.where(now >= 0, follows[tail[now]], -1)
        table = np.stack(steps, axis=1) if steps else np.zeros((0, 0), dtype=np.int64)
        order.append(own[table[table >= 0]])
        lengths.append((table >= 0).sum(axis=1))
        kinds.append(kinds[-1] + len(table))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(lengths))])
    return np.concatenate(order), starts.astype(np.int32), np.array(kinds, dtype=np.int32)
