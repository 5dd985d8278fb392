"""Joints as MJCF: those that move children of a tree, those that close loops, and motors as actuators."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.joints.joint_drives import Motor
from nuno.scenes.mjcf_text import numbers
from nuno.scenes.scene_description import SceneBody, SceneDescription, SceneJoint
from nuno.shapes import quaternion as quat

if TYPE_CHECKING:
    from nuno.scenes.scene_tree import JointTree

TYPES = {"hinge": "hinge", "slider": "slide", "ball": "ball"}
STIFF = 1e4
"""[N m s/rad] or [N s/m] Gain of a motor that keeps a velocity exactly, which MuJoCo has not."""


class MjcfJoints:
    """Writes the joints of one scene.

    Attributes:
        controls: What the actuators are told, in their order.
    """

    def __init__(self, scene: SceneDescription, tree: JointTree, root: xml.Element) -> None:
        self.scene, self.tree, self.root = scene, tree, root
        self.controls: list[float] = []
        self._motors: list[dict[str, str]] = []

    def write(
        self, element: xml.Element, body: SceneBody, joint: SceneJoint, bodies: dict[str, SceneBody]
    ) -> tuple[list[float], list[float]]:
        """Write the joint that moves a child; return its present position and velocity."""
        sign = -1.0 if joint.name in self.tree.turned else 1.0
        back = quat.inverse(body.quaternion)
        axis = sign * quat.rotate(back, joint.axis)
        said = {
            "name": joint.name, "type": TYPES[joint.kind], "axis": numbers(axis),
            "pos": numbers(quat.rotate(back, joint.point - body.position)),
        }  # fmt: skip
        if joint.kind != "ball":
            said["ref"] = numbers([joint.position])
        if joint.limits is not None:
            said["range"] = numbers(joint.limits)
            if joint.kind == "ball":
                said["range"] = numbers([0.0, joint.limits[1]])
                self.scene.note("the cone of a ball joint limits all its turns to MuJoCo", joint.name)
        if joint.spring is not None:
            said |= {"stiffness": numbers([joint.spring.stiffness]), "damping": numbers([joint.spring.damping])}
            if joint.kind != "ball":
                said["springref"] = numbers([joint.spring.rest])
        if joint.friction:
            said["frictionloss"] = numbers([joint.friction])
        xml.SubElement(element, "joint", said)
        if joint.motor is not None:
            self._motor(joint, joint.motor)
        return self._state(joint, axis, body, bodies)

    def close(self) -> None:
        """Write what is no child's joint, and the actuators."""
        constraints = []
        for joint in self.tree.loops:
            ends = {"body1": joint.body} | ({} if joint.other is None else {"body2": joint.other})
            if joint.kind == "fixed":
                constraints.append(("weld", {"name": joint.name} | ends))
            elif joint.kind == "ball":
                body = self.scene.body(joint.body)
                anchor = quat.rotate(quat.inverse(body.quaternion), joint.point - body.position)
                constraints.append(("connect", {"name": joint.name, "anchor": numbers(anchor)} | ends))
            else:
                self.scene.note("a hinge or slider that closes a loop is left out", joint.name)
        if constraints:
            equality = xml.SubElement(self.root, "equality")
            for kind, said in constraints:
                xml.SubElement(equality, kind, said)
        if self._motors:
            actuator = xml.SubElement(self.root, "actuator")
            for said in self._motors:
                xml.SubElement(actuator, "general", said)

    def _motor(self, joint: SceneJoint, motor: Motor) -> None:
        stiffness, damping = float(motor.stiffness), motor.damping
        if motor.position is None:
            if damping is None:
                self.scene.note("a motor that keeps its velocity exactly has a gain for MuJoCo", joint.name)
                damping = STIFF
            gain, bias, control = float(damping), [0.0, 0.0, -float(damping)], float(motor.velocity)
        else:
            damping = 0.0 if damping is None else float(damping)
            bias = [damping * float(motor.velocity), -stiffness, -damping]
            gain, control = stiffness, float(motor.position)
        limit = float(motor.max_effort)
        said: dict[str, Any] = {
            "name": f"{joint.name}/motor", "joint": joint.name, "gaintype": "fixed", "biastype": "affine",
            "gainprm": numbers([gain]), "biasprm": numbers(bias),
        }  # fmt: skip
        if np.isfinite(limit):
            said["forcerange"] = numbers([-limit, limit])
        self._motors.append(said)
        self.controls.append(control)

    def _state(
        self, joint: SceneJoint, axis: np.ndarray, body: SceneBody, bodies: dict[str, SceneBody]
    ) -> tuple[list[float], list[float]]:
        parent = self.tree.parent[body.name]
        above = None if parent is None else bodies[parent]
        velocity, spin = _motion_at(body, joint.point)
        other, other_spin = (np.zeros(3), np.zeros(3)) if above is None else _motion_at(above, joint.point)
        if joint.kind == "ball":
            return [1.0, 0.0, 0.0, 0.0], quat.rotate(quat.inverse(body.quaternion), spin - other_spin).tolist()
        along = quat.rotate(body.quaternion, axis)
        rate = (spin - other_spin if joint.kind == "hinge" else velocity - other) @ along
        return [joint.position], [float(rate)]


def _motion_at(body: SceneBody, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity [m/s] of a body's point, and its angular velocity [rad/s]."""
    spin = np.zeros(3) if body.angular_velocity is None else body.angular_velocity
    velocity = np.zeros(3) if body.velocity is None else body.velocity
    centre = getattr(body.material, "centre_of_mass", None)
    middle = body.position if centre is None else body.position + quat.rotate(body.quaternion, centre)
    return velocity + np.cross(spin, point - middle), spin
