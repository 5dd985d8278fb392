"""A strip that bends under its own weight: the reference curve, and the same strip in a world."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import brentq
from triangles import rectangle
from world_with import GRAVITY, attached, rows

import nuno


@lru_cache(maxsize=4096)
def drop_over_reach(g: float) -> float:
    """Return H/W of theta'' = -G (1 - s) cos(theta), theta(0) = 0, theta'(1) = 0 (Romero et al. 2021, eq. 4).

    G = w L^3 / B. The load is raised step by step, so that the solution is the branch that hangs down.
    """
    s = np.linspace(0.0, 1.0, 101)
    y = np.zeros((4, 101))
    y[2] = s
    for load in [*np.geomspace(0.1, g, max(2, int(3 * np.log(max(g, 0.2) / 0.1))))[:-1], g]:

        def slope(s: np.ndarray, y: np.ndarray, load: float = load) -> np.ndarray:
            return np.stack([y[1], -load * (1.0 - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

        found = solve_bvp(slope, lambda a, b: np.array([a[0], b[1], a[2], a[3]]), s, y, tol=1e-8, max_nodes=50000)
        assert found.success
        s, y = found.x, found.y
    return float(y[3, -1] / y[2, -1])


def rigidity_ratio(g: float, ratio: float) -> float:
    """Return B / B_nominal of the strip whose nominal G is ``g`` and whose drop over reach is ``ratio``."""
    # H/W is smooth and rising in G: a coarse grid of exact values brackets it
    low, high = 0.02, 1e4
    if not drop_over_reach(low) < ratio < drop_over_reach(high):
        return float("nan")
    found = brentq(lambda q: drop_over_reach(round(float(np.exp(q)), 5)) - ratio, np.log(low), np.log(high), xtol=1e-4)
    return float(g / np.exp(found))


def cantilever(
    loads: list[float], cells: int, *, length: float = 0.2, across: int = 1, along: str = "warp",
    seconds: float = 3.0, substeps: int | None = None, area_density: float = 0.2,
    stretch_stiffness: float = 1000.0, kind: str = "sheet", seed: int = 2,
) -> tuple[np.ndarray, np.ndarray, int]:  # fmt: skip
    """Return H/W of strips clamped at one end, one for each G, the G that they feel, and the substeps.

    ``kind`` is "sheet", or one of `triangles.KINDS` for a cloth mesh of about square cells.

    Both rows of vertices of the first cell are held. The clamp is where the strip is known to be level, the
    middle of that cell, and the free length, from there to the tip, is ``cells`` and a half. The drag is 1.5
    times the lowest eigenfrequency 3.516 sqrt(B / (m L^4)), so that the strip creeps to rest without ringing;
    being implicit it takes c dt off the weight, which is why G is returned.
    """
    h = length / (cells + 0.5)
    g = np.asarray(loads, dtype=float)
    weight = area_density * GRAVITY
    rigidity = weight * length**3 / g
    material = nuno.Cloth(
        area_density=area_density, bending_rigidity=rigidity, stretch_stiffness=stretch_stiffness,
        thickness=1e-3, air_drag=1.5 * 3.516 * np.sqrt(rigidity / (area_density * length**4)), damping=0.0,
    )  # fmt: skip
    size, grid = ((cells + 1) * h, across * h), (cells + 1, across)
    if along == "weft":
        size, grid = size[::-1], grid[::-1]
    cloth = nuno.sheet(size, cells=grid, position=(0, 0, 1))
    if kind != "sheet":
        points, faces = rectangle(kind, size, h, seed)
        cloth = nuno.cloth_mesh(np.column_stack([points, np.ones(len(points))]), faces)
    world, body = attached(cloth, material, worlds=len(g), substeps=substeps)
    axis = 0 if along == "warp" else 1
    start = body.vertices.reshape(len(g), -1, 3)[0]
    held = np.flatnonzero(start[:, axis] < start[:, axis].min() + 1.1 * h)
    world.grip(body, held, to=start[held].mean(axis=0))
    world.run(seconds)
    end = rows(body)
    tip = end[:, start[:, axis] > start[:, axis].max() - 1e-3 * h].mean(axis=1)
    clamp = start[held].mean(axis=0)
    ratio = (clamp[2] - tip[:, 2]) / (tip[:, axis] - clamp[axis])
    substeps = body._dynamics.solver.substeps
    return ratio, g / (1 + np.asarray(material.air_drag) / (60 * substeps)), substeps
