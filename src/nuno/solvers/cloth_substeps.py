"""The rule for a cloth's substeps a frame, by its mesh and its stiffness."""

import math

from nuno.constraints.relaxation import SOFTEST_STEP
from nuno.topology.cloth_topology import ClothTopology

SAG, MESH_SAG = 0.01, 0.0025
"""Strain scale 2 g L dt^2 / h^2 that the default number of substeps allows a sheet and a cloth mesh."""
BENDING_STEP = 1.8
"""The default number of substeps keeps B dt^2 / (rho h^4) of a sheet at or under one over this."""
PATCH_STEP = 0.75
"""The same of a mesh's B dt^2 / rho times `ClothTopology.bend_rate`."""
TAUT, MAX_TAUT = 0.3, 900.0
"""The strain of a sheet, and the tension [N/m], of which the default number of substeps bears the smaller."""
FEWEST, MAX_SUBSTEPS = 10, 240
"""Bounds of the default: contact is looked at every 1.7 ms at 60 frames a second; a stiff strip stays affordable."""


def default_substeps(
    topology: ClothTopology, gravity: float, frame: float, density: float = 0.2, rigidity: float = 0.0,
    softening: float = 0.0, stretch: float = 0.0, load: float = 0.0,
) -> int:  # fmt: skip
    """Substeps a frame, within bounds, for `wanted_substeps`, which has the arguments."""
    wanted = wanted_substeps(topology, gravity, frame, density, rigidity, softening, stretch, load)
    return min(max(FEWEST, wanted), MAX_SUBSTEPS)


def wanted_substeps(
    topology: ClothTopology, gravity: float, frame: float, density: float = 0.2, rigidity: float = 0.0,
    softening: float = 0.0, stretch: float = 0.0, load: float = 0.0,
) -> int:  # fmt: skip
    """Substeps a frame from the cell size h and the cloth's extent L [m], its density rho and rigidity B.

    In-plane, one pass a substep leaves a hanging cloth strains of the order 2 g L dt^2 / h^2. Held at ``SAG``, the 99th
    percentile of the strain of sheets of 16 to 64 cells a side (0.3 and 1 m, 300 to 1000 N/m) that hang by two
    corners is 0 to 0.2 % of strain above its value at 160 substeps or more, which itself is 0.4 to 1.8 %; at 5000 N/m
    it is 0.3 % above 0.4 %. A cloth mesh, whose triangles are not solved along grid lines, needs twice as many for
    the same (`MESH_SAG`). In bending, B dt^2 / (rho h^4) stays at or under 1 / `BENDING_STEP`: a strip then hangs
    within 10 % of its rigidity; so does one of a mesh by `PATCH_STEP`. Shear, and a mesh's stretch, have several sweeps
    a substep: what `nuno.constraints.relaxation.SOFTEST_STEP` says would need too many has shorter substeps. A sheet
    bears the tension of the strain `TAUT`, but at most `MAX_TAUT` (see `bearable_tension`), and a load beyond that
    where its material names one.

    Args:
        topology: The cloth's elements.
        gravity: Size of gravity [m/s2].
        frame: Length of a frame [s].
        density: Smallest area density [kg/m2].
        rigidity: Largest bending rigidity [N m].
        softening: What `nuno.constraints.relaxation.softening` gives, the larger of the two [1/s2].
        stretch: Largest stretch stiffness [N/m].
        load: The tension that a sheet is to bear anyhow [N/m].
    """
    h = topology.cell_size
    allowed = SAG if len(topology.edges) else MESH_SAG
    step = h * math.sqrt(allowed / (2.0 * max(gravity, 1.0) * topology.extent))
    if rigidity > 0.0:
        if len(topology.patches):
            step = min(step, math.sqrt(PATCH_STEP * density / (topology.bend_rate * rigidity)))
        else:
            step = min(step, h**2 * math.sqrt(density / (BENDING_STEP * rigidity)))
    if softening > 0.0:
        step = min(step, math.sqrt(SOFTEST_STEP / softening))
    if len(topology.edges) and max(stretch, load) > 0.0:
        taut = max(min(TAUT * stretch, MAX_TAUT), load)
        step = min(step, math.sqrt(bearable_tension(topology, 1.0, density) / taut))
    return max(1, math.ceil(frame / step - 1e-9))


def bearable_tension(topology: ClothTopology, step: float, density: float, doubles: bool = True) -> float:
    """The tension [N/m] from which on a sheet may flutter in substeps of ``step`` [s]: rho h^2 / dt^2, or a third.

    A taut grid line is a string, whose bends tension pulls straight along the predicted directions of its edges. That
    is stable up to (omega dt)^2 = 4/3, and the swiftest wave has omega = 2 sqrt(T / rho) / h. Where a share of the
    forces turns with the edges (`nuno.constraints.taut_lines`) it is stable up to 9/2, of which an eighth is left over.

    Args:
        topology: The sheet's elements.
        step: Length of a substep [s].
        density: Its density [kg/m2].
        doubles: Whether coordinates are doubles: forces turn there alone.
    """
    return density * (topology.cell_size / step) ** 2 / (1.0 if doubles else 3.0)


def bending_share(topology: ClothTopology, step: float, density: float, rigidity: float) -> float:
    """The bending rigidity that a cloth shows in substeps of ``step`` [s], over the nominal one.

    What one pass adds to a bend's compliance is taken off its denominator as far as the bound on that goes
    (`nuno.constraints.bending.bend_stiffness`); from there on compliance grows as dt^2.
    """
    if rigidity <= 0.0:
        return 1.0
    if len(topology.patches):
        allowed = PATCH_STEP * density / (topology.bend_rate * rigidity)
    else:
        allowed = topology.cell_size**4 * density / (BENDING_STEP * rigidity)
    return min(1.0, allowed / step**2)
