"""Ball joints with springs, friction or cones in MuJoCo.

A helper of little mass hangs on the other body by a ball joint of MuJoCo's own, which has the spring and the friction,
and is welded to the body. MuJoCo limits a ball's whole turn. The lean of its axis is limited by a tendon between two
points on the axis, one in each body: of the length 2 L sin(a / 2) at the distance L from the joint, for a lean a.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.engines.mujoco.mujoco_elements import SpecElements
from nuno.engines.mujoco.mujoco_kinematics import Kinematics, velocity_of
from nuno.engines.mujoco.mujoco_package import mujoco_package
from nuno.engines.mujoco.mujoco_stiff import CLOSING, STIFF
from nuno.engines.mujoco.mujoco_tree import rest_pose
from nuno.joints.joint import JointSpec
from nuno.joints.joint_drives import DRIVES
from nuno.shapes import quaternion as quat

LEVER = 1.0
"""[m] L."""
NARROWEST = 1e-3
"""[rad] Of a cone; the tendon has no direction where the axis does not lean."""
FAR = 10.0
"""[m] The tendon's length where there is no cone."""
SMALLEST = 1e-3
"""Of friction, the share of each axis at least."""


def drive_of(spec: JointSpec, name: str) -> np.ndarray:
    """Return one number of a joint's drives, (worlds,)."""
    return np.asarray(spec.drives[:, DRIVES.index(name)])


def is_driven_spherical(spec: Any) -> bool:
    """Return True if a joint is a ball with a spring, friction or a cone in any world."""
    if not isinstance(spec, JointSpec) or spec.kind != "ball":
        return False
    acts = any(drive_of(spec, name).any() for name in ("friction", "spring", "spring_damping"))
    return acts or bool(np.isfinite(drive_of(spec, "upper")).any())


@dataclass(eq=False)
class SphericalJoint:
    """A driven ball joint.

    Attributes:
        joint: The joint.
        helper: The body in the spec.
        bodies: The names of the body and the other one.
        number: Of MuJoCo's joint; ``qpos`` and ``dof`` are its addresses.
        tendon: The number of its cone's tendon.
    """

    joint: Any
    helper: Any
    bodies: tuple[str, str]
    number: int = -1
    qpos: Any = None
    dof: Any = None
    tendon: int = -1


