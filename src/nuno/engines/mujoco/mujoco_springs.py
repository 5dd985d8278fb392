"""Springs: grips of points that give way, or bear a limited force, in MuJoCo.

Each coordinate of a held point is a fixed tendon, the weighted sum of its vertices' coordinates, which an actuator
draws to where the grip leads with the force of a spring. The ``discrete`` integrator takes that as it is at the end of
a substep, so that a spring as stiff as `STIFFEST` stays calm. Limits are in
`nuno.engines.mujoco.mujoco_spring_limits`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.world_view import dynamics_of
from nuno.joints.tie import TieSpec

if TYPE_CHECKING:
    from nuno.engines.mujoco.mujoco_held import Held

STIFFEST = 1e6
"""[N/m] Of a grip with a limit that does not give way below it."""
STRONGEST = 1e9
"""[N] Of a grip without a limit."""


def stiffness_of(spec: Any) -> float:
    """Return the stiffness of a grip's springs [N/m]."""
    return min(1.0 / spec.compliance, STIFFEST) if spec.compliance > 0.0 else STIFFEST


def add_spring(spec: Any, name: str, wraps: list[tuple[str, float]]) -> list[Any]:
    """Add the tendon of a weighted sum of joints to a spec, and its actuator; return both."""
    mujoco = mujoco_package()
    tendon = spec.add_tendon(name=name)
    for joint, weight in wraps:
        tendon.wrap_joint(joint, weight)
    motor = spec.add_actuator(
        name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_TENDON, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE, forcelimited=1, forcerange=(-1.0, 1.0),
    )  # fmt: skip
    motor.gainprm[0] = 0.0
    return [tendon, motor]


def find_springs(own: Held, placed: dict[str, Any], model: Any, batch: Any) -> None:
    """Note where a grip's springs are in a compiled model, and write their stiffness, and where a tie's lead."""
    spec, mine = own.grip.spec, placed[own.grip.body.key]
    assert own.point is not None and own.rest is not None
    own.rows = np.array([model.actuator(name).id for name in own.names], dtype=int).reshape(-1, 3)
    own.weights, vertices = _table(own.terms)
    own.qpos, own.dof = mine.qpos[vertices], mine.dof[vertices]
    own.all_dof = own.dof
    masses = dynamics_of(own.grip.body).mass[:, vertices]
    if isinstance(spec, TieSpec):
        assert own.grip.target is not None
        theirs, vertices = _table(own.others)
        own.weights = np.concatenate([own.weights, theirs], axis=1)
        other = placed[own.grip.target.key]
        own.qpos = np.concatenate([own.qpos, other.qpos[vertices]], axis=1)
        own.all_dof = np.concatenate([own.dof, other.dof[vertices]], axis=1)
        masses = np.concatenate([masses, dynamics_of(own.grip.target).mass[:, vertices]], axis=2)
    own.inverse = (own.weights**2 / masses).sum(axis=-1)
    stiffness = stiffness_of(spec)
    law, limits = batch.expand("actuator_biasprm"), batch.expand("actuator_forcerange")
    law[:, own.rows], limits[:, own.rows] = 0.0, (0.0, 0.0)
    world, point = np.nonzero(own.point >= 0)
    rows = own.rows[own.point[world, point]]
    law[world[:, None], rows, 1] = -stiffness
    limits[world[:, None], rows] = (-STRONGEST, STRONGEST)
    if isinstance(spec, TieSpec):
        law[world[:, None], rows, 0] = -stiffness * own.rest[own.point[world, point]]


def draw(own: Held, batch: Any, goals: np.ndarray) -> None:
    """Let a grip's springs draw its points to ``goals`` (worlds, k, 3) [m]."""
    assert own.point is not None and own.rest is not None
    stiffness = stiffness_of(own.grip.spec)
    world, point = np.nonzero(own.point >= 0)
    which = own.point[world, point]
    rows, goal = own.rows[which], goals[world, point] - own.rest[which]
    batch.expand("actuator_biasprm")[world[:, None], rows, 0] = stiffness * goal


def _table(terms: list[list[tuple[int, float]]]) -> tuple[np.ndarray, np.ndarray]:
    """Return weights and vertices (points, most) of sums of vertices, 0 for none."""
    most = max((len(own) for own in terms), default=1)
    weights, vertices = np.zeros((len(terms), most)), np.zeros((len(terms), most), dtype=int)
    for k, own in enumerate(terms):
        for n, (vertex, weight) in enumerate(own):
            weights[k, n], vertices[k, n] = weight, vertex
    return weights, vertices


def drawn_with(own: Held, data: Any, world: int) -> np.ndarray:
    """Return the generalised forces (nv,) of a grip's springs on its own body, of data whose forces are worked out."""
    assert own.point is not None
    given = np.zeros(len(data.qvel))
    for point in np.unique(own.point[world][own.point[world] >= 0]):
        force = own.last[world, point, :3] if own.is_limited_spring else data.actuator_force[own.rows[point]]
        weights = own.weights[point, : own.dof.shape[1], None]
        np.add.at(given, own.dof[point][:, None] + np.arange(3), weights * force)
    return given
