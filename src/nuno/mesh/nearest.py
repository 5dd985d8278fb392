"""The nearest points on a triangle mesh or on a set of line segments, for many points at once."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree


class NearestOn:
    """The points of simplices, triangles or segments, that are nearest to given points.

    Simplices longer than ``longest`` are divided, and sorted into classes by size, each with a k-d tree of the
    centres: the nearest one is no farther than the nearest centre, and its own centre no farther than that and its
    radius.
    """

    def __init__(self, corners: np.ndarray, longest: float) -> None:
        """Sort the simplices.

        Args:
            corners: (m, 2 or 3, 3) [m], the ends of segments or the corners of triangles.
            longest: Length of an edge above which a simplex is divided [m].
        """
        corners = _divided(corners, longest)
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        size = np.floor(np.log2(np.maximum(radius, 1e-6 * longest) / longest))
        self._classes = []
        for one in np.unique(size):
            own = size == one
            self._classes.append((corners[own], cKDTree(centre[own]), float(radius[own].max())))
        self.centres = centre
        """(k, 3) [m], the centres of the divided simplices: samples at most about ``longest`` apart."""

    def bound(self, points: np.ndarray) -> np.ndarray:
        """Return (n,) [m]: the nearest simplex is no farther than that, and at most ``longest`` nearer."""
        return np.min([tree.query(points)[0] for _, tree, _ in self._classes], axis=0)

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """Return (n, 3) [m], the nearest point of all simplices to each of the points (n, 3)."""
        bound = self.bound(points)
        best, found = np.full(len(points), np.inf), points.copy()
        for corners, tree, radius in self._classes:
            # a little more than the bound, so that rounding leaves none out
            near = tree.query_ball_point(points, (bound + radius) * (1.0 + 1e-9), return_sorted=True)
            count = np.array([len(some) for some in near])
            if not count.any():
                continue
            which = np.repeat(np.arange(len(points)), count)
            simplex = corners[np.concatenate([np.asarray(some, dtype=int) for some in near if some])]
            on = nearest_on_segment(points[which], simplex) if corners.shape[1] == 2 else nearest_on_triangle(
                points[which], simplex
            )  # fmt: skip
            far = np.linalg.norm(on - points[which], axis=1)
            order = np.lexsort((far, which))
            first = order[np.searchsorted(which[order], np.flatnonzero(count))]
            closer = far[first] < best[which[first]]
            first = first[closer]
            best[which[first]], found[which[first]] = far[first], on[first]
        return found


def nearest_on_segment(points: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return (n, 3), the nearest point of each segment (n, 2, 3) to each point (n, 3)."""
    along = ends[:, 1] - ends[:, 0]
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    part = np.clip(((points - ends[:, 0]) * along).sum(axis=1) / square, 0.0, 1.0)
    return ends[:, 0] + part[:, None] * along


def nearest_on_triangle(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return (n, 3), the nearest point of each triangle (n, 3, 3) to each point (n, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = np.maximum((normal**2).sum(axis=1), 1e-300)
    foot = points - normal * (((points - a) * normal).sum(axis=1) / square)[:, None]
    inside = np.ones(len(points), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(q - p, foot - p) * normal).sum(axis=1) >= 0.0
    edges = np.stack([nearest_on_segment(points, np.stack(pair, axis=1)) for pair in ((a, b), (b, c), (c, a))])
    far = ((edges - points) ** 2).sum(axis=2)
    on_edge = edges[np.argmin(far, axis=0), np.arange(len(points))]
    return np.where(inside[:, None], foot, on_edge)


def _divided(corners: np.ndarray, longest: float) -> np.ndarray:
    """Return the simplices, halved across their longest edge until none is longer."""
    done = []
    while len(corners):
        count = corners.shape[1]
        edge = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edge.max(axis=1) > longest
        done.append(corners[~long])
        corners, first = corners[long], np.argmax(edge[long], axis=1)
        each = np.arange(len(corners))
        turned = corners[each[:, None], (first[:, None] + np.arange(count)) % count]
        middle = turned[:, :2].mean(axis=1)
        one, other = turned.copy(), turned.copy()
        one[:, 1], other[:, 0] = middle, middle
        corners = np.concatenate([one, other])
    return np.concatenate(done)
