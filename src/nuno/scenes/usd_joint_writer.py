"""Joints as UsdPhysics has them: a frame in each body, limits and drives in degrees."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno.joints.joint_drives import Motor
from nuno.scenes.scene_description import SceneJoint
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Pose, compose, invert

DEGREE = np.pi / 180.0
TYPES = {"hinge": "RevoluteJoint", "slider": "PrismaticJoint", "ball": "SphericalJoint", "fixed": "FixedJoint"}
STIFF = 1e4
"""[N m s/rad] or [N s/m] Gain of a motor that keeps a velocity exactly, which USD has not."""


def write_joint(writer: Any, joint: SceneJoint) -> None:
    """Write a joint with the frames that it has where its position is 0."""
    usd = writer.usd
    made = getattr(usd.UsdPhysics, TYPES[joint.kind]).Define(writer.stage, writer.path_for(joint.name, "joint"))
    prim = made.GetPrim()
    prim.SetDisplayName(joint.name)
    scene = writer.scene
    body = scene.body(joint.body)
    other = None if joint.other is None else scene.body(joint.other)
    own, others = joint_frames(joint)
    for k, (end, frame) in enumerate(((other, others), (body, own))):
        place, turn = frame if end is None else compose(invert((end.position, end.quaternion)), frame)
        getattr(made, f"CreateLocalPos{k}Attr")(writer.vec3f(place))
        getattr(made, f"CreateLocalRot{k}Attr")(writer.quatf(turn))
        if end is not None:
            getattr(made, f"CreateBody{k}Rel")().SetTargets([writer.paths[end.name]])
    made.CreateCollisionEnabledAttr(bool(joint.contact))
    if joint.kind == "fixed":
        return
    unit = DEGREE if joint.kind == "hinge" else 1.0
    made.CreateAxisAttr("Z")
    if joint.limits is not None and joint.kind == "ball":
        made.CreateConeAngle0LimitAttr(joint.limits[1] / DEGREE)
        made.CreateConeAngle1LimitAttr(joint.limits[1] / DEGREE)
    elif joint.limits is not None:
        made.CreateLowerLimitAttr(joint.limits[0] / unit)
        made.CreateUpperLimitAttr(joint.limits[1] / unit)
    if joint.friction:
        scene.note("friction in joints is read by Nuno alone", joint.name)
    if joint.motor is not None and joint.kind != "ball":
        _drive(usd, prim, joint.kind, joint.motor, unit)
    if joint.spring is not None:
        if joint.motor is None and joint.kind != "ball":
            spring = joint.spring
            stiffness = float(spring.stiffness)
            passive = (
                Motor(0.0, float(spring.rest), stiffness, float(spring.damping)) if stiffness
                else Motor(0.0, damping=float(spring.damping))
            )  # fmt: skip
            _drive(usd, prim, joint.kind, passive, unit)
        else:
            scene.note("a spring beside a motor, or of a ball joint, is read by Nuno alone", joint.name)


def joint_frames(joint: SceneJoint) -> tuple[Pose, Pose]:
    """Return a joint's frame in the first body and that in the other, both in the world; z is the axis."""
    z = joint.axis / np.linalg.norm(joint.axis)
    turn = np.array([1.0 + z[2], -z[1], z[0], 0.0]) if z[2] > -1.0 + 1e-9 else np.array([0.0, 1.0, 0.0, 0.0])
    turn = turn / np.linalg.norm(turn)
    others: Pose = (joint.point, turn)
    if joint.kind == "hinge":
        about = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(joint.position))
        return (joint.point, quat.multiply(turn, about)), others
    if joint.kind == "slider":
        return others, (joint.point - joint.position * z, turn)
    return others, others


def _drive(usd: Any, prim: Any, kind: str, motor: Motor, unit: float) -> None:
    drive = usd.UsdPhysics.DriveAPI.Apply(prim, "angular" if kind == "hinge" else "linear")
    drive.CreateTypeAttr("force")
    damping = STIFF if motor.damping is None and motor.position is None else float(motor.damping or 0.0)
    drive.CreateDampingAttr(damping * unit)
    drive.CreateTargetVelocityAttr(float(motor.velocity) / unit)
    if motor.position is not None:
        drive.CreateStiffnessAttr(float(motor.stiffness) * unit)
        drive.CreateTargetPositionAttr(float(motor.position) / unit)
    if np.isfinite(motor.max_effort):
        drive.CreateMaxForceAttr(float(motor.max_effort))
