"""Springs: grips of points that give way, or bear a limited force, in MuJoCo.

Each coordinate of a held point is a fixed tendon, the weighted sum of its vertices' coordinates, which an actuator
draws to where the grip leads with the force of a spring, up to a limit. The ``discrete`` integrator takes both as they
are at the end of a substep, so that a spring as stiff as `STIFFEST` stays calm.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_bushing import is_limited
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.joints.grip import GripSpec
from nuno.joints.tie import TieSpec

if TYPE_CHECKING:
    from nuno.engines.mujoco.mujoco_grips import Held

STIFFEST = 1e6
"""[N/m] Of a grip with a limit that does not give way below it."""
STRONGEST = 1e9
"""[N] Of a grip without a limit."""


def is_spring(spec: Any) -> bool:
    """Return True if a grip's points are drawn by springs: it gives way, or its force is limited."""
    if isinstance(spec, TieSpec):
        return spec.places is None and (spec.compliance > 0.0 or is_limited(spec))
    return isinstance(spec, GripSpec) and (spec.compliance > 0.0 or spec.max_force is not None)


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
    if isinstance(spec, TieSpec):
        assert own.grip.target is not None
        theirs, vertices = _table(own.others)
        own.weights = np.concatenate([own.weights, theirs], axis=1)
        own.qpos = np.concatenate([own.qpos, placed[own.grip.target.key].qpos[vertices]], axis=1)
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
    """Let a grip's springs draw its points to ``goals`` (worlds, k, 3) [m], each with its limit along the way there."""
    assert own.point is not None and own.rest is not None
    spec, stiffness = own.grip.spec, stiffness_of(own.grip.spec)
    world, point = np.nonzero(own.point >= 0)
    which = own.point[world, point]
    rows, goal = own.rows[which], goals[world, point] - own.rest[which]
    batch.expand("actuator_biasprm")[world[:, None], rows, 0] = stiffness * goal
    if spec.max_force is not None:
        _limit(own, batch, world, goal)


def limit_tie(own: Held, batch: Any) -> None:
    """Let the springs of a tie of two cloths or soft bodies bear its limit along the way between its sides."""
    assert own.point is not None and own.rest is not None
    world, point = np.nonzero(own.point >= 0)
    _limit(own, batch, world, -own.rest[own.point[world, point]])


def _limit(own: Held, batch: Any, world: np.ndarray, goal: np.ndarray) -> None:
    """Write the limits of springs in ``world`` (n,), which draw their sums of coordinates to ``goal`` (n, 3) [m]."""
    assert own.point is not None
    spec, stiffness = own.grip.spec, stiffness_of(own.grip.spec)
    which = own.point[own.point >= 0]
    places = batch.bind("qpos")[world[:, None, None], own.qpos[which][..., None] + np.arange(3)]
    way = goal - np.einsum("pc,pcx->px", own.weights[which], places)
    length = np.linalg.norm(way, axis=1, keepdims=True)
    limit = np.minimum(spec.max_force, STRONGEST)[world, None]
    # at its limit it draws along the way to the goal; below, no coordinate is beyond it
    share = np.divide(np.abs(way), length, out=np.ones_like(way), where=stiffness * length >= limit)
    most = limit * np.maximum(share, 1e-6)
    batch.expand("actuator_forcerange")[world[:, None], own.rows[which]] = np.stack([-most, most], axis=-1)


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
        force = data.actuator_force[own.rows[point]]
        weights = own.weights[point, : own.dof.shape[1], None]
        np.add.at(given, own.dof[point][:, None] + np.arange(3), weights * force)
    return given
