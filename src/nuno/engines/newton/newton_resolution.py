"""Resolution: as many substeps as block descent needs, so that a cloth bends as its rigidity says.

Block descent goes through vertices one by one, a few times a substep. What it leaves of bending depends on how much
stiffer the membrane is than a vertex's inertia, r = stretch stiffness times h^2 over the area density and a cell's
area, with substeps h. Cantilevers of 10 and 20 cells, whose drop should be 0.59 of their reach, dropped too far by 2 to
9 % at r = 0.6, by 8 to 10 % at 1 and by 36 to 42 % at 2.4, whatever the cells, stiffness and substeps
(``benchmarks/newton_substeps.py``).
"""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.world_view import dynamics_of
from nuno.materials import Cloth

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld

logger = logging.getLogger(__name__)

MINIMUM, MAXIMUM = 40, 160
"""Substeps of a frame where the world gives no number; the most take four times as long as the least."""
NOMINAL = 0.6
"""The r up to which bending is nominal within 9 %."""
LIMP = 1.2
"""The r beyond which a warning says that a cloth is too limp."""
_warned: set[str] = set()


def substeps_for(world: EngineWorld) -> int:
    """Return an even number of substeps of a frame for the cloths of a world, and warn where they do not suffice."""
    rates = {body.key: _rate(body) for body in world.bodies if _is_cloth(body)}
    frame = 1.0 / world.frame_rate
    needed = {key: frame * rate / math.sqrt(NOMINAL) for key, rate in rates.items()}
    wanted = max([float(MINIMUM), *needed.values()])
    count = int(world.substeps or min(MAXIMUM, 2 * math.ceil(0.5 * wanted)))
    for body in world.bodies:
        if body.key in rates and (frame * rates[body.key] / count) ** 2 > LIMP:
            _tell(body, count, needed[body.key])
    return count


def _is_cloth(body: Body) -> bool:
    return body.is_dynamic and isinstance(dynamics_of(body).material, Cloth)


def _rate(body: Body) -> float:
    """Return the root of a cloth's stretch stiffness over its area density and cells' area [1/s]."""
    dynamics: Any = dynamics_of(body)
    material = dynamics.material
    given = material.stretch_stiffness
    stretch = max(float(np.max(part)) for part in (given if isinstance(given, tuple) else (given,)))
    mass = float(np.min(material.area_density)) * float(dynamics.topology.cell_size) ** 2
    return math.sqrt(stretch / mass)


def _tell(body: Body, count: int, needed: float) -> None:
    if body.key in _warned:
        return
    _warned.add(body.key)
    most = f"World(substeps={2 * math.ceil(0.5 * needed)})"
    cure = most if needed <= MAXIMUM else "Larger cells or a smaller stretch stiffness"
    logger.warning(
        "newton: %r is too limp: with %d substeps a frame block descent leaves too little of its bending. %s would "
        "mend that, or another engine",
        body.name, count, cure,
    )  # fmt: skip
