"""The bending of a sheet's flex, calibrated so that a pure moment M bends it by M / B along warp and weft.

MuJoCo's hinges store the plate energy where a sheet lies on a cylinder, but on alternating diagonals a sheet finds
shapes near it that store less: square cells bend as if B were 0.82 of what it is, cells twice as long as wide 0.59 and
0.98. So the hinges are made stiffer by what a patch of such cells lacks.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from nuno.engines.mujoco.sheet_triangles import sheet_triangles

if TYPE_CHECKING:
    from nuno.shapes.shape import Sheet

BEND = 17
"""Numbers of an edge in ``flex_bending``: a symmetric matrix (4, 4) of its four vertices, and one for curved rests."""
CELLS = 16
"""Cells along both sides of the patch."""
ITERATIONS = 12
"""Corrections, each of which leaves a tenth to a third of the error."""


@lru_cache(maxsize=64)
def bending_factors(length: float, width: float, ratio: float = 1.0) -> tuple[float, float]:
    """Return by what the bending along warp and weft is multiplied in a sheet of cells of some sides [m].

    Args:
        length: Of a cell along warp.
        width: Along weft.
        ratio: The bending rigidity along weft over that along warp.
    """
    elements, _ = sheet_triangles(CELLS, CELLS)
    scale = 1.0 / np.sqrt(length * width)
    u, v = np.meshgrid(np.arange(CELLS + 1) * length * scale, np.arange(CELLS + 1) * width * scale)
    places = np.stack([u.ravel(), v.ravel(), np.zeros(u.size)], axis=1)
    ends, flaps, rows = _hinges(places, elements)
    unit = places[ends[:, 1]] - places[ends[:, 0]]
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    factors = np.ones(2)
    for _ in range(ITERATIONS):
        warp, weft = np.sqrt(factors * (1.0, ratio))
        rigidity = (warp * unit[:, 1] ** 2 + weft * unit[:, 0] ** 2) ** 2
        felt = [_felt(places, ends, flaps, rows * rigidity[:, None], axis) for axis in (0, 1)]
        factors = factors / (np.array(felt) / (1.0, ratio))
    return float(factors[0]), float(factors[1])


def sheet_plate(shape: Sheet) -> tuple[np.ndarray, float]:
    """Return triangles (m, 3) for a sheet as an isotropic plate, and by what its bending is to be multiplied.

    It is the mean of both directions' factors: a plate has one rigidity.
    """
    length, width = (size / cells for size, cells in zip(shape.size, shape.cells, strict=True))
    warp, weft = bending_factors(1.0, round(width / length, 6))
    return sheet_triangles(*shape.cells)[0], float(np.sqrt(warp * weft))


def _hinges(places: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ends (k, 2), opposite vertices (k, 2) and matrices (k, 16) of the inner edges, of a rigidity of 1 N m.

    They are as MuJoCo compiles them: c c^T over the area of both triangles, with the cotangents c of Bergou et al., "A
    Quadratic Bending Model for Inextensible Surfaces" (2006).
    """
    sides = elements[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    opposite = elements.ravel()
    _, index, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(index.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    one, two = order[first], order[first + 1]
    ends, flaps = np.sort(sides[one], axis=1), np.stack([opposite[one], opposite[two]], axis=1)
    cotangents = np.stack(
        [_cotangent(places, ends[:, at], ends[:, 1 - at], flaps[:, side]) for at in (0, 1) for side in (0, 1)], axis=1
    )
    at_first, at_second = cotangents[:, :2], cotangents[:, 2:]
    own = np.stack(
        [at_second.sum(axis=1), at_first.sum(axis=1), *(-cotangents[:, [0, 1]] - cotangents[:, [2, 3]]).T], 1
    )
    area = 0.5 * sum(
        np.linalg.norm(
            np.cross(places[ends[:, 1]] - places[ends[:, 0]], places[flaps[:, side]] - places[ends[:, 0]]), axis=1
        )
        for side in (0, 1)
    )
    return ends, flaps, np.einsum("ki,kj->kij", own, own).reshape(-1, 16) / area[:, None]


def _cotangent(places: np.ndarray, corner: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the cotangent (k,) of the angle at a corner between two other vertices."""
    a, b = places[one] - places[corner], places[other] - places[corner]
    return np.asarray(np.einsum("kx,kx->k", a, b) / np.linalg.norm(np.cross(a, b), axis=1))


def _felt(places: np.ndarray, ends: np.ndarray, flaps: np.ndarray, rows: np.ndarray, axis: int) -> float:
    """Return the rigidity [N m] that a moment along one side meets, in small deflections of a clamped patch."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import spsolve

    n, corners = len(places), np.concatenate([ends, flaps], axis=1)
    i, j = np.repeat(corners, 4, axis=1), np.tile(corners, (1, 4))
    stiffness = csr_matrix((rows.ravel(), (i.ravel(), j.ravel())), shape=(n, n))
    along = places[:, axis]
    step = float(along.max()) / CELLS
    free = along > 1.5 * step
    column = np.rint(along / step).astype(int)
    force = np.where(column == CELLS, 1.0, np.where(column == CELLS - 1, -1.0, 0.0))
    moment = step * (CELLS + 1) / float(places[:, 1 - axis].max())  # per width
    height = np.zeros(n)
    height[free] = spsolve(stiffness[free][:, free].tocsc(), force[free])
    means = [height[column == k].mean() for k in range(CELLS + 1)]
    slopes = np.diff(means) / step
    # away from the clamp and the end, by which a patch is not what it is inside
    first, last = CELLS // 4, 3 * CELLS // 4
    return float(moment * (last - first) * step / (slopes[last] - slopes[first]))
