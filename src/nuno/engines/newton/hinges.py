"""Hinges: Newton's bending elements, whose stiffness makes a cloth bend as its rigidity says.

A hinge has two vertices apart and two on an edge, and the energy k L theta^2 / 2 of its angle theta, with the edge's
length L at rest. Along triangles' edges alone no stiffness bends a sheet alike in all directions, so that sheets have
hinges along their grid lines and across both diagonals of a cell, as Nuno's own second differences are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.shapes.shape import Sheet


def sheet_hinges(shape: Sheet, rigidity: float) -> tuple[np.ndarray, np.ndarray]:
    """Return hinges (m, 4) int, the two apart first (-1 where there is none), and stiffnesses (m,) [N].

    A grid line's curvature theta / dx has the energy B / 2 (theta / dx)^2 over its cells; a cell's twist B kappa_xy^2,
    half of it by either diagonal, whose hinge opens by kappa_xy times its length.
    """
    (nx, ny), (dx, dy) = shape.cells, np.asarray(shape.size) / shape.cells
    index = np.arange((nx + 1) * (ny + 1)).reshape(ny + 1, nx + 1)
    rows = [*_along(index, dx, rigidity), *_along(index.T, dy, rigidity)]
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    stiffness = np.full(len(a), rigidity * dx * dy / np.hypot(dx, dy) ** 3)
    rows += [(np.stack([b, c, a, d], axis=1), stiffness), (np.stack([a, d, b, c], axis=1), stiffness)]
    return np.concatenate([hinges for hinges, _ in rows]), np.concatenate([values for _, values in rows])


def mesh_hinges(rest: np.ndarray, faces: np.ndarray, rigidity: float) -> tuple[np.ndarray, np.ndarray]:
    """Return hinges (m, 4) int at the edges of triangles, and stiffnesses (m,) [N].

    Each is 3 B L / A, for the area A of its two triangles (Bergou et al. 2006), times one number for all, with which
    a flat pattern that is rolled up along x or y has, in the mean, the energy that it should.
    """
    sides = np.concatenate([faces[:, [0, 1, 2]], faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]])
    key = np.sort(sides[:, :2], axis=1)
    order = np.lexsort(key.T)
    key, apart = key[order], sides[order, 2]
    first = np.flatnonzero(np.r_[True, (key[1:] != key[:-1]).any(axis=1)])
    twice = np.diff(np.r_[first, len(key)]) == 2
    other = np.where(twice, apart[np.minimum(first + 1, len(key) - 1)], -1)
    hinges = np.column_stack([apart[first], other, key[first]])
    edge = rest[key[first, 1]] - rest[key[first, 0]]
    length = np.linalg.norm(edge, axis=1)
    heights = [np.linalg.norm(np.cross(edge, rest[far] - rest[key[first, 0]]), axis=1) for far in (apart[first], other)]
    area = 0.5 * (heights[0] + heights[1])
    stiffness = np.where(twice, 3.0 * rigidity * length / area, 0.0)
    if np.ptp(rest[:, 2]) > 1e-9 * np.ptp(rest, axis=0).max():
        return hinges, stiffness
    found = 0.0
    for axis in (0, 1):
        jump = _slope_jumps(rest, hinges[twice], 0.5 * rest[:, axis] ** 2)
        found += 0.25 * (stiffness[twice] * length[twice] * jump**2).sum()
    faces_area = 0.5 * np.linalg.norm(
        np.cross(rest[faces[:, 1]] - rest[faces[:, 0]], rest[faces[:, 2]] - rest[faces[:, 0]]), axis=1
    )
    wanted = 0.5 * rigidity * faces_area.sum()
    return hinges, stiffness * (wanted / found if found > 0.0 else 1.0)


def _along(index: np.ndarray, step: float, rigidity: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Hinges across the edges between rows (k, k + 1) of grid lines, each with the ends of its lower row's line.

    The last line takes the edges below it, which carry two hinges then.
    """
    lines = len(index) - 1
    rows = []
    for line, edges in ((np.arange(lines), np.arange(lines)), (np.array([lines]), np.array([lines - 1]))):
        share = np.where((line == 0) | (line == lines), 0.5, 1.0)  # of a cell's width
        stiffness = np.repeat(rigidity * share / step, index.shape[1] - 2)
        inner = np.stack(
            [index[line, :-2], index[line, 2:], index[edges, 1:-1], index[edges + 1, 1:-1]], axis=-1
        ).reshape(-1, 4)
        rows.append((inner, stiffness))
    rim: list[Any] = [index[:-1, column] for column in (0, -1)]
    ends = np.concatenate([np.stack([low, index[1:, c]], 1) for low, c in zip(rim, (0, -1), strict=True)])
    rows.append((np.pad(ends, ((0, 0), (2, 0)), constant_values=-1), np.zeros(len(ends))))
    return rows


def _slope_jumps(rest: np.ndarray, hinges: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return by how much the slope of a height z over a flat pattern jumps at each hinge."""
    slopes = []
    for far in (0, 1):
        corners = hinges[:, [2, 3, far]]
        flat, height = rest[corners][..., :2], z[corners]
        edges = flat[:, 1:] - flat[:, :1]
        slopes.append(np.linalg.solve(edges, (height[:, 1:] - height[:, :1])[..., None])[..., 0])
    return np.linalg.norm(slopes[1] - slopes[0], axis=1)
