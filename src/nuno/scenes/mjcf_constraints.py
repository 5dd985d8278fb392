"""Equality constraints and excluded contacts of a compiled MJCF model."""

from __future__ import annotations

import numpy as np

from nuno.scenes.compiled_mjcf import CompiledMjcf
from nuno.scenes.scene_description import SceneDescription, SceneGrip, SceneJoint
from nuno.shapes import quaternion as quat

CONNECT, WELD = 0, 1


def add_constraints(scene: SceneDescription, compiled: CompiledMjcf) -> None:
    """Add welds as fixed joints, connections as ball joints or grips, and pairs that do not touch."""
    model = compiled.model
    moving = {body.name for body in scene.bodies if body.material is not None and not body.deforms}
    flexes = {body.name for body in scene.bodies if body.deforms}
    for k in range(model.neq):
        name = compiled.name("mjOBJ_EQUALITY", k) or f"equality {k}"
        kind = int(model.eq_type[k])
        is_body = int(model.eq_objtype[k]) == int(compiled.mujoco.mjtObj.mjOBJ_BODY)
        if kind not in (CONNECT, WELD) or not is_body or not model.eq_active0[k]:
            if compiled.mujoco.mjtEq(kind).name.startswith("mjEQ_FLEX"):
                continue  # it keeps a flex's edges their length
            scene.note("equality constraints but welds and connections of bodies are left out", name)
            continue
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        anchor = np.array(model.eq_data[k][3:6] if kind == WELD else model.eq_data[k][0:3])
        point = np.array(compiled.data.xpos[first]) + quat.rotate(np.array(compiled.data.xquat[first]), anchor)
        if first in compiled.flex_bodies:
            _hold(scene, compiled, first, second, flexes)
            continue
        ends = [compiled.body_name(compiled.root(each)) if compiled.moves(each) else None for each in (first, second)]
        if not compiled.moves(first):
            ends.reverse()
        if ends[0] not in moving or (ends[1] is not None and ends[1] not in moving):
            scene.note("equality constraints but welds and connections of bodies are left out", name)
            continue
        axis = np.array([0.0, 0.0, 1.0])
        contact = ends[1] is not None
        scene.joints.append(
            SceneJoint(name, "fixed" if kind == WELD else "ball", str(ends[0]), ends[1], point, axis, contact=contact)
        )
    _add_excludes(scene, compiled)


def _hold(scene: SceneDescription, compiled: CompiledMjcf, vertex: int, holder: int, flexes: set[str]) -> None:
    model = compiled.model
    at = int(np.flatnonzero(model.flex_vertbodyid == vertex)[0])
    flex = int(np.searchsorted(model.flex_vertadr, at, side="right")) - 1
    name = compiled.name("mjOBJ_FLEX", flex) or f"flex {flex}"
    if name in flexes:
        to = compiled.body_name(compiled.root(holder)) if compiled.moves(holder) else None
        scene.grips.append(SceneGrip(name, np.array([at - int(model.flex_vertadr[flex])]), to))


def _add_excludes(scene: SceneDescription, compiled: CompiledMjcf) -> None:
    """Add pairs whose contact is excluded; bodies that are joined have it from their joint."""
    there = {body.name for body in scene.bodies}
    joined = {frozenset((joint.body, joint.other)): joint for joint in scene.joints if joint.other is not None}
    for signature in compiled.model.exclude_signature:
        bodies = (int(signature) >> 16, int(signature) & 0xFFFF)
        names = [compiled.body_name(compiled.root(body) if compiled.moves(body) else body) for body in bodies]
        if names[0] == names[1] or not there.issuperset(names):
            continue
        joint = joined.get(frozenset(names))
        if joint is None:
            scene.ignored.append((names[0], names[1]))
        else:
            joint.contact = False
