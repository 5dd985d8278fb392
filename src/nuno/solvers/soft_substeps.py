"""The rule for a soft body's substeps a frame, by its mesh and its stiffness."""

import math

import numpy as np

from nuno.topology.soft_topology import SoftTopology, moduli, shape_gradients

COURANT = 0.5
"""Distance that a pressure wave may go in a substep, in heights of the smallest element."""
FEWEST, MAX_SUBSTEPS = 10, 240
"""Bounds of the default, the same as a cloth's."""
EXCESS, BEND = 1.33, 3.4
"""Of what one pass a substep adds to a body's compliance, see `modulus_share`."""


def wave_speed(values: dict[str, np.ndarray]) -> float:
    """Return the fastest pressure wave's speed [m/s].

    Args:
        values: What `Soft.resolved` gives.
    """
    mu, bulk = moduli(values)
    return float(np.sqrt(((bulk + mu) / values["density"]).max()))


def modulus_share(topology: SoftTopology, values: dict[str, np.ndarray], step: float) -> float:
    """The modulus that a body shows in substeps of ``step`` [s], over the one that its mesh has when they are short.

    What one pass adds to the body's compliance depends on y = E dt^2 / (rho h^2), with an element's smallest height h,
    in the mean over the volume. Measured on bars of 2 to 4 cells across, E 1e5 to 4e5 Pa, Poisson's ratios 0.3 and
    0.45, it is between 0.8 and 1.8 times ``EXCESS`` y^2 / (y + ``BEND``) of the body's own.

    Args:
        topology: The body's elements.
        values: What `Soft.resolved` gives; of several worlds the softest counts.
        step: [s].
    """
    steepest = (shape_gradients(topology.inverse) ** 2).sum(axis=2).max(axis=1)
    rate = np.asarray(values["youngs_modulus"], dtype=float) / np.asarray(values["density"], dtype=float) * steepest
    y = float((rate * topology.volume).sum(axis=1).max() / topology.volume.sum()) * step**2
    return 1.0 / (1.0 + EXCESS * y**2 / (y + BEND))


def soft_substeps(topology: SoftTopology, frame: float, speed: float) -> int:
    """Substeps a frame in which a pressure wave goes at most `COURANT` of the smallest element's height.

    Args:
        topology: The body's elements.
        frame: Length of a frame [s].
        speed: Of a pressure wave [m/s].
    """
    return min(max(FEWEST, wanted_substeps(topology, frame, speed)), MAX_SUBSTEPS)


def wanted_substeps(topology: SoftTopology, frame: float, speed: float) -> int:
    """The same without bounds."""
    return max(1, math.ceil(frame * speed / (COURANT * topology.cell_size) - 1e-9))
