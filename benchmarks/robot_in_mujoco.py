"""A robot's URDF in MuJoCo, with motors as Nuno's robots have them; what `robot_against_mujoco.py` compares with."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

import nuno
from nuno.robot.sensors import sole_corners
from nuno.shapes import quaternion as quat

FRICTION = 0.8
"""Coulomb's coefficient of soles and floor."""
SOLE = 0.02
"""[m] Thickness of a sole's box."""


class MujocoRobot:
    """A robot in MuJoCo: joints, friction and damping of its URDF, boxes as soles, no other contact.

    Args:
        robot: The model, in the posture that it starts in.
        step: Of MuJoCo [s].
        gravity: (3,) [m/s2].
        afloat: Whether its base is free.
        floor: Whether there is one, at height 0, with boxes as soles.
        friction: Of joints: "hard" as Coulomb's law, "soft" as MuJoCo's defaults have it, "none" without damping too.
        loads: By link, the mass of a box of 0.1 m at a place in the world (mass [kg], (3,) [m]), which it carries.
    """

    def __init__(
        self, robot: nuno.Humanoid, step: float, gravity: Any = (0.0, 0.0, -9.81), *, afloat: bool = True,
        floor: bool = False, friction: str = "hard", loads: Mapping[str, tuple[float, Any]] | None = None,
    ) -> None:  # fmt: skip
        self.robot, self.afloat = robot, afloat
        spec = mujoco.MjSpec.from_string(urdf_text(robot))
        spec.option.timestep, spec.option.gravity = step, gravity
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        if afloat:
            spec.bodies[1].add_freejoint()
        for name in robot.joint_names:
            spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_position(kp=1.0, kv=1.0)
        if floor:
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(5, 5, 0.1), friction=(FRICTION, 0.0, 0.0))
            for foot in robot.description.feet:
                add_sole(spec, robot, foot)
        for link, (mass, place) in (loads or {}).items():
            add_load(spec, robot, link, mass, np.asarray(place))
        self.model = model = spec.compile()
        model.jnt_actfrclimited[:] = 0
        if friction == "none":
            model.dof_damping[:] = model.dof_frictionloss[:] = 0.0
        if friction == "hard":
            model.dof_solimp[:] = (0.9999, 0.9999, 0.001, 0.5, 2.0)
        self.data = mujoco.MjData(model)
        joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in robot.joint_names]
        self.places, self.rows = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        q = robot.configuration()
        if afloat:
            self.data.qpos[:7] = [*q[:3], q[6], *q[3:6]]
        self.data.qpos[self.places] = robot.angle_vector()
        mujoco.mj_forward(model, self.data)

    def drive(self, positions: Any, velocities: Any, stiffness: Any, damping: Any, effort: Any) -> None:
        """Set all motors, as `LinkDynamics.drive` does."""
        bias = self.model.actuator_biasprm
        bias[:, 0] = stiffness * positions + damping * velocities + effort
        bias[:, 1], bias[:, 2] = -stiffness, -damping
        self.model.actuator_gainprm[:, 0] = 0.0

    def limit(self, efforts: np.ndarray) -> None:
        """Set the most that motors give, (n,)."""
        self.model.actuator_forcelimited[:] = 1
        self.model.actuator_forcerange[:] = np.stack([-efforts, efforts], axis=1)

    def advance(self, steps: int) -> None:
        """Take some steps."""
        for _ in range(steps):
            mujoco.mj_step(self.model, self.data)

    def angles(self) -> np.ndarray:
        """Return the joints' positions (n,)."""
        return self.data.qpos[self.places].copy()

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return q (nq,) and v (nv,), as Pinocchio has them."""
        data, v = self.data, np.zeros(self.robot.model.nv)
        base = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        if self.afloat:
            base = np.array([*data.qpos[:3], *data.qpos[4:7], data.qpos[3]])
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, data.qpos[3:7])
            v[:3], v[3:6] = turn.reshape(3, 3).T @ data.qvel[:3], data.qvel[3:6]
        v[6:] = data.qvel[self.rows]
        return self.robot.configuration_of(self.angles(), base), v

    def torques(self) -> np.ndarray:
        """Return what arrives at the joints (n,): motors, less damping and friction."""
        model, data = self.model, self.data
        found = data.qfrc_actuator + data.qfrc_passive
        rubs = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        np.add.at(found, data.efc_id[: data.nefc][rubs], data.efc_force[: data.nefc][rubs])
        assert model.nv == len(found)
        return found[self.rows]


def urdf_text(robot: nuno.Humanoid) -> str:
    """Return a URDF without shapes, for MuJoCo."""
    root = ElementTree.parse(robot.description.urdf).getroot()
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                link.remove(shape)
    settings = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(settings, "compiler", fusestatic="false", balanceinertia="true", discardvisual="true")
    return ElementTree.tostring(root, encoding="unicode")


def in_link(robot: nuno.Humanoid, link: str, place: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, Any]:
    """Return a pose of the world in a link's frame."""
    own = robot.frame_pose(link)
    back = quat.inverse(np.asarray(own.quaternion))
    return quat.rotate(back, place - own.position), quat.multiply(back, quaternion)


def add_sole(spec: Any, robot: nuno.Humanoid, foot: str) -> None:
    """Add a box as the sole of a foot."""
    frame = robot.description.frames[foot]
    half = sole_corners(frame)[-1]
    pose = robot.frame_pose(foot)
    middle = pose.to_world([(0.0, 0.0, 0.5 * SOLE)])[0]
    place, turn = in_link(robot, frame.link, middle, np.asarray(pose.quaternion))
    spec.body(frame.link).add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=(half[0], half[1], 0.5 * SOLE), pos=place, quat=turn, mass=0.0,
        friction=(FRICTION, 0.0, 0.0),
    )  # fmt: skip


def add_load(spec: Any, robot: nuno.Humanoid, link: str, mass: float, place: np.ndarray) -> None:
    """Add a box of 0.1 m, with the world's axes, to a link."""
    own, turn = in_link(robot, link, place, np.array((1.0, 0.0, 0.0, 0.0)))
    body = spec.body(link).add_body(name=f"{link}_load", pos=own, quat=turn)
    body.mass, body.inertia, body.explicitinertial = mass, np.full(3, mass * 0.01 / 6.0), True
    body.ipos, body.iquat = np.zeros(3), (1.0, 0.0, 0.0, 0.0)
