"""Relaxation: the stiffness of a cloth that is solved in few sweeps a substep, and the sweeps that it needs.

A constraint C of stiffness 1 / alpha stands among equal neighbours, all pulled alike. D is grad C . W grad C, and what
the neighbours' multipliers move it by adds up to -D, for a uniform stress pulls at no inner vertex. In Gauss-Seidel the
half of the neighbours that comes later in the order undoes D / 2 of each correction: with one pass a substep the body
is at rest with a compliance of alpha + dt^2 D / 2, too soft by 1 + q, where q = dt^2 D / (2 alpha) (`softening`). More
sweeps, over-relaxed, leave less; with the elements in two halves, of which one goes first, they are a map of two
numbers (`stiffness_share`).
"""

from __future__ import annotations

import math

import numpy as np

from nuno.constraints.membrane import MAX_RELAXATION
from nuno.topology.cloth_topology import ClothTopology, Elements

RELAXATIONS = ((0.0, 0.0), (0.0, 0.0), (0.467, 0.473), (0.403, 0.609), (0.379, 0.725), (0.378, 0.858), (0.367, 0.966))
"""By the number of sweeps, rise and onset of the over-relaxation 1 + rise (sqrt(q) - onset), at least 1 and at most
`nuno.constraints.membrane.MAX_RELAXATION`. Fitted so that a uniform stress meets 0.98 to 1.00 of the nominal stiffness
by `stiffness_share`: near a rim it is some percent more where that is free, and less where it is held. Each element
takes its own q."""
MAX_SOFTENED = (0.05, 0.05, 1.15, 2.2, 3.0, 4.0)
"""The largest q for which so many sweeps are enough, none meaning one plain pass."""
PLAIN = 0.1
"""The q that leaves a plain pass within a tenth of nominal."""
SOFTEST_STEP = 3.0
"""The largest q that the rule for substeps allows."""


def softening(topology: ClothTopology, values: dict[str, np.ndarray]) -> dict[str, float]:
    """Return q / dt^2 [1/s2] of a cloth's shear and, on a mesh, of its stretch, as means over the area.

    Args:
        topology: The cloth's elements.
        values: What `nuno.materials.Cloth.resolved` gives. Of several worlds the softest counts.

    Returns:
        By "shear" and "stretch"; a sheet's stretch is solved exactly along its grid lines and has none.
    """
    density = np.asarray(values["area_density"], dtype=float)
    shear = np.asarray(values["shear_stiffness"], dtype=float)
    if len(topology.cells):
        return {"shear": _mean(topology.cells, shear / density, _of_cells(topology)), "stretch": 0.0}
    triangles = topology.triangles
    weights = [np.asarray(triangles.extra[side], dtype=float) for side in ("u", "v")]
    light = 1.0 / topology.area[triangles.vertices]
    area = np.asarray(triangles.extra["area"], dtype=float)
    stretch = max(
        _mean(triangles, np.asarray(values[f"stretch_stiffness_{side}"], dtype=float) / density, rate)
        for side, rate in zip(("warp", "weft"), (0.5 * area * (w**2 * light).sum(axis=1) for w in weights), strict=True)
    )
    # at rest F_u and F_v are unit vectors at a right angle
    rate = 0.5 * area * ((weights[0] ** 2 + weights[1] ** 2) * light).sum(axis=1)
    return {"shear": _mean(triangles, shear / density, rate), "stretch": stretch}


def _of_cells(topology: ClothTopology) -> np.ndarray:
    """Area D / 2 of each cell of a sheet, per density [1/m2]."""
    corners = topology.cells.vertices
    area = 0.25 / np.asarray(topology.cells.extra["quarter"], dtype=float)
    x = topology.rest[corners]
    diagonal = ((x[:, 3] - x[:, 0]) ** 2).sum(axis=1)
    light = (1.0 / topology.area[corners]).sum(axis=1)
    return 0.5 * area * 4.0 * diagonal * light / (4.0 * area) ** 2


def _mean(elements: Elements, stiffness: np.ndarray, rate: np.ndarray) -> float:
    """The largest mean of stiffness over density (worlds, elements or 1) times what each element has of D."""
    if stiffness.shape[1] > 1:
        stiffness = stiffness[:, elements.faces[:, 0]]
    if (stiffness == stiffness[:1]).all():  # of worlds that are alike one will do
        stiffness = stiffness[:1]
    return float((stiffness * rate).mean(axis=1).max())


def relaxation(q: float, sweeps: int) -> float:
    """The over-relaxation of an element by its q, as `nuno.constraints.membrane.relaxation` has it."""
    rise, onset = RELAXATIONS[sweeps]
    return min(max(1.0, 1.0 + rise * (math.sqrt(q) - onset)), float(MAX_RELAXATION))


def stiffness_share(q: float, sweeps: int) -> float:
    """The stiffness that a uniform stress meets, over the nominal one.

    Args:
        q: What `softening` gives, times dt^2.
        sweeps: Sweeps of a substep; 0 for one plain pass.
    """
    if q <= 0.0:
        return 1.0
    alpha, relax = 0.5 / q, relaxation(q, sweeps)  # alpha over D
    moved = np.zeros((2, 2))  # the multipliers of both halves, by what each half was off
    for _ in range(max(1, sweeps)):
        for half in (0, 1):
            off = np.eye(2)[half] + moved[half] - moved[1 - half] + alpha * moved[half]
            moved[half] -= relax * off / (1.0 + alpha)
    missing = np.linalg.solve(moved, -np.ones(2))
    return float(alpha / missing.mean())


def sweeps_for(q: float, mesh: bool) -> int:
    """Return how many sweeps a substep needs, 0 for one plain pass.

    Args:
        q: The larger of what `softening` gives, times dt^2.
        mesh: Whether the cloth is a mesh: the three constraints of a triangle hinder each other besides, and from
            three sweeps on it takes one more.
    """
    for sweeps, most in enumerate(MAX_SOFTENED):
        if q <= most:
            return min(sweeps + (mesh and sweeps > 2), len(RELAXATIONS) - 1)
    return len(RELAXATIONS) - 1
