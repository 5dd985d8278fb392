"""RobotState: where a robot is and how it moves, at one time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nuno.robot.footing import Footing


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
        over_torque: Names of joints whose motors gave all that they can.
        contacts: By link, the force (3,) [N] of all that touches it, the mean over the last frame, where the robot has
            dynamics; links that nothing touches are not in it.
        loads: (njoints, 6) float [N, N m], what it carries does to each of Pinocchio's joints, in their own frames,
            smoothed: balance reckons with it; None where it carries nothing.
        footing: What its balance goes by: feet that bear, and the step that it makes where it was pushed.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    torques: np.ndarray | None = None
    fallen: str | None = None
    over_torque: tuple[str, ...] = ()
    contacts: Mapping[str, np.ndarray] = field(default_factory=dict)
    loads: np.ndarray | None = None
    footing: Footing | None = None
