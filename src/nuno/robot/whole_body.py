"""WholeBodyControl: joint torques that keep a robot on its feet while it follows a motion, by quadratic programming.

Inverse dynamics of the whole body as weighted tasks (Del Prete et al.: "Prioritized motion-force control of constrained
fully-actuated robots", Robotics and Autonomous Systems 63, 2015; Herzog et al., Autonomous Robots 40, 2016). Unknown
are the accelerations of base and joints, and a force at each corner of each sole that stands. The equation of motion
of the base, friction pyramids and effort limits hold exactly; centre of mass, trunk, feet and posture follow their
references as well as they can.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import MissingPackageError
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.sensors import sole_corners

try:
    import daqp
except ImportError as error:
    raise MissingPackageError("daqp", "robot", "a robot's balance") from error

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

EQUAL = 5
"""DAQP's mark of a constraint that is an equality."""
WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class Gains:
    """Weights of the tasks, and how fast errors are to vanish.

    Attributes:
        centre, trunk, foot, posture, force: Weights.
        centre_rate, trunk_rate, foot_rate, posture_rate: Of the double pole that errors follow [1/s].
        stand_rate: At which what moves of a standing foot is braked [1/s].
    """

    centre: float = 10.0
    trunk: float = 3.0
    foot: float = 100.0
    posture: float = 0.1
    force: float = 1e-7
    centre_rate: float = 6.0
    trunk_rate: float = 12.0
    foot_rate: float = 15.0
    posture_rate: float = 25.0
    stand_rate: float = 20.0


