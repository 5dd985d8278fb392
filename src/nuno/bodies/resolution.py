"""Resolution of a material by a body's substeps: the share of the asked stiffness that it is expected to show."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Resolution:
    """The stiffness that a cloth's or soft body's substeps make of its material, by the laws in docs/physics.md.

    The shares are of the nominal stiffness under a load that varies little from one cell to the next, of the world
    that shows least: 1 as asked for, 0.5 half as stiff.

    Attributes:
        substeps: Substeps of a frame.
        given: Whether ``World(substeps=...)`` gave them; else the rule chose them.
        wanted: What the rule asks for; where that is capped, as many as plain passes need, as those are that are given.
        capped: Whether the rule chose fewer than it asked for, for they have a bound.
        sweeps: How often a substep goes through a cloth's shear and stretch: once where substeps are given.
        stretch: The share of a cloth's stretch stiffness, of a soft body's modulus.
        shear: The share of a cloth's shear stiffness, of a soft body's modulus.
        bending: The share of a cloth's bending rigidity, of a soft body's modulus.
        tension: The tension [N/m] from which on a sheet flutters and bears no more, None where it is not known: for
            cloth meshes and soft bodies. It goes with the square of the substeps, and is a third where so few
            substeps were given that coordinates are floats.
    """

    substeps: int
    given: bool
    wanted: int
    capped: bool
    sweeps: int
    stretch: float
    shear: float
    bending: float
    tension: float | None = None

    @property
    def least(self) -> float:
        """The least of the shares."""
        return min(self.stretch, self.shear, self.bending)
