"""Joints of a compiled MJCF model, and the actuators that drive them."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.joints.joint_drives import Motor, Spring
from nuno.scenes.bare_body import split_off
from nuno.scenes.compiled_mjcf import CompiledMjcf
from nuno.scenes.scene_description import SceneDescription, SceneJoint
from nuno.shapes import quaternion as quat

FREE, BALL, SLIDE, HINGE = range(4)


def add_joints(scene: SceneDescription, compiled: CompiledMjcf) -> None:
    """Add the joints of all bodies that move; several of one body have small bodies in between."""
    names = {root: body.name for root, body in zip(compiled.roots, _moving(scene, compiled), strict=True)}
    static = _static_names(scene, compiled)
    made: dict[int, SceneJoint] = {}
    for root in compiled.roots:
        first, many = int(compiled.model.body_jntadr[root]), int(compiled.model.body_jntnum[root])
        joints = [j for j in range(first, first + many) if compiled.model.jnt_type[j] != FREE]
        parent_id = int(compiled.model.body_parentid[root])
        parent = names.get(compiled.root(parent_id), static.get(parent_id))
        ends = [*(_between(scene, compiled, names[root], j) for j in joints[:-1]), names[root]]
        for end, j in zip(ends, joints, strict=False):
            made[j] = _joint(scene, compiled, j, end, parent)
            scene.joints.append(made[j])
            if parent is not None:
                made[j].contact = not compiled.moves(parent_id)
            parent = end
        above = names.get(compiled.root(parent_id))
        if len(joints) > 1 and above is not None:
            scene.ignored.append((names[root], above))
    _add_motors(scene, compiled, made)
    scene.joints.sort(key=lambda joint: [k for k, j in made.items() if j is joint])


def _moving(scene: SceneDescription, compiled: CompiledMjcf) -> list[Any]:
    return [body for body in scene.bodies if body.material is not None][: len(compiled.roots)]


def _static_names(scene: SceneDescription, compiled: CompiledMjcf) -> dict[int, str]:
    """By each body that does not move, the name of what it is in the scene, where it is there."""
    there = {body.name for body in scene.bodies if body.material is None}
    return {
        body: compiled.body_name(body) for body in compiled.members[0]
        if body > 0 and compiled.body_name(body) in there
    }  # fmt: skip


def _between(scene: SceneDescription, compiled: CompiledMjcf, name: str, j: int) -> str:
    """Add a body between two joints of a body, whose mass it takes a share of; return its name."""
    own = compiled.name("mjOBJ_JOINT", j) or f"joint {j}"
    small = split_off(scene.body(name), f"{name} at {own}", np.array(compiled.data.xanchor[j]))
    scene.bodies.append(small)
    scene.note("several joints of one body have bodies of 1 % of its mass in between", name)
    return small.name


def _joint(scene: SceneDescription, compiled: CompiledMjcf, j: int, body: str, other: str | None) -> SceneJoint:
    model, data = compiled.model, compiled.data
    name = compiled.name("mjOBJ_JOINT", j) or f"joint {j}"
    kind = {BALL: "ball", SLIDE: "slider", HINGE: "hinge"}[int(model.jnt_type[j])]
    dof, at = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    made = SceneJoint(
        name, kind, body, other, np.array(data.xanchor[j]), np.array(data.xaxis[j]),
        friction=float(model.dof_frictionloss[dof]),
    )  # fmt: skip
    lower, upper = (float(end) for end in model.jnt_range[j])
    limited = bool(model.jnt_limited[j])
    if kind == "ball":
        axis = np.array([0.0, 0.0, 1.0])
        made.axis = quat.rotate(np.array(data.xquat[model.jnt_bodyid[j]]), axis)
        if limited:
            made.limits = (0.0, min(upper, 2.99))
            scene.note("the limit of a ball joint is a cone about its z axis", name)
    else:
        made.position = float(data.qpos[at])
        if limited:
            made.limits = (lower, upper)
    if kind == "hinge":
        within_half_turn(scene, made)
    stiffness, damping = float(model.jnt_stiffness[j]), float(model.dof_damping[dof])
    if stiffness or damping:
        rest = 0.0 if kind == "ball" else float(model.qpos_spring[at])
        made.spring = Spring(stiffness, rest, damping)
    if np.any(model.jnt_stiffnesspoly[j]) or np.any(model.dof_dampingpoly[dof]):
        scene.note("springs and dampers that are not linear are taken as linear", name)
    if model.dof_armature[dof]:
        scene.note("the armature of joints is left out", name)
    return made


def within_half_turn(scene: SceneDescription, joint: SceneJoint) -> None:
    """Leave out what a hinge of Nuno cannot have: limits and a position beyond half a turn."""
    if joint.limits is not None and (joint.limits[0] < -np.pi or joint.limits[1] > np.pi):
        scene.note("limits of hinges beyond half a turn are left out", joint.name)
        joint.limits = None
    if abs(joint.position) > np.pi:
        joint.position = float((joint.position + np.pi) % (2.0 * np.pi) - np.pi)


def _add_motors(scene: SceneDescription, compiled: CompiledMjcf, made: dict[int, SceneJoint]) -> None:
    model = compiled.model
    for k in range(model.nu):
        name = compiled.name("mjOBJ_ACTUATOR", k) or f"actuator {k}"
        joint = made.get(int(model.actuator_trnid[k][0])) if int(model.actuator_trntype[k]) in (0, 1) else None
        if joint is None or joint.kind == "ball":
            scene.note("actuators that drive no hinge or slider are left out", name)
        elif int(model.actuator_dyntype[k]) or int(model.actuator_gaintype[k]):
            scene.note("actuators with dynamics of their own, and muscles, are left out", name)
        elif joint.motor is not None:
            scene.note("second actuators of a joint are left out", name)
        else:
            joint.motor = _motor(scene, compiled, k, name)


def _motor(scene: SceneDescription, compiled: CompiledMjcf, k: int, name: str) -> Motor | None:
    """Return the motor that an actuator is: gain control + bias, as stiffness and damping."""
    model = compiled.model
    gear, gain = float(model.actuator_gear[k][0]), float(model.actuator_gainprm[k][0])
    bias = np.array(model.actuator_biasprm[k][:3]) if int(model.actuator_biastype[k]) == 1 else np.zeros(3)
    control = float(compiled.data.ctrl[model.actuator_ctrladr[k]])
    if model.actuator_ctrllimited[k]:
        control = float(np.clip(control, *model.actuator_ctrlrange[k]))
    limit = np.inf
    if model.actuator_forcelimited[k]:
        limit = abs(gear) * float(np.abs(model.actuator_forcerange[k]).max())
    stiffness, damping = -bias[1] * gear**2, -bias[2] * gear**2
    if stiffness < 0.0 or damping < 0.0 or limit <= 0.0:
        scene.note("actuators that push away from where they are are left out", name)
        return None
    constant = gear * (gain * control + bias[0])
    if stiffness > 0.0:
        return Motor(0.0, constant / stiffness, stiffness, damping, limit)
    if damping > 0.0:
        return Motor(constant / damping, damping=damping, max_effort=limit)
    if constant:
        return Motor(effort=constant, max_effort=limit)
    scene.note("actuators of pure force give none until joint.motor is set", name)
    return None
