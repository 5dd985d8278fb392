"""Loose holds: rigid bodies in MuJoCo whose grip gives way, or lets them slide.

A helper of little mass hangs on what leads by slides and a ball joint, whose stiffness is that of the grip, and the
body is welded to it. Where the grip is stiff it has one slide, along the free direction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.world_view import dynamics_of
from nuno.joints.tie import HoldSpec
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import compose

if TYPE_CHECKING:
    from nuno.engines.mujoco.mujoco_grips import Held

THIN = 0.02
"""Share of its body's mass that a helper has."""
WELDED = 10.0
"""``torquescale`` of the weld of a helper, which is light to turn: with 1 it gave way by 1 % of the spring's turn."""


def is_loose(spec: Any) -> bool:
    """Return True if the grip of a rigid body gives way or lets it slide."""
    return isinstance(spec, HoldSpec) and (spec.compliance > 0.0 or spec.free is not None)


def add_helper(own: Held, parent: Any, name: str) -> Any:
    """Add the helper of a loose hold to a spec, below what leads; return it."""
    spec, kinds = own.grip.spec, mujoco_package().mjtJoint
    helper = parent.add_body(name=name)
    for k, axis in enumerate(_axes(spec)):
        slides = spec.free is not None and k == 0
        stiffness = 0.0 if slides or spec.compliance == 0.0 else 1.0 / spec.compliance
        joint = helper.add_joint(name=f"{name}.{k}", type=kinds.mjJNT_SLIDE, axis=axis)
        joint.stiffness[0] = stiffness
    if spec.compliance > 0.0:
        ball = helper.add_joint(name=f"{name}.ball", type=kinds.mjJNT_BALL)
        ball.stiffness[0] = 1.0 / spec.compliance
    return helper


def _axes(spec: HoldSpec) -> np.ndarray:
    """Return the directions (1 or 3, 3) of the world along which the helper slides, the free one first."""
    if spec.free is None:
        return np.eye(3)
    axis = np.asarray(spec.free, dtype=float)
    if spec.compliance == 0.0:
        return axis[None]
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across /= np.linalg.norm(across)
    return np.stack([axis, across, np.cross(axis, across)])


def find_helper(own: Held, model: Any, batch: Any) -> None:
    """Note where a helper's coordinates are in a compiled model, and put it to its place on a body that moves."""
    name = own.helper.name
    count = len(_axes(own.grip.spec))
    own.slides = np.array([model.joint(f"{name}.{k}").id for k in range(count)], dtype=int)
    own.ball = int(model.joint(f"{name}.ball").id) if own.grip.spec.compliance > 0.0 else -1
    own.addresses = model.jnt_qposadr, model.jnt_dofadr
    if own.leader is None:
        place, turn = own.grip.spec.pose_at(0)
        body = model.body(name).id
        batch.expand("body_pos")[:, body], batch.expand("body_quat")[:, body] = place, turn


def place_helper(own: Held, batch: Any, goals: Any, k: int, step: float) -> None:
    """Turn the slides to the world's directions in substep ``k``; in the first, put the helper where the body is."""
    spec, target = own.grip.spec, own.grip.target
    dynamics: Any = dynamics_of(own.grip.body)
    worlds = dynamics.world_count
    if own.leader is not None:
        place, turn = (part[:, k] for part in goals)
        velocity = (goals[0][:, k + 1] - place) / step
        spin = np.zeros_like(velocity)
    else:
        leads: Any = dynamics_of(target) if target is not None else None
        values = leads.values
        place, turn = compose((values["place"], values["turn"]), spec.pose_at(0))
        velocity = values["velocity"] + np.cross(values["spin"], place - leads.middle())
        spin = values["spin"]
    axes = np.broadcast_to(_axes(spec), (worlds, len(own.slides), 3))
    if own.leader is not None:  # the world's directions, in the frame of what leads
        batch.expand("jnt_axis")[:, own.slides] = quat.rotate(quat.inverse(turn)[:, None], axes)
    else:
        axes = quat.rotate(turn[:, None], axes)
    if k > 0:
        return
    own_values, (at, to) = dynamics.values, own.addresses
    away = own_values["place"] - place
    arm = dynamics.middle() - own_values["place"]
    faster = own_values["velocity"] - np.cross(own_values["spin"], arm) - velocity - np.cross(spin, away)
    qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
    qpos[:, at[own.slides]] = np.einsum("wnx,wx->wn", axes, away)
    qvel[:, to[own.slides]] = np.einsum("wnx,wx->wn", axes, faster)
    if own.ball >= 0:
        qpos[:, at[own.ball] + np.arange(4)] = quat.multiply(quat.inverse(turn), own_values["turn"])
        local = quat.rotate(quat.inverse(own_values["turn"]), own_values["spin"] - spin)
        qvel[:, to[own.ball] + np.arange(3)] = local
