"""RobotState: where a robot is and how it moves, at one time; RobotStates: that of all its copies, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.collision import Collision, Unbalance
from nuno.robot.footing import Footing

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

Contacts = Mapping[str, Mapping[str, np.ndarray]]
"""By link and by the name of the other body, the force (3,) [N] on the link."""


@dataclass(frozen=True, eq=False)
class RobotState:
    """A robot's configuration and motion, in Pinocchio's coordinates with the free base first.

    Attributes:
        time: [s], of the world.
        q: (nq,) float, configuration: position [m] and quaternion (x, y, z, w) of the base, then the joints.
        v: (nv,) float, velocity: of the base in its own frame [m/s, rad/s], then the joints' [rad/s].
        a: (nv,) float, acceleration likewise, that of the base without gravity.
        torques: (n,) float [N m; N], of the joints' motors, where the robot has dynamics; None else.
        fallen: Why and when the robot fell, where it has dynamics and did; None else.
        over_torque: Names of joints whose motors gave all that they can; of a robot without dynamics those that would
            need more than that, by inverse dynamics with all that the links bear.
        unbalanced: Of a robot without dynamics, that its zero moment point is not under its soles; None where it is.
        collision: Of a robot without dynamics, what its motion would run into, or was stopped by; None for nothing.
        loads: (joints, 6) float [N, N m], what the robot carries does to Pinocchio's joints, in their own frames,
            smoothed: balance reckons with it. None without dynamics, and where it carries nothing.
        contacts: Where the robot has dynamics, what touched each link: by link and by the other body's name, the force
            (3,) [N] on the link in the world's axes, the mean over the last frame.
        joint_wrenches: (n, 6) float [N, N m], where the robot has dynamics, force and torque of what each joint carries
            on the link before, about the joint and in the world's axes, the mean over the last frame; None else.
        footing: What its balance goes by: feet that bear, and the step that it makes where it was pushed.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    torques: np.ndarray | None = None
    fallen: str | None = None
    over_torque: tuple[str, ...] = ()
    unbalanced: Unbalance | None = None
    collision: Collision | None = None
    loads: np.ndarray | None = None
    contacts: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    joint_wrenches: np.ndarray | None = None
    footing: Footing | None = None

    @staticmethod
    def moving(time: float, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> RobotState:
        """Return a state of which nothing else is known yet; in a third of the time, as one is made in every frame."""
        state = object.__new__(RobotState)  # the other fields' defaults are the class's
        state.__dict__.update(time=time, q=q, v=v, a=a, contacts={})
        return state

    def judged(
        self, over_torque: tuple[str, ...], unbalanced: Unbalance | None, collision: Collision | None
    ) -> RobotState:
        """Return the same state with what was found of it."""
        state = object.__new__(RobotState)
        state.__dict__.update(self.__dict__)
        state.__dict__.update(over_torque=over_torque, unbalanced=unbalanced, collision=collision)
        return state


@dataclass(frozen=True, eq=False)
class RobotStates:
    """Configurations and motions of a robot's copies, as arrays over worlds.

    Attributes:
        time: [s], of the batch.
        base: (worlds, 7) float, position [m] and quaternion (w, x, y, z) of the base link.
        base_velocity: (worlds, 6) float, of the base in its own frame [m/s, rad/s].
        base_acceleration: (worlds, 6) float, likewise, without gravity [m/s2, rad/s2].
        positions: (worlds, n) float [rad; m for slides], of the joints in the order of ``joint_names``.
        velocities: (worlds, n) float [rad/s; m/s].
        accelerations: (worlds, n) float [rad/s2; m/s2].
        torques: (worlds, n) float [N m; N], of the motors of a robot with dynamics; NaN else.
        fallen: (worlds,) bool, whether a robot with dynamics fell.
        over_torque: (worlds, n) bool, which motors gave all that they can.
        collided: (worlds,) bool, whether the motion of a robot without dynamics was stopped, or would run into
            something.
    """

    time: float
    base: np.ndarray
    base_velocity: np.ndarray
    base_acceleration: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray
    torques: np.ndarray
    fallen: np.ndarray
    over_torque: np.ndarray
    collided: np.ndarray

    @staticmethod
    def of(states: Sequence[RobotState], robot: Humanoid) -> RobotStates:
        """Return the states of a robot's copies as arrays.

        Args:
            states: One of each world, at the same time.
            robot: The robot.
        """
        q, v, a = (np.array([getattr(own, name) for own in states]) for name in ("q", "v", "a"))
        names = robot.joint_names
        unknown = np.full(len(names), np.nan)
        return RobotStates(
            states[0].time,
            q[:, [0, 1, 2, 6, 3, 4, 5]],
            v[:, :6],
            a[:, :6],
            robot.angles_of(q),
            v[:, 6:],
            a[:, 6:],
            np.array([unknown if own.torques is None else own.torques for own in states]),
            np.array([own.fallen is not None for own in states]),
            np.array([[name in own.over_torque for name in names] for own in states]),
            np.array([own.collision is not None for own in states]),
        )
