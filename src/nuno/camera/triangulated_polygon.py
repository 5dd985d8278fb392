"""A polygon without holes as triangles, which are taken away one by one (Felzenszwalb, PAMI 2005, sections 2 and 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import finite_array

MAX_VERTICES = 4096
"""Of an outline that is given; it is searched for with far fewer."""
_THIN = 1e-4  # of a polygon: its area over its perimeter squared; a square has 0.0625


@dataclass(frozen=True, eq=False)
class TriangulatedPolygon:
    """A simple polygon, anticlockwise where y points up, and its constrained Delaunay triangulation.

    The triangles of such a polygon are the nodes of a tree, so that there is always a vertex that belongs to one
    triangle alone. Taken away one after another in ``order``, all vertices but two are such a one.

    Attributes:
        points: (n, 2) float.
        triangles: (n - 2, 3) int, vertices, anticlockwise.
        order: For each vertex that is taken away (k, i, j): itself and the other two of its triangle, of which j is
            taken away before i, or they are the last two.
    """

    points: np.ndarray
    triangles: np.ndarray
    order: tuple[tuple[int, int, int], ...]

    @property
    def sides(self) -> list[tuple[int, int]]:
        """The polygon's own edges."""
        count = len(self.points)
        return [(k, (k + 1) % count) for k in range(count)]


def check_outline(outline: ArrayLike, name: str = "outline") -> np.ndarray:
    """Return an outline (n, 2) float as given, but anticlockwise and without repeated points.

    Raises:
        InvalidInputError: fewer than three points, sides that cross or touch, or no area.
    """
    points = finite_array(name, outline, ("n", 2))
    if len(points) > MAX_VERTICES:
        raise InvalidInputError(f"{name} has {len(points)} points, at most {MAX_VERTICES} are taken")
    points = points[np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1) > 0.0]
    if len(points) < 3:
        raise InvalidInputError(
            f"{name} must be the corners of a polygon, (n, 2) with n >= 3, got {len(points)} points"
        )
    area = signed_area(points)
    around = float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum())
    if abs(area) <= _THIN * around * around:
        raise InvalidInputError(f"{name} has hardly any area: {abs(area):.3g} with a perimeter of {around:.3g}")
    if _crosses(points):
        raise InvalidInputError(f"the sides of {name} cross or touch each other; its points must go around it in order")
    return points if area > 0 else np.ascontiguousarray(points[::-1])


def signed_area(points: np.ndarray) -> float:
    """Return the area of a polygon (n, 2), positive where it goes anticlockwise (y up)."""
    x, y = points[:, 0], points[:, 1]
    return 0.5 * float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def with_vertices(outline: np.ndarray, most: int) -> np.ndarray:
    """Return an outline (n, 2) with about ``most`` vertices: small bends left out, long sides divided evenly."""
    size = float(np.sqrt(abs(signed_area(outline))))
    corners = outline
    tolerance = 0.01
    while len(corners) > max(most, 3) or tolerance == 0.01:
        kept = cv2.approxPolyDP((outline / size).astype(np.float32)[:, None], tolerance, True)[:, 0] * size
        if len(kept) < 3 or signed_area(kept) < 0.5 * size * size or _crosses(kept):
            break
        corners, tolerance = kept.astype(float), 1.4 * tolerance
    lengths = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    pieces = np.ones(len(corners), dtype=int)
    while pieces.sum() < most:
        pieces[np.argmax(lengths / pieces)] += 1
    ends = np.roll(corners, -1, axis=0)
    parts = [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(corners, ends, pieces, strict=True)]
    return np.concatenate(parts)


def triangulate_polygon(points: np.ndarray) -> TriangulatedPolygon:
    """Triangulate a simple polygon (n, 2), anticlockwise: ears are cut, then diagonals flipped until all are Delaunay.

    Raises:
        InvalidInputError: it is not simple.
    """
    triangles = _flip(points, _cut_ears(points))
    return TriangulatedPolygon(points, np.array(triangles), tuple(_elimination(triangles)))


