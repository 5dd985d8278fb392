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


Motions = dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Of bodies by their numbers the velocity [m/s] of their frame's origin, the spin [rad/s], and where that is [m]."""


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
        self._geoms = np.array([pair.geoms for pair in self._pairs], dtype=int).reshape(-1, 2)
        self._bodies = {body for pair in self._pairs for body in pair.bodies}
        self._bounced: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._pairs)

    def prepare(self, step: float) -> None:
        """Let the pairs that would meet within the next substep, of ``step`` [s], bounce in it, and no others."""
        if not self._pairs:
            return
        self.settle(step)
        for world, model, data in self._kinematics.of_worlds():
            motions = {body: (*velocity_of(model, data, body), data.xpos[body]) for body in self._bodies}
            near, reach = self._near(model, data, motions, step)
            gravity = self._batch.expand("opt.gravity")[world]
            for k in near:
                pair = self._pairs[k]
                if pair.restitution[world] > 0.0:
                    margin = _margin(
                        pair, float(pair.restitution[world]), model, data, motions, reach[k], gravity, step
                    )
                    if margin is not None:
                        self._write(world, pair.number, margin, step)
                        self._bounced.append((world, pair.number))

    def _near(self, model: Any, data: Any, motions: Motions, step: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs (k,) that may meet in a substep, and how far [m] all pairs come to each other at most."""
        speeds = np.zeros(model.ngeom)
        for geom in np.unique(self._geoms):
            velocity, spin, place = motions[int(model.geom_bodyid[geom])]
            arm = np.linalg.norm(data.geom_xpos[geom] - place) + model.geom_rbound[geom]
            speeds[geom] = np.linalg.norm(velocity) + np.linalg.norm(spin) * arm
        first, second = self._geoms.T
        reach = step * (speeds[first] + speeds[second]) + 1e-6
        radii = model.geom_rbound[self._geoms]
        apart = np.linalg.norm(data.geom_xpos[first] - data.geom_xpos[second], axis=1)
        # a plane has no radius
        return np.flatnonzero((radii == 0.0).any(axis=1) | (apart < radii.sum(axis=1) + reach)), reach

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


def _margin(
    pair: BouncingPair, e: float, model: Any, data: Any, motions: Motions, most: float, gravity: np.ndarray, step: float
) -> float | None:  # fmt: skip
    """Return to which distance [m] of each other a bounce takes two geoms in a substep; None where they do not meet."""
    ends = np.zeros(6)
    distance = mujoco_package().mj_geomDistance(model, data, *pair.geoms, most, ends)
    if distance >= most:
        return None
    points = ends.reshape(2, 3)
    normal = _normal(pair.geoms, model, data, points, distance)
    first, second = (
        velocity + np.cross(spin, point - place)
        for (velocity, spin, place), point in zip((motions[body] for body in pair.bodies), points, strict=True)
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


def _normal(geoms: tuple[int, int], model: Any, data: Any, points: np.ndarray, distance: float) -> np.ndarray:
    """Return the direction from one geom to another, by the nearest points (2, 3) [m] and how far they are apart."""
    if abs(distance) > 1e-9:
        return np.asarray((points[1] - points[0]) / distance)
    # they touch in one point, whose normal is not told
    for geom, sign in zip(geoms, (1.0, -1.0), strict=True):
        if model.geom_type[geom] == mujoco_package().mjtGeom.mjGEOM_PLANE:
            return sign * data.geom_xmat[geom].reshape(3, 3)[:, 2]
    between = data.geom_xpos[geoms[1]] - data.geom_xpos[geoms[0]]
    return np.asarray(between / max(float(np.linalg.norm(between)), 1e-12))
