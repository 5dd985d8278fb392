"""Balance: the motors of a robot that follows a motion on its feet, frame by frame, and whether it fell."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.link_dynamics import LinkDynamics
from nuno.robot.pinocchio import pin
from nuno.robot.robot_state import RobotState
from nuno.robot.whole_body import Gains, WholeBodyControl

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.servo import Servo

logger = logging.getLogger(__name__)

STANDS = 1e-3
"""[m] Above the lowest sole of the wanted posture, up to which a foot is to bear."""
LEANS = np.cos(np.deg2rad(60.0))
"""Of the trunk's tilt, from where on a robot has fallen."""
SINKS = 0.5
"""Share of the height of the wanted base, below which a robot has fallen."""
FULL = 0.999
"""Share of its limit, from where on a motor gives all that it can."""


class Balance:
    """Dynamics of a robot's links, and the control that keeps it on its feet.

    In each frame `WholeBodyControl` finds the joints' torques; the motors exert them and keep softly to the velocities
    that follow. A robot without feet, one that fell, and joints under a servo command have motors alone. What falls is
    told once, as a warning.

    Args:
        links: One body for each joint.
        friction: Coulomb's coefficient of the links' surfaces.
        gains: Of the whole-body control.

    Attributes:
        links: Bodies and motors.
        fallen: Why and when the robot fell, None while it stands.
    """

    def __init__(self, links: Links, *, friction: float = 0.8, gains: Gains | None = None) -> None:
        robot = links.robot
        self.dynamics = LinkDynamics(links, friction=friction)
        self._robot, self._world = robot, links.world
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        self._control = WholeBodyControl(robot, links.world.gravity, friction=friction, gains=gains)
        self._data = robot.model.createData()
        self.fallen: str | None = None
        self.over_torque: tuple[str, ...] = ()

    def attach(self) -> None:
        """Give the links dynamics; see ``LinkDynamics.attach``."""
        self.dynamics.attach()
        self.fallen, self.over_torque = None, ()

    def begin(
        self, now: RobotState, wanted: RobotState, span: float, servo: Servo | None, external: Any = None
    ) -> None:
        """Set the motors for a frame.

        Args:
            now: How the robot moves.
            wanted: How it is to move at the end of the frame.
            span: [s] of the frame.
            servo: A torque law that some joints are under, or None.
            external: What bodies that the links hold do to them, as Pinocchio takes it, or None.
        """
        dynamics, robot = self.dynamics, self._robot
        found = None
        if self._feet and self.fallen is None:
            found = self._control.solve(now, wanted, self._standing(wanted.q), external)
        if found is None:
            model = dynamics.stiffness, dynamics.damping, np.zeros(len(dynamics.joints))
            goal = robot.angles_of(wanted.q), wanted.v[6:]
        else:
            acceleration, effort = found
            speed = now.v[6:]
            model = (*dynamics.soft, effort)
            goal = robot.angles_of(now.q) + span * speed, speed + 0.5 * span * acceleration[6:]
        values = [np.array(part) for part in (*goal, *model)]
        if servo is not None:
            command: Any = servo.command
            given = (command.q, command.dq, np.maximum(command.kp, 1e-9), command.kd, command.tau)
            for part, own in zip(values, given, strict=True):
                part[servo.rows] = own
        dynamics.drive(*values)

    def end(self, before: RobotState, wanted: RobotState, time: float) -> RobotState:
        """Return how the robot moves after a frame, and look whether it fell."""
        q, v = self.dynamics.read()
        torques = self.dynamics.efforts_now()
        span = time - before.time
        a = (v - before.v) / span if span > 0.0 else np.zeros_like(v)
        full = np.abs(torques) >= FULL * self.dynamics.efforts
        self.over_torque = tuple(name for name, is_full in zip(self._robot.joint_names, full, strict=True) if is_full)
        if self.fallen is None and self._feet:
            up = 1.0 - 2.0 * (q[3] ** 2 + q[4] ** 2)
            ground = self._ground(wanted.q)
            why = ""
            if up < LEANS:
                why = f"its trunk leans by {np.rad2deg(np.arccos(np.clip(up, -1.0, 1.0))):.0f} degrees"
            elif q[2] - ground < SINKS * (wanted.q[2] - ground):
                why = f"its base is {q[2] - ground:.2f} m above its feet's ground"
            if why:
                self.fallen = f"{why} at t = {time:.2f} s"
                logger.warning("%r fell: %s; robot.set_up() stands it up again", self._robot.name, self.fallen)
        return RobotState(time, q, v, a, torques, self.fallen, self.over_torque)

    def save(self) -> tuple[Any, ...]:
        """Return all that it is besides what the world saves, for ``load``."""
        return self.dynamics.joints, self.fallen, self.over_torque

    def load(self, saved: tuple[Any, ...]) -> None:
        """Become what it was."""
        self.dynamics.joints, self.fallen, self.over_torque = saved

    def _soles(self, q: np.ndarray) -> np.ndarray:
        """Return the heights of the soles' middles [m] in a configuration."""
        pin.forwardKinematics(self._robot.model, self._data, q)
        pin.updateFramePlacements(self._robot.model, self._data)
        return np.array([self._data.oMf[foot].translation[2] for foot in self._feet])

    def _ground(self, q: np.ndarray) -> float:
        return float(self._soles(q).min())

    def _standing(self, q: np.ndarray) -> tuple[bool, ...]:
        heights = self._soles(q)
        return tuple(bool(height < heights.min() + STANDS) for height in heights)
