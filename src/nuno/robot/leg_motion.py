"""Leg motion: the configurations that bring feet, centre of mass and base where they are wanted, tick after tick.

Of a robot whose other joints are given, the base and two legs of six joints have as many degrees of freedom as two
feet (12), the orientation of the base (3) and the centre of mass (3) ask for: each tick is a few Newton steps on a
square system, from a guess that continues the motion. With more joints the steps are the least ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import RobotModelError, WalkError
from nuno.robot.pinocchio import pin
from nuno.robot.preview_control import TICK
from nuno.robot.stride import two_feet

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

NEWTON_STEPS = 12
SMALL = 3e-5
"""[m, rad] After a Newton step as small as this the error is of its square, 1e-9: accelerations by differences over
5 ms are then exact to 1e-4 m/s2."""
LONGEST_STEP = 0.1
"""[rad] A longer Newton step of a leg means that it is stretched: there is no exact solution near."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Targets of the legs over n ticks.

    Attributes:
        feet: (n, 2, 4) float, x, y, z [m] and yaw [rad] of the soles, which are level.
        centre: (n, 3) float, of mass [m].
        base: (n, 3, 3) float, rotation of the base link.
        others: (n, k) float, the joints that are not of the legs, Pinocchio's coordinates.
    """

    feet: np.ndarray
    centre: np.ndarray
    base: np.ndarray
    others: np.ndarray

    @cached_property
    def turns(self) -> np.ndarray:
        """(n, 2, 3, 3) float, rotations of the soles."""
        yaw = self.feet[..., 3]
        found = np.zeros((*yaw.shape, 3, 3))
        found[..., 0, 0] = found[..., 1, 1] = np.cos(yaw)
        found[..., 1, 0] = np.sin(yaw)
        found[..., 0, 1] = -found[..., 1, 0]
        found[..., 2, 2] = 1.0
        return found


class LegMotion:
    """A robot's legs.

    Args:
        robot: The robot.
        model: Its model, with what it carries.

    Attributes:
        legs: Rows of the legs' joints in a velocity (nv,).
        others: Rows of all other joints in a configuration (nq,).

    Raises:
        RobotModelError: it has not two legs of at least six joints each.
    """

    def __init__(self, robot: Humanoid, model: Any) -> None:
        self.model, self.data = model, model.createData()
        self.frames = [robot.frame_index(foot) for foot in two_feet(robot)]
        self.joints = [model.frames[frame].parentJoint for frame in self.frames]
        chains = [[j for j in model.supports[joint] if j >= 2] for joint in self.joints]
        legs = [j for j in range(2, model.njoints) if (j in chains[0]) != (j in chains[1])]
        if min(len(chain) for chain in chains) < 6 or len(legs) < 12:
            raise RobotModelError(f"walking needs two legs of six joints, those of {robot.name!r} have fewer")
        self.legs = np.array([model.joints[j].idx_v for j in legs])
        self.leg_rows = np.array([model.joints[j].idx_q for j in legs])
        self.others = np.setdiff1d(np.arange(7, model.nq), self.leg_rows)
        self._columns = np.concatenate([np.arange(6), self.legs])
        self._jacobian = np.zeros((18, len(self._columns)))
        self._jacobian[12:15, 3:6] = np.eye(3)
        self._error = np.zeros(18)
        self._step = np.zeros(model.nv)

    def follow(self, targets: Targets, q: np.ndarray, near: np.ndarray | None = None, begin: float = 0.0) -> np.ndarray:
        """Return the configurations (n, nq) that keep the targets.

        Args:
            targets: What is wanted.
            q: (nq,) near the first.
            near: (n, nq), solutions for targets that differ by little; None guesses from the ticks before.
            begin: Time of the first tick [s], for the error.

        Raises:
            WalkError: a leg cannot reach.
        """
        follower = LegFollower(self, targets, q, near, begin)
        for _ in range(len(targets.centre)):
            follower.step()
        return follower.found

    def solve(self, targets: Targets, k: int, q: np.ndarray, begin: float) -> np.ndarray:
        """Return the configuration (nq,) of tick ``k``, from a guess; raises as ``follow``."""
        error = np.inf
        for _ in range(NEWTON_STEPS):
            error = self._linearise(targets, k, q)
            if self._jacobian.shape[0] == self._jacobian.shape[1]:
                try:
                    step = np.linalg.solve(self._jacobian, self._error)
                except np.linalg.LinAlgError:
                    break
            else:
                step = np.linalg.lstsq(self._jacobian, self._error, rcond=None)[0]
            max_step = np.abs(step).max()
            if not np.isfinite(max_step):
                break
            self._step[self._columns] = step * min(1.0, LONGEST_STEP / max(max_step, 1e-12))
            q = pin.integrate(self.model, q, self._step)
            if max_step < SMALL:
                return q
        time = begin + k * TICK
        raise WalkError(
            f"the legs do not reach at {time:.2f} s, {1000.0 * error:.1f} mm or mrad are missing: shorter steps, or a "
            "lower stance (more bent knees) help", time=time,
        )  # fmt: skip

    def _linearise(self, targets: Targets, k: int, q: np.ndarray) -> float:
        """Set errors and Jacobian of one configuration, and return the largest error."""
        model, data = self.model, self.data
        jacobian, error = self._jacobian, self._error
        of_centre = pin.jacobianCenterOfMass(model, data, q)
        for i, frame in enumerate(self.frames):
            place = pin.updateFramePlacement(model, data, frame)
            goal = pin.SE3(targets.turns[k, i], targets.feet[k, i, :3])
            error[6 * i : 6 * i + 6] = pin.log6(place.actInv(goal)).vector
            jacobian[6 * i : 6 * i + 6] = pin.getFrameJacobian(model, data, frame, pin.LOCAL)[:, self._columns]
        error[12:15] = pin.log3(data.oMi[1].rotation.T @ targets.base[k])
        error[15:] = targets.centre[k] - data.com[0]
        jacobian[15:] = of_centre[:, self._columns]
        return float(np.abs(error).max())


class LegFollower:
    """The configurations that keep targets, tick after tick; each guess continues the motion before it.

    Args:
        legs: The legs.
        targets: What is wanted; ticks that are not reached yet may still be changed.
        q: (nq,) near the first.
        near: (n, nq), solutions for targets that differ by little; None guesses from the ticks before.
        begin: Time of the first tick [s], for the error.

    Attributes:
        found: (n, nq) float, of which the first ``count`` are known.
        count: How many ticks are known.
    """

    def __init__(
        self, legs: LegMotion, targets: Targets, q: np.ndarray, near: np.ndarray | None = None, begin: float = 0.0
    ) -> None:
        self._legs, self._targets, self._near, self._begin, self._first = legs, targets, near, begin, q
        self.found = np.empty((len(targets.centre), legs.model.nq))
        self.count = 0
        # how guesses for a tick and the one before it differ from the base of them
        self._ahead = self._before = np.zeros(legs.model.nv)

    def step(self) -> None:
        """Find the next tick.

        Raises:
            WalkError: a leg cannot reach.
        """
        k, model, near, found = self.count, self._legs.model, self._near, self.found
        origin = self._first if k == 0 else found[k - 1] if near is None else near[k]
        guess = pin.integrate(model, origin, 2.0 * self._ahead - self._before if k > 2 else self._ahead)  # second order
        guess[self._legs.others] = self._targets.others[k]
        found[k] = self._legs.solve(self._targets, k, guess, self._begin)
        self._before = self._ahead
        if near is not None:
            self._ahead = pin.difference(model, near[k], found[k])
        elif k > 0:
            self._ahead = pin.difference(model, found[k - 1], found[k])
        self.count = k + 1


def feet_put_down(robot: Humanoid, q: np.ndarray) -> np.ndarray:
    """Return a configuration (nq,) near another, in which the soles are level, at one height and where they were.

    The centre of mass is over the middle between them. Where the legs do not reach so, it is the other configuration.
    """
    model, legs = robot.model, LegMotion(robot, robot.model)
    data = legs.data
    pin.forwardKinematics(model, data, q)
    soles = [pin.updateFramePlacement(model, data, frame).copy() for frame in legs.frames]
    yaw = [float(np.arctan2(own.rotation[1, 0], own.rotation[0, 0])) for own in soles]
    floor = float(np.mean([own.translation[2] for own in soles]))
    feet = np.array([[*own.translation[:2], floor, turn] for own, turn in zip(soles, yaw, strict=True)])
    centre = np.array(pin.centerOfMass(model, data, q))
    centre[:2] = feet[:, :2].mean(axis=0)
    upright = pin.rpy.matrixToRpy(data.oMi[1].rotation)
    base = pin.rpy.rpyToMatrix(0.0, float(upright[1]), float(upright[2]))
    targets = Targets(feet[None], centre[None], base[None], q[legs.others][None])
    try:
        return legs.solve(targets, 0, q.copy(), 0.0)
    except WalkError:
        return q
