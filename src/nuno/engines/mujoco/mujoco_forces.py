"""Forces in MuJoCo: what grips and joints bear, and where bodies touch, of the state that the world is in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.mujoco_scene import THIN
from nuno.engines.mujoco.mujoco_springs import drawn_with
from nuno.engines.mujoco.mujoco_sums import owners_of
from nuno.engines.world_view import bodies_by_key, dynamics_of
from nuno.joints.grip import Grip
from nuno.joints.joint import JointSpec
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.engines.world_view import EngineWorld


class SceneEngine(Protocol):
    """The engine as forces are read from it; `MujocoEngine` says what each member is."""

    @property
    def world(self) -> EngineWorld:
        """The world."""

    @property
    def scene(self) -> Any:
        """The compiled scene."""

    @property
    def substep(self) -> float:
        """The time of a substep [s]."""

    def write(self, time: float) -> None:
        """Bring the state of all bodies to MuJoCo."""


def forwarded(engine: SceneEngine) -> list[tuple[Any, Any]]:
    """Return a model and data of each world, with the forces of its present state worked out."""
    mujoco, scene, time = mujoco_package(), engine.scene, engine.world.time
    engine.write(time)
    step = engine.substep
    # where grips lead now, with the velocity of the substep to come
    scene.holds.write(scene.holds.present(time, step), scene.batch, 0, step, at_end=False)
    scene.balls.follow()
    found = []
    for world in range(engine.world.world_count):
        model, data = scene.batch.get_model(world), scene.batch.get_data(world)
        mujoco.mj_forward(model, data)
        found.append((model, data))
    return found


def wrench_of(engine: SceneEngine, grip: Grip) -> tuple[np.ndarray, np.ndarray]:
    """Return the force [N] and torque [N m], (worlds, 3) each, that a grip or joint bears."""
    mujoco, scene = mujoco_package(), engine.scene
    worlds = engine.world.world_count
    force, torque = np.zeros((worlds, 3)), np.zeros((worlds, 3))
    held = scene.holds.held_by(grip)
    own = scene.placed[grip.body.key]
    dynamics: Any = dynamics_of(grip.body)
    if held is None or engine.world.time == 0.0:
        return force, torque
    for world, (model, data) in enumerate(forwarded(engine)):
        if held.bushings:
            force[world], torque[world] = _borne_by_bushings(scene.bushings, held, data, world)
            if held.ball is not None and not own.depth:
                share, about = _share_of_helper(dynamics, world, model, data, int(own.dof[0]))
                arm = quat.rotate(dynamics.values["turn"][world], grip.spec.place[world])
                force[world], torque[world] = force[world] + share, torque[world] + about - np.cross(arm, share)
            continue
        kind = mujoco.mjtConstraint.mjCNSTR_EQUALITY
        if held.terms:
            given = drawn_with(held, data, world)
        else:
            mine = (data.efc_type == kind) & np.isin(data.efc_id, held.rows)
            given = np.zeros(model.nv)
            mujoco.mj_mulJacTVec(model, data, given, np.where(mine, data.efc_force, 0.0))
        if own.role == "flex":
            each = given[own.dof[:, None] + np.arange(3)]
            borne = np.abs(each).sum(axis=1) > 0.0
            places = dynamics.values["positions"][world]
            middle = places[borne].mean(axis=0) if borne.any() else np.zeros(3)
            force[world], torque[world] = -each.sum(axis=0), -np.cross(places - middle, each).sum(axis=0)
            continue
        at, turn = int(own.dof[0]), dynamics.values["turn"][world]
        if own.depth:  # it has no coordinates of its own: by the constraint's rows, as MuJoCo writes a weld's
            rows = data.efc_force[mine]
            force[world] = rows[:3]
            if len(rows) == 6:
                scale = model.eq_data[held.rows[0], 10]
                torque[world] = 0.5 * scale * quat.rotate(turn, rows[3:])
            else:  # a connected point, which bears no torque about itself
                torque[world] = np.cross(quat.rotate(turn, grip.spec.place[world]), force[world])
        else:
            force[world], torque[world] = -given[at : at + 3], -quat.rotate(turn, given[at + 3 : at + 6])
        if held.ball is not None and not own.depth:
            share, about = _share_of_helper(dynamics, world, model, data, at)
            force[world], torque[world] = force[world] + share, torque[world] + about
        if isinstance(grip.spec, JointSpec):  # told at the joint's point
            arm = quat.rotate(turn, grip.spec.place[world])
            torque[world] -= np.cross(arm, force[world])
    return force, torque


def _borne_by_bushings(bushings: Any, held: Any, data: Any, world: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the force and torque that a grip's bushings bear; of several points about their mean."""
    found = [bushings.borne(own, world, data) for own in held.bushings if own.worlds[world]]
    if not found:
        return np.zeros(3), np.zeros(3)
    forces, torques, places = (np.array(part) for part in zip(*found, strict=True))
    about = np.cross(places - places.mean(axis=0), forces)
    return -forces.sum(axis=0), -(torques + about).sum(axis=0)


def _share_of_helper(dynamics: Any, world: int, model: Any, data: Any, at: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what the helper of a body with its velocities ``at`` needs besides: force, and torque about its origin."""
    share = THIN * float(dynamics.mass[world]) * (model.opt.gravity - data.qacc[at : at + 3])
    return share, np.cross(quat.rotate(dynamics.values["turn"][world], dynamics.centre), share)


def effort_of(engine: SceneEngine, joint: Any) -> np.ndarray:
    """Return (worlds,) the torque [N m] that keeps the axis of a ball joint in its cone; 0 of a fixed joint."""
    if engine.world.time == 0.0 or not len(engine.scene.balls):
        return np.zeros(engine.world.world_count)
    return np.array([engine.scene.balls.effort(joint, data) for _, data in forwarded(engine)])


def contacts_of(engine: SceneEngine, body: Body, itself: bool) -> list[tuple[Any, ...]]:
    """Return a dynamic body's contacts: rows of point, normal towards it, force on it, other's name, world."""
    mujoco = mujoco_package()
    found: list[tuple[Any, ...]] = []
    owned = list(engine.scene.placed)
    for world, (model, data) in enumerate(forwarded(engine)):
        geoms, flexes = owners_of(engine.scene.model, engine.scene.placed, owned)
        for k in range(data.ncon):
            contact = data.contact[k]
            owners = np.where(contact.geom >= 0, geoms[contact.geom], flexes[contact.flex])
            keys = [owned[owner] if owner >= 0 else None for owner in owners]
            if body.key not in keys or (keys[0] == keys[1] and not itself):
                continue
            own = np.zeros(6)
            mujoco.mj_contactForce(model, data, k, own)
            axes = contact.frame.reshape(3, 3)
            force = axes.T @ own[:3]  # on the second body, along its normal out of the first
            if not np.any(force):
                continue
            second = keys[1] == body.key
            sign = 1.0 if second else -1.0
            other = keys[0] if second else keys[1]
            name = bodies_by_key(engine.world)[other].name if other is not None else ""
            found.append((contact.pos.copy(), sign * axes[0], sign * force, name, world))
            if keys[0] == keys[1]:
                found.append((contact.pos.copy(), -axes[0], -force, name, world))
    return found
