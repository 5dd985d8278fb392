"""WholeBodyControl: joint torques that keep a robot on its feet while it follows a motion, by quadratic programming.

Inverse dynamics of the whole body as weighted tasks (Del Prete et al.: "Prioritized motion-force control of constrained
fully-actuated robots", Robotics and Autonomous Systems 63, 2015; Herzog et al., Autonomous Robots 40, 2016). Unknown
are the accelerations of base and joints, and a force at each corner of each sole that stands. The equation of motion
of the base, friction pyramids and effort limits hold exactly; centre of mass, trunk, feet and posture follow their
references as well as they can.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import MissingPackageError
from nuno.robot.aims import Aims
from nuno.robot.foot_kinematics import WORLD_AXES, FootKinematics
from nuno.robot.gravity import take_gravity
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
PROXIMITY = 1e-6
"""Weight of accelerations themselves: what no task asks for stays small."""
EQUAL = 5
"""DAQP's mark of a constraint that is an equality."""


@dataclass(frozen=True, eq=False)
class Gains:
    """Weights of the tasks, and how fast errors are to vanish.

    Attributes:
        centre, trunk, foot, posture, force: Weights, above 0.
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
        take_gravity(self._model, gravity)
        self._data = self._model.createData()
        self._nothing = np.zeros(self._model.nv)
        self.gains = gains or Gains()
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        corners = [EDGE * sole_corners(robot.description.frames[foot]) for foot in robot.description.feet]
        self._corners = np.array(corners).reshape(-1, 4, 3)
        limits = robot.effort_limits
        self._efforts = np.where(np.isfinite(limits) & (limits > 0.0), limits, 1e9)
        chains = [set(robot.model.supports[robot.model.frames[foot].parentJoint]) for foot in self._feet]
        of_legs = {j for chain in chains for j in chain if sum(j in other for other in chains) == 1 and j > 1}
        # feet and trunk say all of where a leg of six joints is
        self._share = np.array([LEGS if n + 2 in of_legs else 1.0 for n in range(len(limits))])
        nv = robot.model.nv
        # of what is wanted, the centre of mass, then trunk and posture, which are velocities themselves, and the feet
        self._weights = np.full(nv + 6 * len(self._feet), self.gains.foot)
        self._rows = np.r_[:3, nv : len(self._weights)]  # whose Jacobians are no rows of the identity
        self._weights[:3], self._weights[3:6] = self.gains.centre, self.gains.trunk
        self._weights[6:nv] = self.gains.posture * self._share
        self._below = np.tril_indices(nv, -1)
        self._programs: dict[int, tuple[np.ndarray, ...]] = {}
        flat = friction / np.sqrt(2.0)
        self._pyramid = np.array([[1.0, 0, -flat], [-1.0, 0, -flat], [0, 1.0, -flat], [0, -1.0, -flat], [0, 0, -1.0]])

    def imagined(self) -> WholeBodyControl:
        """Return the same for copies of the robot."""
        made = copy.copy(self)
        made._model = self._model.copy()
        made._data, made._programs = made._model.createData(), {}
        return made

    def take_gravity(self, gravity: Sequence[float]) -> None:
        """Reckon with a gravity (3,) [m/s2] from now on."""
        take_gravity(self._model, gravity)

    def solve(
        self, now: Sequence[RobotState], motion: FootKinematics, aims: Aims
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
        """Return accelerations of base and joints and torques of the joints, of each world.

        Args:
            now: How the robots move, and what they carry.
            motion: How feet and centres of mass move while velocities stay as they are.
            aims: What is wanted.

        Returns:
            (worlds,) bool, where there are any that fulfil the constraints, accelerations (worlds, nv), and torques
            (worlds, n).
        """
        gains, worlds, nv, feet = self.gains, len(now), self._model.nv, len(self._feet)
        tasks = np.empty((worlds, 3 + 6 * feet, nv))
        errors, mass, bias = np.empty((worlds, nv)), np.empty((worlds, nv, nv)), np.empty((worlds, nv))
        for w, state in enumerate(now):
            self._linearised(state, aims.q[w], tasks[w], mass[w], bias[w], errors[w])
        mass[:, self._below[0], self._below[1]] = mass[:, self._below[1], self._below[0]]
        v, free = np.array([state.v for state in now]), aims.falls_freely
        wanted = np.empty((worlds, len(self._weights)))
        pull = _back(gains.centre_rate, *(aims.centres[:, :2] - motion.centres[:, :2]).swapaxes(0, 1))
        pull[free, :2] = 0.0
        wanted[:, :3] = aims.centres[:, 2] + pull - motion.centres[:, 2]
        turning, spinning = aims.a[:, 3:6].copy(), aims.v[:, 3:6].copy()
        for w in np.flatnonzero(turning.any(axis=1) | spinning.any(axis=1)).tolist():
            across = _matrix(now[w].q).T @ _matrix(aims.q[w])
            turning[w], spinning[w] = across @ turning[w], across @ spinning[w]
        wanted[:, 3:6] = turning + _back(gains.trunk_rate, errors[:, 3:6], spinning - v[:, 3:6])
        wanted[:, 6:nv] = aims.a[:, 6:] + _back(gains.posture_rate, errors[:, 6:], (aims.v - v)[:, 6:])
        wanted[:, nv:] = self._feet_wanted(motion, aims).reshape(worlds, 6 * feet)
        weights = np.tile(self._weights, (worlds, 1))
        weights[free, :2] = gains.catch
        swings = free[:, None] & ~aims.feet.bears
        weights[:, nv:][np.repeat(swings, 6, axis=1)] = gains.swing
        rows = tasks[:, 3:].reshape(worlds, feet, 6, nv)
        arms = _skew(self._corners @ motion.turns.swapaxes(-1, -2))
        touching = rows[:, :, None, :3] - arms @ rows[:, :, None, 3:]  # (worlds, feet, 4, 3, nv)
        # taken, not indexed: products of arrays that lie in memory otherwise have other bits in other numbers of worlds
        roots, goals = (np.take(part, self._rows, axis=1) for part in (np.sqrt(weights), wanted))
        diagonal = np.arange(nv)
        weighed = roots[:, :, None] * tasks
        hessians = weighed.swapaxes(1, 2) @ weighed
        linears = -(weighed.swapaxes(1, 2) @ (roots * goals)[:, :, None])[:, :, 0]
        hessians[:, diagonal, diagonal] += PROXIMITY
        hessians[:, diagonal[3:], diagonal[3:]] += weights[:, 3:nv]
        linears[:, 3:] -= weights[:, 3:nv] * wanted[:, 3:nv]
        return self._minimised(hessians, linears, touching, aims.feet.bears, mass, bias)

    def _linearised(
        self, now: RobotState, q: np.ndarray, tasks: np.ndarray, mass: np.ndarray, bias: np.ndarray, error: np.ndarray
    ) -> None:
        """Fill in rows of the tasks of one world, its masses (upper triangle), forces at rest, and how far q is."""
        model, data = self._model, self._data
        tasks[:3] = pin.jacobianCenterOfMass(model, data, now.q)
        mass[:] = pin.crba(model, data, now.q, pin.Convention.WORLD)
        for k, foot in enumerate(self._feet):
            pin.updateFramePlacement(model, data, foot)
            tasks[3 + 6 * k : 9 + 6 * k] = pin.getFrameJacobian(model, data, foot, WORLD_AXES)
        forced = () if now.loads is None else (pin.StdVec_Force([pin.Force(own) for own in now.loads]),)
        bias[:] = pin.rnea(model, data, now.q, now.v, self._nothing, *forced)
        error[:] = pin.difference(model, now.q, q)

    def _feet_wanted(self, motion: FootKinematics, aims: Aims) -> np.ndarray:
        """Return the accelerations (worlds, feet, 6) of feet beside what the joints' velocities bring about."""
        gains, feet = self.gains, aims.feet
        errors = np.empty(motion.speeds.shape)
        errors[:, :, :3] = feet.places - motion.places
        across = feet.turns @ motion.turns.swapaxes(-1, -2)
        for w, k in np.ndindex(errors.shape[:2]):
            errors[w, k, 3:] = pin.log3(across[w, k])
        tilted = np.abs(errors[:, :, 3:5]).max(axis=2, keepdims=True) > LEVEL
        pull = np.where(tilted, errors * (0, 0, 0, 1, 1, 0), 0.0)
        stand = 4.0 * gains.stand_rate * gains.foot_rate * pull - gains.stand_rate * motion.speeds
        moves = feet.ground.any(axis=(0, 2, 3))
        stand[moves] += feet.ground[1, moves] + gains.stand_rate * feet.ground[0, moves]
        swing = feet.accelerations + _back(gains.foot_rate, errors, feet.speeds - motion.speeds)
        sinking = -gains.stand_rate * (SINKS + motion.speeds[:, :, 2])
        swing[:, :, 2] = np.where(feet.sinks, sinking, swing[:, :, 2])
        return np.where(feet.bears[:, :, None], stand, swing) - motion.accelerations

    def _minimised(
        self, hessians: np.ndarray, linears: np.ndarray, touching: np.ndarray, bears: np.ndarray, mass: np.ndarray,
        bias: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
        """Return the motions and torques that miss the tasks least, as `solve` does."""
        n, each = bias.shape[1], touching.shape[2]
        is_found, motions, efforts = self._unbounded(hessians, linears, touching, bears, mass, bias)
        for w in np.flatnonzero(~is_found).tolist():
            own = bears[w]
            count = each * int(own.sum())
            hessian, linear, constraints, upper, lower, sense = self._program(count)
            hessian[:n, :n], linear[:n], constraints[:n, :n] = hessians[w], linears[w], mass[w]
            if count:
                constraints[:n, n:] = -touching[w, own].reshape(3 * count, n).T
            upper[:6] = lower[:6] = -bias[w, :6]
            upper[6:n], lower[6:n] = self._efforts - bias[w, 6:], -self._efforts - bias[w, 6:]
            # without DAQP's search for directions in which nothing is minimised: there are none
            found, _, flag, _ = daqp.solve(hessian, linear, constraints, upper, lower, sense, eps_prox=0.0)
            if flag > 0:
                is_found[w], motions[w] = True, found[:n]
                efforts[w] = (constraints[:n] @ found + bias[w])[6:]
            else:
                motions[w], efforts[w] = 0.0, 0.0
        return is_found, motions, efforts

    def _unbounded(
        self, hessians: np.ndarray, linears: np.ndarray, touching: np.ndarray, bears: np.ndarray, mass: np.ndarray,
        bias: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
        """Return what `_minimised` does where neither friction nor effort limits bind, and where that is.

        What is least under the base's equation alone, and keeps to all limits, is least under all of them. Of the
        accelerations a, the forces f at the corners and the multipliers y of that equation,

            H a + g + B^T y = 0,    force f = T y,    B a - T^T f = -c

        with B and T the base's columns of the masses and of the corners' motion; so y solves a system of six.
        """
        worlds, n = bias.shape
        corners = np.where(bears[:, :, None, None, None], touching, 0.0).reshape(worlds, -1, n)
        base = mass[:, :6]
        found = np.linalg.solve(hessians, np.concatenate([base.swapaxes(1, 2), linears[:, :, None]], axis=2))
        least, across = found[:, :, 6:], found[:, :, :6]
        moved = corners[:, :, :6]
        system = base @ across + moved.swapaxes(1, 2) @ moved / self.gains.force
        multipliers = np.linalg.solve(system, bias[:, :6, None] - base @ least)
        motions = -(least + across @ multipliers)
        forces = moved @ multipliers / self.gains.force
        borne = mass[:, 6:] @ motions - corners[:, :, 6:].swapaxes(1, 2) @ forces
        efforts = borne[:, :, 0] + bias[:, 6:]
        pressed = forces.reshape(worlds, -1, 3) @ self._pyramid.T
        keeps = (np.abs(efforts) <= self._efforts).all(axis=1) & (pressed <= 0.0).all(axis=(1, 2))
        return keeps, motions[:, :, 0], efforts

    def _program(self, count: int) -> tuple[np.ndarray, ...]:
        """Return the arrays of the quadratic program with so many points that bear.

        What is not the same in every frame is filled in anew by whoever asks.
        """
        if count not in self._programs:
            n = self._model.nv
            rows, columns = n + 5 * count, n + 3 * count
            hessian, constraints = np.zeros((columns, columns)), np.zeros((rows, columns))
            hessian[n:, n:] = self.gains.force * np.eye(3 * count)
            for k in range(count):
                constraints[n + 5 * k : n + 5 * k + 5, n + 3 * k : n + 3 * k + 3] = self._pyramid
            upper, lower, sense = np.zeros(rows), np.full(rows, -1e30), np.zeros(rows, dtype=np.int32)
            sense[:6] = EQUAL
            self._programs[count] = hessian, np.zeros(columns), constraints, upper, lower, sense
        return self._programs[count]


def _skew(arms: np.ndarray) -> np.ndarray:
    """Return the matrices (..., 3, 3) of the cross products with vectors (..., 3)."""
    made, (x, y, z) = np.zeros((*arms.shape, 3)), np.moveaxis(arms, -1, 0)
    made[..., 2, 1], made[..., 0, 2], made[..., 1, 0] = x, y, z
    made[..., 1, 2], made[..., 2, 0], made[..., 0, 1] = -x, -y, -z
    return made


def _back(rate: float, error: np.ndarray, speed: np.ndarray) -> np.ndarray:
    return rate * rate * error + 2.0 * rate * speed


def _matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation matrix (3, 3) of the base in a configuration (nq,)."""
    return np.asarray(pin.Quaternion(q[3:7]).toRotationMatrix())
