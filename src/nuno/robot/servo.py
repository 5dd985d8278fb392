"""Servo commands, the lowest level of a driver: a torque law for each joint, and what joints do under it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dgesv

from nuno.errors import InvalidInputError
from nuno.robot.gravity import take_gravity
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.trajectory import joint_names
from nuno.validation import finite_array

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.robot.loads import Load

PERIOD = 1e-3
"""[s] Between two evaluations of the torque law: low-level drivers run at 500 to 1000 Hz."""


@dataclass(frozen=True, eq=False)
class ServoCommand:
    """The torque law of some joints' motors from now on: tau + kp (q - angle) + kd (dq - velocity).

    All but the names are (m,) or one number for all joints.

    Attributes:
        names: Of the joints, m of them, each once.
        q: Where they are wanted [rad; m for slides].
        dq: How fast [rad/s; m/s].
        tau: Torque or force besides [N m; N].
        kp: At least 0 [N m/rad; N/m].
        kd: At least 0 [N m s/rad; N s/m].

    Raises:
        InvalidInputError: no joints or one twice, not finite, another length, or a negative gain.
    """

    names: tuple[str, ...]
    q: ArrayLike
    dq: ArrayLike = 0.0
    tau: ArrayLike = 0.0
    kp: ArrayLike = 0.0
    kd: ArrayLike = 0.0

    def __post_init__(self) -> None:
        names = joint_names(self.names)
        if not names or len(set(names)) < len(names) or not all(isinstance(name, str) for name in names):
            raise InvalidInputError(f"a servo command needs names of joints, each once, got {self.names!r}")
        object.__setattr__(self, "names", names)
        for what in ("q", "dq", "tau", "kp", "kd"):
            value = finite_array(what, getattr(self, what), (), (len(names),))
            if what in ("kp", "kd") and (value < 0.0).any():
                raise InvalidInputError(f"{what} must be at least 0, got {value.tolist()}")
            value = np.array(np.broadcast_to(value, (len(names),)))
            value.setflags(write=False)
            object.__setattr__(self, what, value)


class Servo:
    """Joints under a servo command, of a robot whose other joints and base move as they are told.

    Every ``PERIOD`` the equation of motion is solved for the joints' accelerations, torques clipped to the effort
    limits. The law's stiffness and damping are taken at the end of the period (implicit Euler), so that any gains are
    stable, as they are on motors whose own controllers are much faster. Joints stop at their position limits.

    Limitations: what the joints' motion does to the base is left out, as if it were held; motors have no inertia or
    friction but what the model says; loads from the world stay as they are during a frame.

    Args:
        robot: The robot.
        command: The command.
        gravity: (3,) [m/s2].

    Raises:
        UnknownNameError: no joint of that name.
    """

    def __init__(self, robot: Humanoid, command: ServoCommand, gravity: Sequence[float] = (0.0, 0.0, -9.81)) -> None:
        self.command = command
        self.rows = np.array([robot.joint_index(name) for name in command.names], dtype=int)
        self._robot = robot
        self._model = robot.model.copy()
        self.take_gravity(gravity)
        self._data = self._model.createData()
        self._columns = self.rows + 6
        # of Pinocchio's inertia matrix only the upper half is filled
        self._upper = np.minimum.outer(self._columns, self._columns), np.maximum.outer(self._columns, self._columns)
        self._diagonal = np.diag_indices(len(self.rows))
        lower, upper = robot.joint_limits
        self._limits = lower[self.rows], upper[self.rows]
        self._effort = robot.effort_limits[self.rows]

    def take_gravity(self, gravity: Sequence[float]) -> None:
        """Reckon with a gravity (3,) [m/s2] from now on."""
        take_gravity(self._model, gravity)

    def step(
        self, before: RobotState, others: tuple[np.ndarray, np.ndarray, np.ndarray], base: np.ndarray | None,
        duration: float, external: Any = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
        """Return positions, velocities and accelerations (m,) of the joints ``duration`` [s] later.

        Args:
            before: How the robot moves now.
            others: Positions, velocities and accelerations (n,) that the other joints have then.
            base: Configuration (7,) that the base has then, None where it stays.
            duration: [s].
            external: Forces on the joints in their own frames, as Pinocchio takes them, or None.
        """
        model, data, robot, columns, rows = self._model, self._data, self._robot, self._columns, self.rows
        start = robot.angles_of(before.q)
        count = max(1, math.ceil(duration / PERIOD - 1e-9))
        dt = duration / count
        way = (others[0] - start) / duration
        v, a = before.v.copy(), np.zeros(model.nv)
        v[6:], a[6:] = way, others[2]
        own, speed = start[rows], before.v[columns].copy()
        v[columns], a[columns] = speed, 0.0
        acceleration = np.zeros(len(rows))
        command: Any = self.command
        stiff = command.kp * dt**2 + command.kd * dt
        end = before.q[:7] if base is None else base
        for k in range(count):
            angles = start + way * (k * dt)
            angles[rows] = own
            q = robot.configuration_of(angles, before.q[:7] if k < count // 2 else end)
            v[columns] = speed
            needed = pin.rnea(model, data, q, v, a) if external is None else pin.rnea(model, data, q, v, a, external)
            inertia = pin.crba(model, data, q, pin.Convention.WORLD)[self._upper]
            acceleration = self._accelerations(inertia, needed[columns], own, speed, dt, stiff)
            speed = speed + dt * acceleration
            own = own + dt * speed
            stopped = (own < self._limits[0]) | (own > self._limits[1])
            if stopped.any():
                own = np.clip(own, *self._limits)
                speed[stopped] = 0.0
        return own, speed, acceleration

    def _accelerations(
        self, inertia: np.ndarray, bias: np.ndarray, q: np.ndarray, v: np.ndarray, dt: float, stiff: np.ndarray
    ) -> np.ndarray:
        own: Any = self.command
        # tau(end of the period) = now - stiff a, with stiff = kp dt^2 + kd dt: the joint moves on by dt (v + dt a)
        now = own.tau + own.kp * (own.q - q - dt * v) + own.kd * (own.dq - v)
        found = self._solve(inertia, stiff, now - bias)
        torque = now - stiff * found
        over = np.abs(torque) > self._effort
        if over.any():
            now = np.where(over, np.clip(torque, -self._effort, self._effort), now)
            found = self._solve(inertia, np.where(over, 0.0, stiff), now - bias)
        return found

    def _solve(self, inertia: np.ndarray, more: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Return the accelerations (m,) under torques ``right``, with ``more`` on the diagonal of the inertia."""
        matrix = inertia.copy()
        matrix[self._diagonal] += more
        # LAPACK itself: at seven joints NumPy's solve takes longer around it than in it
        return np.asarray(dgesv(matrix, right)[2])


def external_forces(links: Links, loads: Sequence[Load], placements: Any) -> Any:
    """Return what loads do to each joint, in the joints' own frames, which have Pinocchio's placements."""
    found = pin.StdVec_Force()
    for _ in range(links.robot.model.njoints):
        found.append(pin.Force.Zero())
    for load in loads:
        joint = links.joints[load.link]
        torque = load.torque + np.cross(load.point, load.force)
        found[joint] += placements[joint].actInv(pin.Force(load.force, torque))
    return found