class Balls(SpecElements):
    """All driven ball joints of a world."""

    def __init__(self) -> None:
        super().__init__()
        self._all: list[SphericalJoint] = []
        self._batch: Any = None
        self._kinematics: Any = None
        self._slips = False

    def __len__(self) -> int:
        return len(self._all)

    @property
    def changes(self) -> bool:
        """Return True if any has friction, whose limits are written before each substep."""
        return self._slips

    # The spec

    def clear(self) -> None:
        """Take all out of the spec."""
        super().clear()
        self._all = []

    def add(self, spec: Any, joint: Any, body: Any, other: Any) -> SphericalJoint:
        """Add the helper and the cone of a joint to a spec, between a body and another in it."""
        mujoco = mujoco_package()
        self._made, self._spec = self._made + 1, spec
        name, numbers = f"o{self._made}", joint.spec
        place, turn = rest_pose(numbers)
        helper = other.add_body(name=name, pos=place[0], quat=turn[0])
        own = helper.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL, pos=numbers.place[0])
        own.solimp_friction = STIFF
        helper.add_site(name=name, pos=_tip(numbers.place, numbers.turn)[0])
        tip = other.add_site(name=f"{name}.other", pos=_tip(numbers.other_place, numbers.other_turn)[0])
        cone = spec.add_tendon(name=name, limited=1, range=(0.0, FAR), solimp_limit=STIFF)
        cone.wrap_site(name)
        cone.wrap_site(tip.name)
        self._elements += [helper, tip, cone]
        made = SphericalJoint(joint, helper, (body.name, other.name))
        self._all.append(made)
        return made

    # The model

    def find(self, model: Any, batch: Any, kinematics: Kinematics, step: float) -> None:
        """Note where all is in a compiled model, and write what does not change with time."""
        self._batch, self._kinematics = batch, kinematics
        self._slips = any(drive_of(own.joint.spec, "friction").any() for own in self._all)
        closing = (CLOSING * step, 1.0)
        for own in self._all:
            spec, name = own.joint.spec, own.helper.name
            own.number, own.tendon = int(model.joint(name).id), int(model.tendon(name).id)
            own.qpos = int(model.jnt_qposadr[own.number]) + np.arange(4)
            own.dof = int(model.jnt_dofadr[own.number]) + np.arange(3)
            body = model.body(name).id
            batch.expand("body_pos")[:, body], batch.expand("body_quat")[:, body] = rest_pose(spec)
            batch.expand("jnt_pos")[:, own.number] = spec.place
            batch.expand("site_pos")[:, model.site(name).id] = _tip(spec.place, spec.turn)
            batch.expand("site_pos")[:, model.site(f"{name}.other").id] = _tip(spec.other_place, spec.other_turn)
            batch.expand("jnt_stiffness")[:, own.number] = drive_of(spec, "spring")
            batch.expand("dof_damping")[:, own.dof] = drive_of(spec, "spring_damping")[:, None]
            batch.expand("dof_frictionloss")[:, own.dof] = drive_of(spec, "friction")[:, None]
            batch.expand("dof_solref")[:, own.dof] = closing
            cone = np.maximum(drive_of(spec, "upper"), NARROWEST)
            batch.expand("tendon_range")[:, own.tendon, 1] = np.where(
                np.isfinite(cone), 2.0 * LEVER * np.sin(0.5 * np.minimum(cone, np.pi)), FAR
            )
            batch.expand("tendon_solref_lim")[:, own.tendon] = closing

    def write(self) -> None:
        """Set the helpers to where their bodies are."""
        if not self._all:
            return
        qpos, qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        for world, model, data in self._kinematics.of_worlds():
            for own in self._all:
                body, other = (model.body(name).id for name in own.bodies)
                turn = data.xquat[body]
                rest = quat.multiply(data.xquat[other], rest_pose(own.joint.spec)[1][world])
                qpos[world, own.qpos] = quat.multiply(quat.inverse(rest), turn)
                spin = velocity_of(model, data, body)[1] - velocity_of(model, data, other)[1]
                qvel[world, own.dof] = quat.rotate(quat.inverse(turn), spin)

    def follow(self) -> None:
        """Let friction, before a substep, act against the direction in which each joint turns or creeps."""
        if not self._slips:
            return
        qvel, loss = self._batch.bind("qvel"), self._batch.expand("dof_frictionloss")
        for own in self._all:
            friction = drive_of(own.joint.spec, "friction")[:, None]
            spin = np.abs(qvel[:, own.dof])
            size = np.linalg.norm(spin, axis=1, keepdims=True)
            share = np.divide(spin, size, out=np.ones_like(spin), where=size > 1e-12)
            loss[:, own.dof] = friction * np.maximum(share, SMALLEST)

    def effort(self, joint: Any, data: Any) -> float:
        """Return the torque [N m] that keeps a ball's axis in its cone, of data whose forces are known."""
        own = next((own for own in self._all if own.joint is joint), None)
        if own is None:
            return 0.0
        rows = (data.efc_type == mujoco_package().mjtConstraint.mjCNSTR_LIMIT_TENDON) & (data.efc_id == own.tendon)
        sine = min(0.5 * float(data.ten_length[own.tendon]) / LEVER, 1.0)
        return -LEVER * float(np.sqrt(1.0 - sine**2)) * float(data.efc_force[rows].sum())


def _tip(place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return the point (worlds, 3) [m] of a joint's axis at the distance `LEVER` from its place."""
    return np.asarray(place + quat.rotate(turn, np.broadcast_to((0.0, 0.0, LEVER), place.shape)))
