"""A robot on a floor by Pinocchio's constraint solver, with motors as Nuno's robots have them.

Time steps of velocities: the mass matrix with motors implicit, Coulomb contact at the corners of the soles, and
friction of joints as a box, solved by Pinocchio's ADMM (Carpentier, Le Lidec, Montaut: "From compliant to rigid contact
simulation", RSS 2024).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

import nuno
from nuno.robot.sensors import sole_corners

FRICTION = 0.8
MENDS = 0.2
"""Share of a depth that a step takes back."""
WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioRobot:
    """A robot with a free base in Pinocchio, on a floor at height 0.

    Args:
        robot: The model, in the posture that it starts in.
        step: [s].
        loads: By link, the mass of a box of 0.1 m at a place in the world (mass [kg], (3,) [m]), which it carries.
    """

    def __init__(self, robot: nuno.Humanoid, step: float, loads: Mapping[str, tuple[float, Any]]) -> None:
        self.robot, self.step = robot, step
        self.model = model = robot.model.copy()
        data = model.createData()
        pin.framesForwardKinematics(model, data, robot.configuration())
        for link, (mass, place) in loads.items():
            joint = model.frames[robot.frame_index(link)].parentJoint
            own = pin.SE3(np.eye(3), np.asarray(place))
            box = pin.Inertia(mass, np.zeros(3), np.eye(3) * mass * 0.01 / 6.0)
            model.appendBodyToJoint(joint, box, data.oMi[joint].actInv(own))
        self.data = model.createData()
        self.q, self.v = robot.configuration(), np.zeros(model.nv)
        self.feet = [(robot.frame_index(foot), sole_corners(robot.description.frames[foot]))
                     for foot in robot.description.feet]  # fmt: skip
        self.models, self.datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for frame, corners in self.feet:
            for corner in corners:
                own = model.frames[frame]
                place = own.placement * pin.SE3(np.eye(3), corner)
                contact = pin.PointContactConstraintModel(model, own.parentJoint, place)
                contact.setFriction(FRICTION)
                self.models.append(pin.ConstraintModel(contact))
        rubs = np.array(model.upperDryFrictionLimit[6:])
        self.rubs = np.flatnonzero(rubs > 0.0)
        joints = pin.StdVec_Index()
        joints.extend([int(k) + 2 for k in self.rubs])
        most = step * np.array(model.upperDryFrictionLimit)  # impulses
        self.models.append(pin.ConstraintModel(pin.JointFrictionConstraintModel(model, joints, -most, most)))
        for one in self.models:
            self.datas.append(one.createData())
        self.solver, self.settings = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings()
        self.result = pin.ADMMSolverResult()
        self.unsolved = 0

    def limit(self, efforts: np.ndarray) -> None:
        """Set the most that motors give, (n,)."""
        self.efforts = efforts

    def drive(self, *command: np.ndarray) -> None:
        """Set all motors, as `LinkDynamics.drive` does."""
        self.command = command

    def advance(self, steps: int) -> None:
        """Take some steps."""
        for _ in range(steps):
            self.advance_once()

    def advance_once(self) -> None:
        """Take a step: velocities without contact and friction, what these do to them, and where that leads."""
        model, data, h = self.model, self.data, self.step
        positions, velocities, stiffness, damping, effort = self.command
        pin.computeAllTerms(model, data, self.q, self.v)
        pin.updateFramePlacements(model, data)
        mass = np.triu(data.M) + np.triu(data.M, 1).T
        rows: list[np.ndarray] = []
        rising: list[float] = []
        for frame, corners in self.feet:
            own = pin.getFrameJacobian(model, data, frame, WORLD_AXES)
            place = data.oMf[frame]
            for corner in corners:
                arm = place.rotation @ corner
                rows.append(own[:3] - pin.skew(arm) @ own[3:])
                height = float(place.translation[2] + arm[2])
                rising += [0.0, 0.0, (1.0 if height > 0.0 else MENDS) * height / h]
        rows.append(np.eye(model.nv)[6 + self.rubs])
        rising += [0.0] * len(self.rubs)
        jacobian = np.concatenate(rows)
        brakes = np.array(model.damping[6:])
        apart = positions - self.robot.angles_of(self.q)
        full, asked = np.zeros(len(apart), dtype=bool), np.zeros(len(apart))
        for _ in range(3):  # motors at their limits exert just those
            given = np.where(full, np.sign(asked) * self.efforts, 0.0)
            soft = np.where(full, 0.0, h * damping + h * h * stiffness)
            tau = np.where(
                full, given, stiffness * (apart - h * self.v[6:]) + damping * (velocities - self.v[6:]) + effort
            )
            left = np.concatenate([np.zeros(6), tau - brakes * self.v[6:]]) - data.nle
            inverse = np.linalg.inv(mass + np.diag(np.concatenate([np.zeros(6), soft + h * brakes])))
            free = self.v + h * inverse @ left
            delassus = jacobian @ inverse @ jacobian.T
            solved = self.solver.solve(
                pin.DelassusOperatorDense(delassus), jacobian @ free + np.array(rising), self.models, self.datas,
                self.settings, self.result,
            )  # fmt: skip
            pushes = np.asarray(self.result.retrieveConstraintImpulses())
            after = free + inverse @ jacobian.T @ pushes
            asked = stiffness * (apart - h * after[6:]) + damping * (velocities - after[6:]) + effort
            now_full = full | (np.abs(asked) > self.efforts)
            if (now_full == full).all():
                break
            full = now_full
        self.unsolved += not solved
        motor = np.clip(asked, -self.efforts, self.efforts)
        self.arrived = motor - brakes * after[6:]
        self.arrived[self.rubs] += pushes[24:] / h
        self.v = after
        self.q = pin.integrate(model, self.q, h * after)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Return q (nq,) and v (nv,)."""
        return self.q, self.v

    def torques(self) -> np.ndarray:
        """Return what arrives at the joints (n,)."""
        return self.arrived