def _crosses(points: np.ndarray) -> bool:
    """Tell if two sides of a polygon (n, 2) meet that are no neighbours, or neighbours lie on each other."""
    a, b = points, np.roll(points, -1, axis=0)
    for k in range(len(points)):
        forward, onward = b[k] - a[k], np.roll(points, -2, axis=0)[k] - b[k]
        if forward[0] * onward[1] == forward[1] * onward[0] and forward @ onward < 0:
            return True
        others = np.arange(k + 2, len(points) - (k == 0))
        if not len(others):
            continue
        one, two = _side(a[k], b[k], a[others]), _side(a[k], b[k], b[others])
        three, four = _side(a[others], b[others], a[k]), _side(a[others], b[others], b[k])
        apart = np.any((np.maximum(a[k], b[k]) < np.minimum(a[others], b[others]))
                       | (np.minimum(a[k], b[k]) > np.maximum(a[others], b[others])), axis=1)  # fmt: skip
        if ((one * two <= 0) & (three * four <= 0) & ~apart).any():
            return True
    return False


def _side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return on which side of lines a b points c lie: positive to the left."""
    return np.sign((b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0])


def _cut_ears(points: np.ndarray) -> list[tuple[int, int, int]]:
    """Triangles of a simple polygon; of all ears the one whose smallest angle is largest is cut first."""
    left, triangles = list(range(len(points))), []
    while len(left) > 3:
        best, ear = 0.0, -1
        for at in range(len(left)):
            i, k, j = left[at - 1], left[at], left[(at + 1) % len(left)]
            if _side(points[i], points[k], points[j]) <= 0:
                continue
            others = points[[v for v in left if v not in (i, k, j)]]
            inside = (
                (_side(points[i], points[k], others) >= 0)
                & (_side(points[k], points[j], others) >= 0)
                & (_side(points[j], points[i], others) >= 0)
            )
            quality = _smallest_sine(points[[i, k, j]])
            if not inside.any() and quality > best:
                best, ear = quality, at
        if ear < 0:
            raise InvalidInputError("the polygon cannot be triangulated: its sides cross or touch each other")
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    triangles.append((left[0], left[1], left[2]))
    return triangles


def _smallest_sine(corners: np.ndarray) -> float:
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    return 2.0 * abs(signed_area(corners)) * float(lengths.min()) / float(lengths.prod())


def _flip(points: np.ndarray, triangles: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Flip diagonals whose opposite angles have a sum above pi until there are none (Lawson 1977)."""
    found = list(triangles)
    for _ in range(len(found) * len(found) + 1):
        owners: dict[frozenset[int], list[int]] = {}
        for t, (a, b, c) in enumerate(found):
            for pair in ((a, b), (b, c), (c, a)):
                owners.setdefault(frozenset(pair), []).append(t)
        for edge, both in owners.items():
            if len(both) != 2:
                continue
            first, second = both
            apex, other = (next(v for v in found[t] if v not in edge) for t in (first, second))
            at = found[first].index(apex)
            i, j = found[first][(at + 1) % 3], found[first][(at + 2) % 3]
            if _angle(points, i, apex, j) + _angle(points, i, other, j) > np.pi + 1e-9:
                found[first], found[second] = (apex, i, other), (apex, other, j)
                break
        else:
            break
    return found


def _angle(points: np.ndarray, i: int, apex: int, j: int) -> float:
    a, b = points[i] - points[apex], points[j] - points[apex]
    return float(np.arctan2(abs(a[0] * b[1] - a[1] * b[0]), a @ b))


def _elimination(triangles: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Take vertices away that belong to one triangle alone, from the tree's leaves inwards."""
    left = list(range(len(triangles)))
    steps: list[tuple[int, int, int]] = []
    while left:
        uses: dict[int, int] = {}
        for t in left:
            for v in triangles[t]:
                uses[v] = uses.get(v, 0) + 1
        t = next(t for t in left if any(uses[v] == 1 for v in triangles[t]))
        k = next(v for v in triangles[t] if uses[v] == 1)
        at = triangles[t].index(k)
        steps.append((k, triangles[t][(at + 1) % 3], triangles[t][(at + 2) % 3]))
        left.remove(t)
    when = {step[0]: (number, 0) for number, step in enumerate(steps)}
    ranks = {v: when.get(v, (len(steps), v)) for step in steps for v in step}
    return [(k, i, j) if ranks[i] > ranks[j] else (k, j, i) for k, i, j in steps]
