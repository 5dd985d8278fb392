"""RobotState: where a robot is and how it moves, at one time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nuno.robot.collision import Collision, Unbalance


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
