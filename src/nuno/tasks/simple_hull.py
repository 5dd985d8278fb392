"""Convex hulls of few faces, near to those of many by a bound that is measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.shapes.shape import Hull

NARROWER = 0.75
"""A hull that turns out too far off is tried again with this much less room."""
TRIES = 8
NEAREST = 16
"""Faces that a corner's distance is taken from: those it is farthest before. With fewer the bound is only wider."""


def simple_hull(points: np.ndarray, error: float) -> tuple[Hull, float]:
    """Return a hull whose surface is nowhere farther than ``error`` [m] from that of points' own hull.

    Quickhull stops where no point is more than twice the error before a face; each face is then moved out by half of
    what is before it, so that the hull lies on both sides of the true one.

    Args:
        points: (n, 3) [m], not all in one plane.
        error: How far the two may be apart [m].

    Returns:
        The hull, about the mean of its corners, and how far the two surfaces are apart at the most [m]; the points'
        own hull where none simpler is near enough.
    """
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    true = ConvexHull(points)
    width = 2.0 * error
    for _ in range(TRIES):
        inner = ConvexHull(points, qhull_options=f"Qt W{width}")
        faces = np.unique(inner.equations, axis=0)
        faces[:, 3] -= 0.5 * np.maximum(faces[:, :3] @ points[true.vertices].T + faces[:, 3:], 0.0).max(axis=1)
        moved = ConvexHull(HalfspaceIntersection(faces, points[true.vertices].mean(axis=0)).intersections)
        apart = max(_farthest(moved, true), _farthest(true, moved))
        if apart <= error:
            return _hull(moved), apart
        width *= NARROWER
    return _hull(true), 0.0


def _farthest(inner: Any, outer: Any) -> float:
    """Return a bound of how far any corner of one Qhull hull is outside another [m]."""
    from trimesh.triangles import closest_point

    corners = inner.points[inner.vertices]
    heights = corners @ outer.equations[:, :3].T + outer.equations[:, 3]
    corners, heights = corners[heights.max(axis=1) > 0.0], heights[heights.max(axis=1) > 0.0]
    if not len(corners):
        return 0.0
    few = min(NEAREST, heights.shape[1])
    chosen = np.argpartition(-heights, few - 1, axis=1)[:, :few]
    triangles = outer.points[outer.simplices[chosen]].reshape(-1, 3, 3)
    repeated = np.repeat(corners, few, axis=0)
    found = np.linalg.norm(closest_point(triangles, repeated) - repeated, axis=1).reshape(-1, few)
    return float(found.min(axis=1).max())


def _hull(found: Any) -> Hull:
    return Hull.of(found.points[found.vertices])
