"""Triangles of even size inside any polygon, by SciPy's Delaunay triangulation.

The outline is divided evenly and points are put inside in staggered rows, which are then relaxed (Lloyd's method on
the triangles: each inner point goes to the mean of its neighbours). Delaunay's triangles of points hold every side of
an outline whose diametral circle is empty (Gabriel); sides that are missing, where the polygon is narrow or sharp, are
halved until none is (Ruppert's rule). Triangles outside are left out.
"""

from __future__ import annotations

import numpy as np

from nuno.errors import MeshError
from nuno.mesh.polygon import along_outline, contains, crosses_itself, distance_to_outline, signed_area, staggered

FROM_OUTLINE = 0.65
"""Least distance of an inner point from the outline, in edges: nearer ones make flat triangles."""
RELAXATIONS = 8
HALVINGS = 12


def triangulate(
    polygon: np.ndarray, edge: float, *, sampled: bool = False, relaxations: int = RELAXATIONS
) -> tuple[np.ndarray, np.ndarray, int]:
    """Divide the inside of a polygon into triangles.

    Args:
        polygon: (n, 2) [m], without crossing itself, in either direction.
        edge: About how long a triangle's side should be [m].
        sampled: Whether the polygon's points are the outline's vertices already; else its outline is divided evenly
            between sharp corners.
        relaxations: How often inner points go to the mean of their neighbours.

    Returns:
        Points (k, 2) [m], those of the outline first, in its order, anticlockwise; faces (m, 3) int, anticlockwise; and
        the number of points on the outline.

    Raises:
        MeshError: a polygon that crosses itself or has no area.
    """
    polygon = np.asarray(polygon, dtype=float)
    if len(polygon) < 3 or abs(signed_area(polygon)) < 1e-3 * edge**2:
        raise MeshError(f"a polygon of {len(polygon)} points and {abs(signed_area(polygon)):.3g} m2 has no inside")
    if crosses_itself(polygon):
        raise MeshError("the polygon crosses itself, so it has no inside")
    polygon = polygon if signed_area(polygon) > 0.0 else polygon[::-1]
    rim = polygon if sampled else along_outline(polygon, edge)
    if not sampled and crosses_itself(rim):
        rim = polygon
    inner = staggered(polygon.min(axis=0), polygon.max(axis=0), edge)
    inner = inner[contains(rim, inner)]
    inner = inner[distance_to_outline(rim, inner) > FROM_OUTLINE * edge] if len(inner) else inner
    rim, faces = _conforming(rim, inner, not sampled)
    for _ in range(relaxations if len(inner) else 0):
        moved = _mean_of_neighbours(np.concatenate([rim, inner]), faces)[len(rim) :]
        # what would come too near the outline stays
        far = distance_to_outline(rim, moved) > 0.9 * FROM_OUTLINE * edge
        inner = np.where((far & contains(rim, moved))[:, None], moved, inner)
        rim, faces = _conforming(rim, inner, not sampled)
    points = np.concatenate([rim, inner])
    used = np.unique(faces)
    if len(used) < len(points):  # an inner point whose triangles are all outside; the outline's are all used
        number = np.full(len(points), -1)
        number[used] = np.arange(len(used))
        points, faces = points[used], number[faces]
    return points, faces, len(rim)


def _conforming(rim: np.ndarray, inner: np.ndarray, may_halve: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the outline (k, 2), with missing sides halved, and the triangles (m, 3) of it and the inner points."""
    from scipy.spatial import Delaunay, QhullError

    for _ in range(HALVINGS):
        points = np.concatenate([rim, inner])
        try:
            faces = Delaunay(points).simplices
        except QhullError as error:
            raise MeshError(f"the polygon cannot be divided into triangles: {error}") from error
        pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        there = set(map(tuple, pairs.tolist()))
        n = len(rim)
        missing = [k for k in range(n) if (min(k, (k + 1) % n), max(k, (k + 1) % n)) not in there]
        if not missing:
            return rim, _inside(rim, points, faces)
        if not may_halve:
            break
        middles = 0.5 * (rim + np.roll(rim, -1, axis=0))[missing]
        rim = np.insert(rim, np.array(missing) + 1, middles, axis=0)
    raise MeshError(
        f"{len(missing)} sides of the outline would not be sides of triangles: it is too narrow somewhere for this edge"
    )


def _inside(rim: np.ndarray, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the triangles (m, 3) inside the outline that have an area, anticlockwise."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    double = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where(double[:, None] > 0, faces, faces[:, ::-1])
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    # three points of a straight side make a sliver of rounding's size outside of it
    return np.asarray(faces[contains(rim, (a + b + c) / 3.0) & (np.abs(double) > 1e-6 * longest)])


def _mean_of_neighbours(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (n, 2), the mean of each point's neighbours by edges of triangles."""
    pairs = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    count = np.maximum(np.bincount(both[:, 0], minlength=len(points)), 1)
    return np.stack([np.bincount(both[:, 0], points[both[:, 1], k], len(points)) / count for k in range(2)], axis=1)


def quality(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (m,) the mean ratio of each triangle (points (n, 2)): 1 for an equilateral one, 0 for a flat one."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    double = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    squares = sum(((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a)))
    return np.asarray(2.0 * np.sqrt(3.0) * double / squares)
