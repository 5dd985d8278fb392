"""Bounces: Newton's law of impact between rigid bodies in MuJoCo, from before a substep.

The ``discrete`` integrator damps a contact whatever its ``solref`` says. A stiff one takes two bodies within a substep
to the distance of its margin, though. So before each substep it is found which pairs would meet within it, and their
margin is set to where they come to as they leave with the velocity that the restitution e gives.

Steps h with a constant acceleration -g along the normal keep E = v^2 / 2 + g z - g h v / 2, for a distance z. A bounce
leaves e^2 E, so that its height is e^2 of what was fallen: v' = sqrt((g h / 2)^2 + 2 (e^2 E - g z)) - g h / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_kinematics import Kinematics, velocity_of
from nuno.engines.mujoco.mujoco_package import mujoco_package

STIFF = 1e10
"""[1/s2] Of a contact that bounces, by which it comes to its margin within a substep."""
IMPEDANCE = 0.9999
STICKING = 1e3
"""Of friction in that substep, over 1 / h: a share of so much of what slips is left where it sticks."""
SLOW = 2.0
"""Substeps of free fall whose velocity is no impact: what rests gains that of one."""


@dataclass(frozen=True, eq=False)
class BouncingPair:
    """Two geoms of which at least one bounces.

    Attributes:
        number: Of the pair in the model.
        geoms, bodies: Their numbers.
        restitution: (worlds,).
        falls: Of each, whether gravity moves it.
    """

    number: int
    geoms: tuple[int, int]
    bodies: tuple[int, int]
    restitution: np.ndarray
    falls: tuple[bool, bool]


class Bounces:
    """All pairs of a world that bounce.

    Args:
        model: The compiled model.
        batch: The batch.
        pairs: Names and restitutions (worlds,) of the explicit pairs.
        movable: Numbers of the bodies of those that are dynamic.
        kinematics: Of the batch.
        calm: ``solref`` and ``solimp`` of a contact that does not bounce.
    """

    def __init__(
        self, model: Any, batch: Any, pairs: Sequence[tuple[str, np.ndarray]], movable: set[int],
        kinematics: Kinematics, calm: tuple[Sequence[float], Sequence[float]],
    ) -> None:  # fmt: skip
        self._batch, self._kinematics, self._calm = batch, kinematics, calm
        self._pairs = []
        for name, restitution in pairs:
            if not restitution.any():
                continue
            number = model.pair(name).id
            geoms = int(model.pair_geom1[number]), int(model.pair_geom2[number])
            bodies = int(model.geom_bodyid[geoms[0]]), int(model.geom_bodyid[geoms[1]])
            falls = bodies[0] in movable, bodies[1] in movable
            self._pairs.append(BouncingPair(number, geoms, bodies, restitution, falls))
        self._bounced: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._pairs)

    def prepare(self, step: float) -> None:
        """Let the pairs that would meet within the next substep, of ``step`` [s], bounce in it, and no others."""
        if not self._pairs:
            return
        self.settle(step)
        for world, model, data in self._kinematics.of_worlds():
            gravity = self._batch.expand("opt.gravity")[world]
            for pair in self._pairs:
                if pair.restitution[world] > 0.0:
                    margin = _margin(pair, float(pair.restitution[world]), model, data, gravity, step)
                    if margin is not None:
                        self._write(world, pair.number, margin, step)
                        self._bounced.append((world, pair.number))

    def settle(self, step: float) -> None:
        """Let no pair bounce any more."""
        for world, number in self._bounced:
            self._write(world, number, 0.0, step)
        self._bounced = []

    def _write(self, world: int, number: int, margin: float, step: float) -> None:
        """Let a pair bounce to a margin [m], or not, where that is 0."""
        batch, bounces = self._batch, margin != 0.0
        batch.expand("pair_margin")[world, number] = margin
        batch.expand("pair_solref")[world, number] = (-STIFF, -1e-9) if bounces else self._calm[0]
        batch.expand("pair_solimp")[world, number] = self._calm[1]
        if bounces:
            batch.expand("pair_solimp")[world, number, :2] = IMPEDANCE
        # zeros are for as in ``pair_solref``
        batch.expand("pair_solreffriction")[world, number] = (-1e-9, -STICKING / step) if bounces else 0.0


def _margin(pair: BouncingPair, e: float, model: Any, data: Any, gravity: np.ndarray, step: float) -> float | None:
    """Return to which distance [m] of each other a bounce takes two geoms in a substep; None where they do not meet."""
    motions, ends = [(*velocity_of(model, data, body), data.xpos[body]) for body in pair.bodies], np.zeros(6)
    reach = [
        np.linalg.norm(velocity)
        + np.linalg.norm(spin) * (np.linalg.norm(data.geom_xpos[geom] - place) + model.geom_rbound[geom])
        for (velocity, spin, place), geom in zip(motions, pair.geoms, strict=True)
    ]
    most = step * float(sum(reach)) + 1e-6
    # a plane has no radius
    radii, apart = model.geom_rbound[list(pair.geoms)], np.ptp(data.geom_xpos[list(pair.geoms)], axis=0)
    if radii.all() and np.linalg.norm(apart) > radii.sum() + most:
        return None
    distance = mujoco_package().mj_geomDistance(model, data, *pair.geoms, most, ends)
    if distance >= most:
        return None
    points = ends.reshape(2, 3)
    if abs(distance) > 1e-9:
        normal = (points[1] - points[0]) / distance
    else:  # they touch in one point, whose normal is not told
        normal = data.geom_xpos[pair.geoms[1]] - data.geom_xpos[pair.geoms[0]]
        normal = normal / max(float(np.linalg.norm(normal)), 1e-12)
    first, second = (
        velocity + np.cross(spin, point - place) for (velocity, spin, place), point in zip(motions, points, strict=True)
    )
    speed = float(normal @ (second - first))
    falls = [float(normal @ gravity) if moves else 0.0 for moves in pair.falls]
    pull = falls[0] - falls[1]
    # the substep that is nearest to the meeting, if it does not leave them inside of each other
    ahead = max(1.0 - e, 0.5) * step * (speed - step * pull)
    if speed > -1e-6 - SLOW * step * abs(pull) or distance + ahead >= 0.0:
        return None
    energy = e**2 * (0.5 * speed**2 + pull * distance - 0.5 * pull * step * speed) - pull * distance
    # where it would not come up to where it is now, it stays there and falls again
    leaves = float(np.sqrt(max(0.0, (0.5 * pull * step) ** 2 + 2.0 * energy))) - 0.5 * pull * step
    return distance + step * max(leaves, 0.0)
