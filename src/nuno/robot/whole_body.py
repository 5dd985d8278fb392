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
from nuno.robot.aims import Aims, FootAim
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.sensors import sole_corners

try:
    import daqp
except ImportError as error:
    raise MissingPackageError("daqp", "robot", "a robot's balance") from error

if TYPE_CHECKING:
    from nuno.robot.robot import Robot

EDGE = 0.9
"""Share of a sole that is counted on: on its very edge it would roll."""
LEVEL = 2e-3
"""[rad] By which a sole that stands may be tilted."""
SINKS = 0.15
"""[m/s] At which a foot goes down to ground that is lower than planned."""
LEGS = 0.01
"""Weight of the posture of legs, of that of other joints."""
EQUAL = 5
"""DAQP's mark of a constraint that is an equality."""
WORLD_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True, eq=False)
class Gains:
    """Weights of the tasks, and how fast errors are to vanish.

    Attributes:
        centre, trunk, foot, posture, force: Weights.
        catch, swing: Weights of the centre of mass along the ground and of the foot in the air, in a step that catches
            the robot.
        centre_rate, trunk_rate, foot_rate, posture_rate: Of the double pole that errors follow [1/s].
        stand_rate: At which what moves of a standing foot is braked [1/s].
    """

    centre: float = 10.0
    catch: float = 50.0
    swing: float = 20.0
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
        self, robot: Robot, gravity: Any = (0.0, 0.0, -9.81), *, friction: float = 0.6, gains: Gains | None = None
    ) -> None:
        self._model = robot.model.copy()
        self._model.gravity.linear = np.array(gravity, dtype=float)
        self._data = self._model.createData()
        self._nothing = np.zeros(self._model.nv)
        self.gains = gains or Gains()
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        self._corners = [EDGE * sole_corners(robot.description.frames[foot]) for foot in robot.description.feet]
        limits = robot.effort_limits
        self._efforts = np.where(np.isfinite(limits) & (limits > 0.0), limits, 1e9)
        chains = [set(robot.model.supports[robot.model.frames[foot].parentJoint]) for foot in self._feet]
        of_legs = {j for chain in chains for j in chain if sum(j in other for other in chains) == 1 and j > 1}
        # feet and trunk say all of where a leg of six joints is
        self._share = np.array([LEGS if n + 2 in of_legs else 1.0 for n in range(len(limits))])
        nv = robot.model.nv
        # what of the tasks is the same in every frame: trunk and posture are the velocities themselves
        self._tasks = np.zeros((nv + 6 * len(self._feet), nv))
        self._tasks[3:6, 3:6], self._tasks[6:nv, 6:] = np.eye(3), np.eye(nv - 6)
        self._weights = np.full(len(self._tasks), self.gains.foot)
        self._weights[:3], self._weights[3:6] = self.gains.centre, self.gains.trunk
        self._weights[6:nv] = self.gains.posture * self._share
        self._below = np.tril_indices(nv, -1)
        self._programs: dict[int, tuple[np.ndarray, ...]] = {}
        flat = friction / np.sqrt(2.0)
        self._pyramid = np.array([[1.0, 0, -flat], [-1.0, 0, -flat], [0, 1.0, -flat], [0, -1.0, -flat], [0, 0, -1.0]])

    def solve(
        self, now: RobotState, aims: Aims, loads: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return accelerations (nv,) of base and joints and torques (n,) of the joints, None where there are none.

        Args:
            now: How the robot moves.
            aims: What is wanted.
            loads: (njoints, 6) [N, N m] on Pinocchio's joints in their own frames, or None.
        """
        model, data, gains = self._model, self._data, self.gains
        nv, none = model.nv, self._nothing
        pin.computeJointJacobians(model, data, now.q)
        pin.centerOfMass(model, data, now.q, now.v, none)
        drift, centre, speed = (np.array(own[0]) for own in (data.acom, data.com, data.vcom))
        centre_rows = np.array(pin.jacobianCenterOfMass(model, data, now.q))
        mass = np.array(pin.crba(model, data, now.q, pin.Convention.WORLD))
        mass[self._below] = mass.T[self._below]
        forced = () if loads is None else (pin.StdVec_Force([pin.Force(own) for own in loads]),)
        bias = np.array(pin.rnea(model, data, now.q, now.v, none, *forced))
        pin.forwardKinematics(model, data, now.q, now.v, none)
        pin.updateFramePlacements(model, data)

        tasks, weights = self._tasks.copy(), self._weights.copy()
        wanted = np.zeros(len(tasks))
        pull = _back(gains.centre_rate, aims.centre[0] - centre, aims.centre[1] - speed)
        if aims.falls_freely:
            pull[:2] = 0.0
        tasks[:3], wanted[:3] = centre_rows, aims.centre[2] + pull - drift
        if aims.falls_freely:
            weights[:2] = gains.catch
        error = pin.difference(model, now.q, aims.q)
        across = pin.Quaternion(now.q[3:7]).toRotationMatrix().T @ pin.Quaternion(aims.q[3:7]).toRotationMatrix()
        wanted[3:6] = across @ aims.a[3:6] + _back(gains.trunk_rate, error[3:6], across @ aims.v[3:6] - now.v[3:6])
        wanted[6:nv] = aims.a[6:] + _back(gains.posture_rate, error[6:], (aims.v - now.v)[6:])
        touching: list[np.ndarray] = []
        for k, (frame, corners, aim) in enumerate(zip(self._feet, self._corners, aims.feet, strict=True)):
            row = slice(nv + 6 * k, nv + 6 * k + 6)
            own = np.array(pin.getFrameJacobian(model, data, frame, WORLD_AXES))
            tasks[row] = own
            if aims.falls_freely and not aim.bears:
                weights[row] = gains.swing
            wanted[row] = self._foot(data, frame, aim)
            if aim.bears:
                touching.append(own[:3] - _skew(corners @ data.oMf[frame].rotation.T) @ own[3:])
        roots = np.sqrt(weights)
        return self._minimised(roots[:, None] * tasks, roots * wanted, touching, mass, bias)

    def _foot(self, data: Any, frame: int, aim: FootAim) -> np.ndarray:
        """Return the acceleration (6,) that a foot is to have beside what the joints' velocities bring about."""
        model, gains = self._model, self.gains
        fall = pin.getFrameClassicalAcceleration(model, data, frame, WORLD_AXES).vector
        speed = pin.getFrameVelocity(model, data, frame, WORLD_AXES).vector
        place = data.oMf[frame]
        error = np.empty(6)
        error[:3] = aim.place.translation - place.translation
        error[3:] = pin.log3(aim.place.rotation @ place.rotation.T)
        if aim.bears:
            pull = error * (0, 0, 0, 1, 1, 0) if np.abs(error[3:5]).max() > LEVEL else np.zeros(6)
            found = 4.0 * gains.stand_rate * gains.foot_rate * pull - gains.stand_rate * speed
        else:
            found = aim.acceleration + _back(gains.foot_rate, error, aim.speed - speed)
            if aim.sinks:
                found[2] = -gains.stand_rate * (SINKS + speed[2])
        return np.asarray(found - fall)

    def _minimised(
        self, tasks: np.ndarray, wanted: np.ndarray, touching: list[np.ndarray], mass: np.ndarray, bias: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return accelerations and torques that miss the tasks least; None where nothing fulfils the constraints."""
        n, count = len(bias), sum(map(len, touching))
        hessian, linear, constraints, upper, lower, sense = (part.copy() for part in self._program(count))
        hessian[:n, :n] += tasks.T @ tasks
        linear[:n] = -tasks.T @ wanted
        constraints[:n, :n] = mass
        if touching:
            constraints[:n, n:] = -np.concatenate(touching).reshape(3 * count, n).T
        motion = constraints[:n]
        upper[:6] = lower[:6] = -bias[:6]
        upper[6:n] -= bias[6:]
        lower[6:n] -= bias[6:]
        found, _, flag, _ = daqp.solve(hessian, linear, constraints, upper, lower, sense)
        if flag <= 0:
            return None
        return np.asarray(found[:n]), np.asarray((motion @ found + bias)[6:])

    def _program(self, count: int) -> tuple[np.ndarray, ...]:
        """Return what of the quadratic program is the same in every frame with so many points that bear."""
        if count not in self._programs:
            n = self._model.nv
            rows, columns = n + 5 * count, n + 3 * count
            hessian, constraints = np.zeros((columns, columns)), np.zeros((rows, columns))
            hessian[:n, :n] = 1e-6 * np.eye(n)
            hessian[n:, n:] = self.gains.force * np.eye(3 * count)
            for k in range(count):
                constraints[n + 5 * k : n + 5 * k + 5, n + 3 * k : n + 3 * k + 3] = self._pyramid
            upper = np.concatenate([np.zeros(6), self._efforts, np.zeros(5 * count)])
            lower = np.concatenate([np.zeros(6), -self._efforts, np.full(5 * count, -1e30)])
            sense = np.zeros(rows, dtype=np.int32)
            sense[:6] = EQUAL
            self._programs[count] = hessian, np.zeros(columns), constraints, upper, lower, sense
        return self._programs[count]


def _skew(arms: np.ndarray) -> np.ndarray:
    """Return the matrices (k, 3, 3) of the cross products with vectors (k, 3)."""
    made = np.zeros((len(arms), 3, 3))
    made[:, 2, 1], made[:, 0, 2], made[:, 1, 0] = arms.T
    made[:, 1, 2], made[:, 2, 0], made[:, 0, 1] = -arms.T
    return made


def _back(rate: float, error: np.ndarray, speed: np.ndarray) -> np.ndarray:
    return rate * rate * error + 2.0 * rate * speed
