"""How many substeps a frame a soft body needs, by its mesh and its stiffness."""

import math

import numpy as np

from nuno.scene.soft import SoftTopology, moduli

COURANT = 0.5
"""How far a pressure wave may go in a substep, in heights of the smallest element."""
FEWEST, MOST_SUBSTEPS = 10, 240
"""Bounds of the default, the same as a cloth's."""


def wave_speed(values: dict[str, np.ndarray]) -> float:
    """Return the fastest pressure wave's speed [m/s].

    Args:
        values: What `Soft.resolved` gives.
    """
    mu, bulk = moduli(values)
    return float(np.sqrt(((bulk + mu) / values["density"]).max()))


def soft_substeps(topology: SoftTopology, frame: float, speed: float) -> int:
    """Substeps a frame in which a pressure wave goes at most `COURANT` of the smallest element's height.

    Args:
        topology: The body's elements.
        frame: Length of a frame [s].
        speed: Of a pressure wave [m/s].
    """
    wanted = frame * speed / (COURANT * topology.cell_size)
    return min(max(FEWEST, math.ceil(wanted - 1e-9)), MOST_SUBSTEPS)
