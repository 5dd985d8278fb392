"""A world with one dynamic cloth in it, the start of most tests of physics."""

from __future__ import annotations

from typing import Any

import numpy as np

import nuno

GRAVITY = 9.81  # [m/s2], the default of World


def attached(
    body: nuno.Body, material: nuno.Cloth, *others: nuno.Body, worlds: int = 1, **options: Any
) -> tuple[nuno.World, nuno.Body]:
    """Return a world, or a batch of ``worlds``, with ``others`` standing in it and ``body`` attached."""
    world = nuno.World(device="cpu", **options)
    for other in others:
        world.add(other)
    world.add(body)
    if worlds > 1:
        world = world.imagine(worlds)
    return world, world.attach(body, material)


def rows(body: nuno.Body) -> np.ndarray:
    """Return vertices as (worlds, n, 3) [m], also of one world."""
    return body.vertices.reshape(-1, *body.vertices.shape[-2:])


def masses(size: tuple[float, float], cells: tuple[int, int], area_density: float) -> np.ndarray:
    """Return (n,) [kg]: each vertex of a sheet has a quarter of the cells around it."""
    nx, ny = cells
    x, y = np.ones(nx + 1), np.ones(ny + 1)
    x[[0, -1]] = y[[0, -1]] = 0.5
    return (area_density * size[0] / nx * size[1] / ny * np.outer(y, x)).ravel()
