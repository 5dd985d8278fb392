"""Joints and contact filters of a USD stage."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.joints.joint_drives import Motor
from nuno.scenes.bare_body import split_off
from nuno.scenes.mjcf_tree import within_half_turn
from nuno.scenes.scene_description import SceneDescription, SceneJoint
from nuno.scenes.usd_bodies import UsdBodies
from nuno.scenes.usd_shapes import AXES
from nuno.scenes.usd_stage import UsdStage
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose

KINDS = {
    "PhysicsRevoluteJoint": "hinge", "PhysicsPrismaticJoint": "slider", "PhysicsSphericalJoint": "ball",
    "PhysicsFixedJoint": "fixed",
}  # fmt: skip
ENDLESS = 1e30
"""[N] or [N m] A break force as large as this, such as the largest float, is none."""
APART = 1e-3
"""[m] From which on the two places of a joint are told to be apart."""
ROTATIONS, TRANSLATIONS = ("rotX", "rotY", "rotZ"), ("transX", "transY", "transZ")


class UsdJoints:
    """Adds a stage's joints to a scene whose bodies are there."""

    def __init__(self, scene: SceneDescription, stage: UsdStage, bodies: UsdBodies) -> None:
        self.scene, self.stage, self.bodies = scene, stage, bodies

    def add(self) -> None:
        """Add all joints."""
        for prim in self.stage.prims:
            if prim.IsA(self.stage.usd.UsdPhysics.Joint):
                self._add(prim)

    def _add(self, prim: Any) -> None:
        scene, stage = self.scene, self.stage
        name = prim.GetDisplayName() or prim.GetName()
        if any(joint.name == name for joint in scene.joints):
            name = str(prim.GetPath())[1:]
        kind, axis = KINDS.get(str(prim.GetTypeName())), str(stage.value(prim, "physics:axis", "X"))
        free = self._free(prim) if str(prim.GetTypeName()) == "PhysicsJoint" else ()
        if str(prim.GetTypeName()) == "PhysicsJoint":
            kind, axis = self._generic(prim, free)
        if kind is None or not stage.value(prim, "physics:jointEnabled", True):
            scene.note("joints of distance, those that hold nothing, and those that are off are left out", name)
            return
        first, second = (self._end(prim, k) for k in (0, 1))
        (other, others, base), (body, own, _) = first, second
        if body is None and other is not None:  # seen from the other end
            body, other, own, others, base = other, body, others, own, second[2]
        if body is None or self._is_static(body):
            if other is None or self._is_static(other):
                scene.note("joints of what does not move are left out", name)
                return
            body, other, own, others, base = other, body, others, own, second[2]
        turned = body != second[0]
        if kind == "chain":
            if turned:
                scene.note("joints of several directions whose second body stands still are left out", name)
                return
            self._chain(prim, name, free, str(body), base, (own, others))
            return
        made = self._made(prim, name, kind, axis, str(body), base, (own, others), -1.0 if turned else 1.0, free)
        scene.joints.append(made)

    def _made(
        self, prim: Any, name: str, kind: str, axis: str, body: str, other: str | None, frames: tuple[Pose, Pose],
        sign: float, free: tuple[str, ...],
    ) -> SceneJoint:  # fmt: skip
        """Return the joint; where its bodies change places, the axis does too, and positions stay what they are."""
        scene, stage = self.scene, self.stage
        z = AXES[axis]
        own, others = ((place, quat.multiply(turn, z)) for place, turn in frames)
        along = quat.rotate(others[1], np.array([0.0, 0.0, 1.0]))
        gap = own[0] - others[0]
        relative = quat.multiply(quat.inverse(others[1]), own[1])
        relative = -relative if relative[0] < 0.0 else relative
        position = 0.0
        if kind == "hinge":
            position = sign * 2.0 * float(np.arctan2(relative[3], relative[0]))
        elif kind == "slider":
            position = sign * float(gap @ along)
            gap = gap - (gap @ along) * along
        if np.linalg.norm(gap) > APART:
            scene.note("joints whose ends are apart join the bodies where they are", name)
        direction = quat.rotate(own[1], np.array([0.0, 0.0, 1.0])) if kind == "ball" else sign * along
        contact = bool(stage.value(prim, "physics:collisionEnabled", False))
        made = SceneJoint(name, kind, body, other, own[0], direction, position, contact=contact)
        breaks = [stage.value(prim, f"physics:break{what}", np.inf) for what in ("Force", "Torque")]
        if min(breaks) < ENDLESS:
            scene.note("joints do not break", name)
        if kind in ("hinge", "slider"):
            self._limits(prim, made, free)
            self._drive(prim, made, free[0] if free else "angular" if kind == "hinge" else "linear")
        elif kind == "ball":
            cone = float(stage.value(prim, "physics:coneAngle0Limit", -1.0)) * np.pi / 180.0
            if 0.0 <= cone < 3.0:
                made.limits = (0.0, cone)
        return made

    def _free(self, prim: Any) -> tuple[str, ...]:
        """Return the directions in which a generic joint is not locked."""
        found = []
        for direction in (*TRANSLATIONS, *ROTATIONS):
            low = self.stage.value(prim, f"limit:{direction}:physics:low", -np.inf)
            high = self.stage.value(prim, f"limit:{direction}:physics:high", np.inf)
            if not low > high:
                found.append(direction)
        return tuple(found)

    def _generic(self, prim: Any, free: tuple[str, ...]) -> tuple[str | None, str]:
        """Return the kind of joint that a generic one is, "chain" for several joints one after the other."""
        if not free:
            return "fixed", "X"
        if len(free) == 6:
            return None, "X"
        if len(free) == 1:
            return "hinge" if free[0] in ROTATIONS else "slider", free[0][-1]
        stops = [self.stage.value(prim, f"limit:{direction}:physics:low", -np.inf) for direction in free]
        return ("ball" if free == ROTATIONS and not np.isfinite(stops).any() else "chain"), "X"

    def _chain(
        self, prim: Any, name: str, free: tuple[str, ...], body: str, other: str | None, frames: tuple[Pose, Pose]
    ) -> None:
        """Add a joint for each free direction, slides first, with small bodies in between."""
        from scipy.spatial.transform import Rotation

        scene, (own, others) = self.scene, frames
        scene.note("several joints of one body have bodies of 1 % of its mass in between", body)
        relative = quat.multiply(quat.inverse(others[1]), own[1])
        angles = Rotation.from_quat(np.roll(relative, -1)).as_euler("XYZ")
        places = quat.rotate(quat.inverse(others[1]), own[0] - others[0])
        turn, above = others[1], other
        for k, direction in enumerate(free):
            n, slides = "XYZ".index(direction[-1]), direction in TRANSLATIONS
            end = body
            if k < len(free) - 1:
                small = split_off(scene.body(body), f"{body} at {name} {direction}", own[0])
                scene.bodies.append(small)
                end = small.name
            axis = quat.rotate(turn, np.eye(3)[n])
            joint = SceneJoint(f"{name} {direction}", "slider" if slides else "hinge", end, above, own[0], axis)
            joint.position = float(places[n] if slides else angles[n])
            self._limits(prim, joint, (direction,))
            self._drive(prim, joint, direction)
            scene.joints.append(joint)
            if not slides:
                turn = quat.multiply(turn, quat.from_axis_angle(np.eye(3)[n], np.array(angles[n])))
            above = end
        if other is not None and self.scene.body(other).material is not None:
            scene.ignored.append((body, other))

    def _end(self, prim: Any, k: int) -> tuple[str | None, Pose, str | None]:
        """Return the name of a body at an end, the joint's frame there in the world, and the name to join to."""
        stage = self.stage
        targets = prim.GetRelationship(f"physics:body{k}").GetTargets()
        place = np.array(stage.value(prim, f"physics:localPos{k}", (0.0, 0.0, 0.0)), dtype=float)
        given = stage.value(prim, f"physics:localRot{k}")
        turn = quat.IDENTITY if given is None else np.array([given.GetReal(), *given.GetImaginary()], dtype=float)
        turn = turn / np.linalg.norm(turn) if turn.any() else quat.IDENTITY
        target = stage.stage.GetPrimAtPath(targets[0]) if targets else None
        frame = target if target else stage.stage.GetPseudoRoot()
        point = stage.matrix(frame) @ np.append(place, 1.0)
        pose, _, _ = stage.frame(frame)
        body = stage.body_of(target) if target else None
        name = self.bodies.names.get(str((body or target).GetPath())) if target else None
        return name, (point, quat.multiply(pose[1], turn)), name

    def _is_static(self, name: str) -> bool:
        return self.scene.body(name).material is None

    def _unit(self, joint: SceneJoint) -> float:
        return np.pi / 180.0 if joint.kind == "hinge" else self.stage.unit

    def _limits(self, prim: Any, joint: SceneJoint, directions: tuple[str, ...] = ()) -> None:
        names = [("physics:lowerLimit", "physics:upperLimit")]
        names += [(f"limit:{each}:physics:low", f"limit:{each}:physics:high") for each in directions]
        for low, high in names:
            lower, upper = (self.stage.value(prim, name, end) for name, end in ((low, -np.inf), (high, np.inf)))
            if np.isfinite(lower) and np.isfinite(upper) and lower <= upper:
                joint.limits = (float(lower) * self._unit(joint), float(upper) * self._unit(joint))
        if joint.kind == "hinge":
            within_half_turn(self.scene, joint)

    def _drive(self, prim: Any, joint: SceneJoint, which: str) -> None:
        """Set the motor that a drive is; per degree and the stage's units."""
        stage, unit = self.stage, self._unit(joint)
        if not stage.has(prim, f"PhysicsDriveAPI:{which}"):
            return

        def said(name: str, default: float) -> float:
            return float(stage.value(prim, f"drive:{which}:physics:{name}", default))

        if str(stage.value(prim, f"drive:{which}:physics:type", "force")) != "force":
            self.scene.note("drives of acceleration are left out", joint.name)
            return
        # a torque [mass length2 / s2] per degree, or a force [mass length / s2] per length
        effort = stage.mass_unit * stage.unit ** (2 if joint.kind == "hinge" else 1)
        stiffness, damping = said("stiffness", 0.0) * effort / unit, said("damping", 0.0) * effort / unit
        limit = said("maxForce", np.inf) * effort
        if limit <= 0.0:
            return
        velocity = said("targetVelocity", 0.0) * unit
        if stiffness > 0.0:
            joint.motor = Motor(velocity, said("targetPosition", 0.0) * unit, stiffness, damping, limit)
        elif damping > 0.0:
            joint.motor = Motor(velocity, damping=damping, max_effort=limit)


