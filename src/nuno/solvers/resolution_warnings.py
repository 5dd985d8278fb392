"""Warnings of bodies that come out much softer than their material says, or bear more than their substeps can."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body

logger = logging.getLogger(__name__)

WARNED_BELOW = 0.9
"""A share of the stiffness below which a warning says so."""
OVERLOAD = 1.1
"""A tension, over the one that is borne, above which a warning says so: a load that is put on at once swings."""
_warned: set[str] = set()  # keys of bodies that were warned of, the same for their copies in imagined worlds
_overloaded: set[str] = set()  # the same of those under more tension than they bear


def warn_of_resolution(body: Body) -> None:
    """Warn, once for a body and its copies, where it comes out much softer than its material says."""
    found = body.resolution
    if found is None or body.key in _warned:
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