class WholeBodyControl:
    """Torques and accelerations by which a robot follows a motion on its feet.

    Args:
        robot: The robot.
        gravity: (3,) [m/s2].
        friction: Coulomb's coefficient that the feet may count on.
        gains: Weights and rates.
    """

    def __init__(
        self, robot: Humanoid, gravity: Any = (0.0, 0.0, -9.81), *, friction: float = 0.6, gains: Gains | None = None
    ) -> None:
        self._model = robot.model.copy()
        self._model.gravity.linear = np.array(gravity, dtype=float)
        self._data, self._wanted = self._model.createData(), self._model.createData()
        self.gains = gains or Gains()
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        self._corners = [sole_corners(robot.description.frames[foot]) for foot in robot.description.feet]
        limits = robot.effort_limits
        self._efforts = np.where(np.isfinite(limits) & (limits > 0.0), limits, 1e9)
        flat = friction / np.sqrt(2.0)
        self._pyramid = np.array([[1.0, 0, -flat], [-1.0, 0, -flat], [0, 1.0, -flat], [0, -1.0, -flat], [0, 0, -1.0]])

    def solve(
        self, now: RobotState, wanted: RobotState, stands: tuple[bool, ...], external: Any = None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return accelerations (nv,) of base and joints and torques (n,) of the joints, None where there are none.

        Args:
            now: How the robot moves.
            wanted: How it is to move.
            stands: Of each foot, whether it bears.
            external: Forces on the joints in their own frames, as Pinocchio takes them, or None.
        """
        model, data, ref, gains = self._model, self._data, self._wanted, self.gains
        nv = model.nv
        none = np.zeros(nv)
        pin.computeJointJacobians(model, data, now.q)
        pin.centerOfMass(model, data, now.q, now.v, none)
        drift = np.array(data.acom[0])
        centre, centre_speed = np.array(data.com[0]), np.array(data.vcom[0])
        centre_rows = np.array(pin.jacobianCenterOfMass(model, data, now.q))
        mass = np.array(pin.crba(model, data, now.q, pin.Convention.WORLD))
        mass = np.triu(mass) + np.triu(mass, 1).T
        forced = () if external is None else (external,)
        bias = np.array(pin.rnea(model, data, now.q, now.v, none, *forced))
        pin.forwardKinematics(model, data, now.q, now.v, none)
        pin.updateFramePlacements(model, data)
        pin.centerOfMass(model, ref, wanted.q, wanted.v, wanted.a)
        pin.forwardKinematics(model, ref, wanted.q, wanted.v, wanted.a)
        pin.updateFramePlacements(model, ref)

        rows: list[np.ndarray] = []
        aims: list[np.ndarray] = []

        def task(weight: float, jacobian: np.ndarray, aim: np.ndarray) -> None:
            rows.append(np.sqrt(weight) * jacobian)
            aims.append(np.sqrt(weight) * aim)

        def back(rate: float, error: np.ndarray, speed: np.ndarray) -> np.ndarray:
            return rate * rate * error + 2.0 * rate * speed

        task(
            gains.centre, centre_rows,
            ref.acom[0] + back(gains.centre_rate, ref.com[0] - centre, ref.vcom[0] - centre_speed) - drift,
        )  # fmt: skip
        turn, turn_wanted = data.oMi[1].rotation, ref.oMi[1].rotation
        across = turn.T @ turn_wanted
        trunk = np.zeros((3, nv))
        trunk[:, 3:6] = np.eye(3)
        task(
            gains.trunk, trunk,
            across @ wanted.a[3:6] + back(gains.trunk_rate, pin.log3(across), across @ wanted.v[3:6] - now.v[3:6]),
        )  # fmt: skip
        posture = np.eye(nv)[6:]
        error = pin.difference(model, now.q, wanted.q)[6:]
        task(gains.posture, posture, wanted.a[6:] + back(gains.posture_rate, error, (wanted.v - now.v)[6:]))
        touching: list[np.ndarray] = []
        for frame, corners, bears in zip(self._feet, self._corners, stands, strict=True):
            own = np.array(pin.getFrameJacobian(model, data, frame, WORLD_AXES))
            fall = pin.getFrameClassicalAcceleration(model, data, frame, WORLD_AXES).vector
            speed = pin.getFrameVelocity(model, data, frame, WORLD_AXES).vector
            place, place_wanted = data.oMf[frame], ref.oMf[frame]
            error = np.concatenate([
                place_wanted.translation - place.translation, pin.log3(place_wanted.rotation @ place.rotation.T),
            ])  # fmt: skip
            if bears:
                lift = (place.rotation @ corners.T)[2] + place.translation[2]
                touch = np.ptp(lift) < 2e-3 and abs(error[2]) < 2e-3
                pull = np.zeros(6) if touch else error * (0, 0, 1, 1, 1, 0)
                aim = 4.0 * gains.stand_rate * pull * gains.foot_rate - gains.stand_rate * speed
                for corner in corners:
                    arm = place.rotation @ corner
                    touching.append(own[:3] - pin.skew(arm) @ own[3:])
            else:
                goal = pin.getFrameClassicalAcceleration(model, ref, frame, WORLD_AXES).vector
                wants = pin.getFrameVelocity(model, ref, frame, WORLD_AXES).vector
                aim = goal + back(gains.foot_rate, error, wants - speed)
            task(gains.foot, own, aim - fall)
        n, forces = nv, 3 * len(touching)
        contact = np.concatenate(touching) if touching else np.zeros((0, nv))
        tasks, aim_all = np.concatenate(rows), np.concatenate(aims)
        hessian = np.zeros((n + forces, n + forces))
        hessian[:n, :n] = tasks.T @ tasks + 1e-6 * np.eye(n)
        hessian[n:, n:] = gains.force * np.eye(forces)
        linear = np.zeros(n + forces)
        linear[:n] = -tasks.T @ aim_all
        motion = np.concatenate([mass, -contact.T], axis=1)
        cones = np.zeros((5 * len(touching), n + forces))
        for k in range(len(touching)):
            cones[5 * k : 5 * k + 5, n + 3 * k : n + 3 * k + 3] = self._pyramid
        constraints = np.concatenate([motion, cones])
        upper = np.concatenate([-bias[:6], self._efforts - bias[6:], np.zeros(len(cones))])
        lower = np.concatenate([-bias[:6], -self._efforts - bias[6:], np.full(len(cones), -1e30)])
        sense = np.zeros(len(upper), dtype=np.int32)
        sense[:6] = EQUAL
        found, _, flag, _ = daqp.solve(hessian, linear, constraints, upper, lower, sense)
        if flag <= 0:
            return None
        return np.asarray(found[:n]), np.asarray((motion @ found + bias)[6:])
