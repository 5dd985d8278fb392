"""Points on a triangle mesh: a face and barycentric weights, which move along with the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.errors import InvalidInputError
from nuno.validation import as_array, finite_array, index_array

NEGATIVE = -1e-6  # weights may be this far outside [0, 1] by rounding


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on faces.

    Attributes:
        faces: (k,) int, the same points in every world, or (worlds, k); -1 is no point (a grip that one
            world of a batch goes without).
        barycentric: (k, 3) or (worlds, k, 3) float, the weights of the face's corners, adding up to 1.

    Raises:
        InvalidInputError: shapes that do not fit, or weights that are negative or do not add up to 1.
    """

    faces: np.ndarray
    barycentric: np.ndarray

    if TYPE_CHECKING:  # arrays may be given as lists

        def __init__(
            self, faces: ArrayLike, barycentric: ArrayLike,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        faces = np.atleast_1d(as_array("faces", self.faces))
        if faces.dtype.kind not in "iu" or faces.ndim > 2 or faces.size == 0:
            raise InvalidInputError(f"faces must be whole numbers of shape (k,) or (worlds, k), got {self.faces!r}")
        weights = np.atleast_2d(as_array("barycentric", self.barycentric))
        weights = finite_array("barycentric", weights, (*faces.shape, 3))
        if weights.min() < NEGATIVE or np.abs(weights.sum(axis=-1) - 1.0).max() > 1e-5:
            raise InvalidInputError("barycentric weights must be at least 0 and add up to 1")
        object.__setattr__(self, "faces", faces.astype(np.int32))
        object.__setattr__(self, "barycentric", weights)

    def __len__(self) -> int:
        return int(self.faces.shape[-1])

    def per_world(self) -> SurfacePoints:
        """Return these k points as one point for each of k worlds.

        Raises:
            InvalidInputError: they differ by world already.
        """
        if self.faces.ndim != 1:
            raise InvalidInputError(f"the points are by world already: faces has shape {self.faces.shape}")
        return SurfacePoints(self.faces[:, None], self.barycentric[:, None])

    def positions(self, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return where the points are on a mesh: (k, 3), or (worlds, k, 3) where either is by world [m]."""
        for name, given in (("vertices", vertices), ("faces", faces)):
            if not isinstance(given, np.ndarray) or given.ndim not in ((2, 3) if name == "vertices" else (2,)):
                raise InvalidInputError(f"{name} must be an array of rows of three, got {type(given).__name__}")
            if given.shape[-1] != 3 or not given.shape[-2]:
                raise InvalidInputError(f"{name} must be rows of three, got {given.shape}")
        corners = faces[self.faces]
        if vertices.ndim == 3:
            corners = np.broadcast_to(corners, (len(vertices), *corners.shape[-2:]))
            chosen = vertices[np.arange(len(vertices))[:, None, None], corners]
        else:
            chosen = vertices[corners]
        return np.einsum("...kc,...kcx->...kx", self.barycentric, chosen)


def closest_points(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> SurfacePoints:
    """Return the surface points closest to ``points`` (k, 3) [m] on a mesh of vertices (n, 3) [m].

    Every point meets every face, in blocks of bounded memory; the closest point on a triangle follows
    Ericson, "Real-Time Collision Detection" (2005), section 5.1.5.
    """
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    found, weights = np.empty(len(points), dtype=np.int32), np.empty((len(points), 3))
    batch = max(1, 200_000 // len(faces))
    for start in range(0, len(points), batch):
        p = points[start : start + batch, None, :]
        w = _closest_weights(p, a, b, c)
        nearest = w[..., :1] * a + w[..., 1:2] * b + w[..., 2:] * c
        face = np.argmin(np.sum((nearest - p) ** 2, axis=-1), axis=1)
        found[start : start + batch] = face
        weights[start : start + batch] = w[np.arange(len(face)), face]
    return SurfacePoints(found, weights)


def sheet_points(cells: tuple[int, int], u: np.ndarray, v: np.ndarray) -> SurfacePoints:
    """Return the points of a grid at u (along x) and v (along y), each in [0, 1]; (k,) or (worlds, k)."""
    nx, ny = cells
    i = np.minimum((u * nx).astype(int), nx - 1)
    j = np.minimum((v * ny).astype(int), ny - 1)
    s, t = u * nx - i, v * ny - j
    lower = s >= t
    # Faces (a, b, d) and (a, d, c) of the cell: see sheet_mesh.
    first = np.stack([1.0 - s, s - t, t], axis=-1)
    second = np.stack([1.0 - t, s, t - s], axis=-1)
    faces = 2 * (j * nx + i) + np.where(lower, 0, 1)
    return SurfacePoints(faces, np.where(lower[..., None], first, second))


def chosen_points(
    where: Any, vertex_count: int, faces: np.ndarray, worlds: int
) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
    """Return the points of a mesh that a grip is asked for: vertices, or corners of faces and their weights.

    Args:
        where: Indices of vertices, (k,) or (worlds, k), -1 for no point; or ``SurfacePoints``.
        vertex_count: Of the mesh.
        faces: (m, 3) int, its faces.
        worlds: Worlds in the batch.

    Returns:
        Vertices (worlds, k) int, None, None; or None, corners (worlds, k, 3) int, -1 for no point, and weights
        (worlds, k, 3).

    Raises:
        InvalidInputError: an index out of range, of another shape, or -1 for all of those that hold in every world.
    """
    if not isinstance(where, SurfacePoints):
        given = [where] if isinstance(where, int | np.integer) else where
        indices = index_array("where", given, ("k",), (worlds, "k"), low=-1, high=vertex_count)
        _check_once(indices)
        _check_any(indices)
        return np.array(np.broadcast_to(indices, (worlds, indices.shape[-1]))), None, None
    chosen = index_array("where.faces", where.faces, ("k",), (worlds, "k"), low=-1, high=len(faces))
    _check_any(chosen)
    corners = np.where((chosen >= 0)[..., None], faces[chosen], -1)
    shape = (worlds, *corners.shape[-2:])
    return None, np.array(np.broadcast_to(corners, shape)), np.array(np.broadcast_to(where.barycentric, shape))


def _check_any(indices: np.ndarray) -> None:
    """Check that indices for all worlds (k,) name a point; of those of each world (worlds, k) none may."""
    if indices.ndim == 1 and (indices < 0).all():
        raise InvalidInputError("where names no point: -1 is none in a world, not the last vertex")


def _check_once(indices: np.ndarray) -> None:
    """Check that no row of vertices (k,) or (worlds, k), -1 for none, names one twice.

    Raises:
        InvalidInputError: one does.
    """
    ordered = np.sort(np.atleast_2d(indices), axis=1)
    twice = (ordered[:, 1:] == ordered[:, :-1]) & (ordered[:, 1:] >= 0)
    if twice.any():
        raise InvalidInputError(f"where names vertex {ordered[:, 1:][twice][0]} twice; each can be held once")


def _closest_weights(p: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    ab, ac = b - a, c - a
    d1, d2 = _dot(ab, p - a), _dot(ac, p - a)
    d3, d4 = _dot(ab, p - b), _dot(ac, p - b)
    d5, d6 = _dot(ab, p - c), _dot(ac, p - c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    zero, one = np.zeros_like(d1), np.ones_like(d1)
    along_ab, along_ac = _ratio(d1, d1 - d3), _ratio(d2, d2 - d6)
    along_bc = _ratio(d4 - d3, (d4 - d3) + (d5 - d6))
    inside_v, inside_w = _ratio(vb, va + vb + vc), _ratio(vc, va + vb + vc)
    cases = [
        ((d1 <= 0) & (d2 <= 0), (one, zero, zero)),
        ((d3 >= 0) & (d4 <= d3), (zero, one, zero)),
        ((d6 >= 0) & (d5 <= d6), (zero, zero, one)),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), (1 - along_ab, along_ab, zero)),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), (1 - along_ac, zero, along_ac)),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), (zero, 1 - along_bc, along_bc)),
    ]
    conditions = [condition for condition, _ in cases]
    inside = (1 - inside_v - inside_w, inside_v, inside_w)
    return np.stack([np.select(conditions, [w[k] for _, w in cases], default=inside[k]) for k in range(3)], axis=-1)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.sum(a * b, axis=-1)


def _ratio(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a / np.where(b == 0.0, 1.0, b)
