"""Resolution of a material by a body's substeps: the share of the asked stiffness that it is expected to show."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.simulation import Simulation

logger = logging.getLogger(__name__)

WARNED_BELOW = 0.9
"""A share of the stiffness below which a warning says so."""
OVERLOAD = 1.1
"""A tension, over the one that is borne, above which a warning says so: a load that is put on at once swings."""
_warned: set[str] = set()  # keys of bodies that were warned of, the same for their copies in imagined worlds
_overloaded: set[str] = set()  # the same of those under more tension than they bear


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


def warn_of_resolution(body: Body, world: Simulation) -> None:
    """Warn, once for a body and its copies, where it comes out much softer than its material says."""
    found = body.resolution
    if found is None or world._quiet or body.key in _warned:
        return
    asked = float(np.max(getattr(body.material, "max_tension", 0.0)))
    if found.tension is not None and asked > found.tension * (1.0 + 1e-6):
        _warned.add(body.key)
        logger.warning(
            "%r is to bear %.3g N/m (max_tension), and bears %.3g N/m in %d substeps a frame. World(substeps=%d), "
            "coarser cells or heavier cloth mend that; %r.resolution.tension says what is borne",
            body.name, asked, found.tension, found.substeps,
            math.ceil(found.substeps * math.sqrt(asked / found.tension)), body.name,
        )  # fmt: skip
        return
    if found.least >= WARNED_BELOW:
        return
    _warned.add(body.key)
    shares = {"stretch": found.stretch, "shear": found.shear, "bending": found.bending}
    parts = ", ".join(f"{share:.0%} in {name}" for name, share in shares.items() if share < WARNED_BELOW)
    if found.given:
        why = f"{found.substeps} substeps a frame were given, of one pass each"
        cure = "World(substeps=None), which chooses them itself, more substeps"
    else:
        why = f"it asks for {found.wanted} substeps a frame and gets {found.substeps}, the most that the rule takes"
        cure = f"World(substeps={found.wanted}) or more"
    logger.warning(
        "%r will be softer than its material: %s of what was asked for (%s). %s, coarser cells or a softer material "
        "mend that; %r.resolution says how much",
        body.name, parts, why, cure, body.name,
    )  # fmt: skip


def warn_of_overloads(bodies: list[Body], time: float) -> None:
    """Warn, once for a body and its copies, of sheets under more tension than their substeps bear at ``time`` [s]."""
    for body in bodies:
        found = body.resolution
        if found is None or found.tension is None or body.key in _overloaded:
            continue
        from nuno.solvers.cloth_substeps import MAX_SUBSTEPS
        from nuno.solvers.line_tension import line_tension

        solver: Any = body._dynamics.solver  # type: ignore[union-attr]
        load, borne = line_tension(solver), solver.bearable_tension()
        world = int(np.argmax(np.where(np.isfinite(load), load / borne, 0.0)))
        share = float(load[world] / borne[world])
        if not OVERLOAD < share < math.inf:
            continue
        _overloaded.add(body.key)
        substeps = round(math.sqrt(float(borne[world]) / found.tension) * found.substeps)
        enough = math.ceil(substeps * math.sqrt(OVERLOAD * share))
        cure = f"World(substeps={enough})"
        if not found.given and enough <= MAX_SUBSTEPS:
            cure = f"Cloth(max_tension={math.ceil(OVERLOAD * float(load[world]))})"
        logger.warning(
            "%r is stretched as by %.3g N/m at %.3g s, and bears %.3g N/m in %d substeps a frame: beyond, it flutters, "
            "is longer than its material says and slips on what it touches. %s bears a tenth more than that, as "
            "what is borne goes with the square of the substeps; less load, slower moves, coarser cells or heavier "
            "cloth mend it too; %r.resolution.tension says what is borne",
            body.name, load[world], time, borne[world], substeps, cure, body.name,
        )  # fmt: skip