def add_filters(scene: SceneDescription, stage: UsdStage, bodies: UsdBodies) -> None:
    """Take over pairs and groups of bodies that do not touch."""
    physics = stage.usd.UsdPhysics
    for prim in stage.prims:
        if prim.HasAPI(physics.FilteredPairsAPI):
            own = bodies.names.get(str(prim.GetPath()))
            for target in prim.GetRelationship("physics:filteredPairs").GetTargets():
                other = bodies.names.get(str(target))
                if own and other and own != other:
                    scene.ignored.append((own, other))
    groups = [physics.CollisionGroup(prim) for prim in stage.prims if prim.IsA(physics.CollisionGroup)]
    if not groups:
        return
    if len(groups) > 31:
        scene.note("groups of contact beyond the 31st are left out", groups[31].GetPrim().GetName())
        groups = groups[:31]
    table = physics.CollisionGroup.ComputeCollisionGroupTable(stage.stage)
    paths = [group.GetPrim().GetPath() for group in groups]
    touches = [
        sum(1 << n for n, other in enumerate(paths) if table.IsCollisionEnabled(path, other)) | 1 << 31
        for path in paths
    ]  # fmt: skip
    queries = [group.GetCollidersCollectionAPI().ComputeMembershipQuery() for group in groups]
    members: dict[str, list[int]] = {}
    for path, name in bodies.names.items():
        members.setdefault(name, []).extend(k for k, query in enumerate(queries) if query.IsPathIncluded(path))
    for body in scene.bodies:
        if not body.group:
            continue
        inside = sorted(set(members.get(body.name, [])))
        body.group = sum(1 << k for k in inside) or 1 << 31
        if inside:
            body.collides_with = touches[inside[0]]
            for k in inside[1:]:
                body.collides_with &= touches[k]
