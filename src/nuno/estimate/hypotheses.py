"""What is not known of a real cloth, spread over a few guesses: material, friction, resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Hypothesis:
    """One guess at the cloth and how it is simulated.

    Attributes:
        bending_rigidity: [N m].
        friction: Coulomb's coefficient against the table and itself.
        area_density: [kg/m2].
        air_drag: [1/s].
    """

    bending_rigidity: float
    friction: float = 0.5
    area_density: float = 0.22
    air_drag: float = 1.5


@dataclass(frozen=True)
class Discretisation:
    """A mesh and a time step.

    Attributes:
        cells: Cells along the longer side; the shorter gets as many as keep cells square, and both are rounded so
            that candidates are vertices.
        substeps: Substeps per 1/60 s.
        spread: The hypotheses that are run on it.
    """

    cells: int
    substeps: int
    spread: tuple[Hypothesis, ...]


SPREAD = tuple(Hypothesis(rigidity) for rigidity in (2.5e-5, 5e-5, 1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3))
"""Bending rigidities doubling over the range of measured fabrics and on to stiffer cloths such as canvas."""

DISCRETISATIONS = (Discretisation(20, 14, SPREAD), Discretisation(25, 18, SPREAD))
"""The meshes whose answers are averaged, and the guesses on each."""


def cell_counts(long_m: float, short_m: float, cells: int, grid: tuple[int, int]) -> tuple[int, int]:
    """Cells along both sides, multiples of the candidate grid's steps (grid - 1).

    Args:
        long_m: Longer side [m].
        short_m: Shorter side [m].
        cells: Wanted along the longer side.
        grid: Candidates along the longer and shorter side.
    """
    steps = np.maximum(np.asarray(grid) - 1, 1)
    along = max(1, round(cells / steps[0])) * steps[0]
    across = max(1, round(along * short_m / long_m / steps[1])) * steps[1]
    return int(along), int(across)
