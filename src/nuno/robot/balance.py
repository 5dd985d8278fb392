"""Balance: the motors of a robot that follows a motion on its feet, frame by frame, and whether it fell."""

from __future__ import annotations

import copy
import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.carried import Carried, carried_by, smoothed
from nuno.robot.link_dynamics import LinkDynamics
from nuno.robot.robot_state import Contacts, RobotState
from nuno.robot.stabiliser import Stabiliser
from nuno.robot.whole_body import Gains, WholeBodyControl

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.servo import Servo
    from nuno.world.world import World

logger = logging.getLogger(__name__)

LEANS = np.cos(np.deg2rad(60.0))
"""Of the trunk's tilt, from where on a robot has fallen."""
SINKS = 0.5
"""Share of the height of the wanted base, below which a robot has fallen."""
SURE = 0.75
"""Share of the soles' friction that balance counts on: floors may have less."""
NEARS = 0.2
"""[s] In which a motor that overcomes friction is to come to where its joint is wanted."""
FULL = 0.999
"""Share of its limit, from where on a motor gives all that it can."""


class Balance:
    """Dynamics of a robot's links, and the control that keeps it on its feet.

    In each frame `WholeBodyControl` finds the joints' torques; the motors exert them and keep softly to the velocities
    that follow. A robot without feet, one that fell, and joints under a servo command have motors alone. A fall is
    reported once, as a warning.

    Args:
        links: One body for each joint.
        friction: Coulomb's coefficient of the links' surfaces.
        gains: Of the whole-body control.

    Attributes:
        dynamics: Bodies and motors.
        is_on: Whether the robot balances; else its motors hold the joints where they are wanted, and it may fall.
    """

    def __init__(self, links: Links, *, friction: float = 0.8, gains: Gains | None = None) -> None:
        robot = links.robot
        self.dynamics = LinkDynamics(links, friction=friction)
        self._robot, self._world = robot, links.world
        feet = [robot.frame_index(foot) for foot in robot.description.feet]
        joints = [robot.model.frames[foot].parentJoint for foot in feet]
        self._foot_links = [links.names[links.joints.index(joint)] for joint in joints]
        self._control = WholeBodyControl(robot, links.world.gravity, friction=SURE * friction, gains=gains)
        self._data = robot.model.createData()
        self._stabiliser = Stabiliser(robot, links.world.gravity) if feet else None
        self._warns = True
        self.is_on = True

    def command(self, now: RobotState, wanted: RobotState, span: float, servo: Servo | None) -> list[np.ndarray]:
        """Return what the motors are told for a frame: positions, velocities, stiffness, damping and effort (n,) each.

        Args:
            now: How the robot moves.
            wanted: How it is to move at the end of the frame.
            span: [s] of the frame.
            servo: A torque law that some joints are under, or None.
        """
        dynamics, robot = self.dynamics, self._robot
        found = None
        if self.is_on and self._stabiliser is not None and now.fallen is None:
            found = self._control.solve(now, self._stabiliser.aims(now, wanted, now.time + span), now.loads)
        if found is None:
            gains = dynamics.stiffness, dynamics.damping, np.zeros(len(dynamics.joints))
            goal = robot.angles_of(wanted.q), wanted.v[6:]
        else:
            acceleration, effort = found
            speed = now.v[6:]
            goes = speed + 0.5 * span * acceleration[6:]
            error = robot.angles_of(wanted.q) - robot.angles_of(now.q)
            gains = (*dynamics.soft, effort + dynamics.overcome(wanted.v[6:] + error / NEARS))
            goal = robot.angles_of(now.q) + span * speed, goes
        values = [np.array(part) for part in (*goal, *gains)]
        if servo is not None:
            law: Any = servo.command
            given = (law.q, law.dq, np.maximum(law.kp, 1e-9), law.kd, law.tau)
            for part, own in zip(values, given, strict=True):
                part[servo.rows] = own
        return values

    def judge(
        self, before: RobotState, wanted: RobotState, q: np.ndarray, v: np.ndarray, torques: np.ndarray,
        contacts: Contacts, wrenches: np.ndarray, loads: np.ndarray | None, time: float,
    ) -> RobotState:  # fmt: skip
        """Return the state of a robot that moves so after a frame: whether it fell, and which motors give all.

        Args:
            before: Its state when the frame began.
            wanted: How it was to move.
            q: (nq,) where it is.
            v: (nv,) how it moves.
            torques: (n,) of its motors [N m; N].
            contacts: Forces on its links.
            wrenches: (n, 6) [N, N m], what its joints bore, as ``RobotState.joint_wrenches``.
            loads: (njoints, 6) [N, N m], what it carries did to the joints, in their own frames; None for nothing.
            time: [s].
        """
        span, fallen = time - before.time, before.fallen
        a = (v - before.v) / span if span > 0.0 else np.zeros_like(v)
        full = np.abs(torques) >= FULL * self.dynamics.efforts
        over = tuple(name for name, is_full in zip(self._robot.joint_names, full, strict=True) if is_full)
        footing, stabiliser = None, self._stabiliser
        if fallen is None and stabiliser is not None:
            up = 1.0 - 2.0 * (q[3] ** 2 + q[4] ** 2)
            ground = stabiliser.ground(wanted.q)
            why = ""
            if up < LEANS:
                why = f"its trunk leans by {np.rad2deg(np.arccos(np.clip(up, -1.0, 1.0))):.0f} degrees"
            elif q[2] - ground < SINKS * (wanted.q[2] - ground):
                why = f"its base is {q[2] - ground:.2f} m above its feet's ground"
            if why:
                fallen = f"{why} at t = {time:.2f} s"
                if self._warns:
                    logger.warning("%r fell: %s; robot.set_up() stands it up again", self._robot.name, fallen)
        if fallen is None and stabiliser is not None and self.is_on and span > 0.0:
            pressed = np.array([sum(f[2] for f in contacts.get(link, {}).values()) for link in self._foot_links])
            load = self.load(before)
            footing = stabiliser.footing(before, wanted, q, v, pressed, time, load)
        return RobotState(
            time, q, v, a, torques, fallen, over, loads=smoothed(before.loads, loads, span), contacts=contacts,
            joint_wrenches=wrenches, footing=footing,
        )  # fmt: skip

    def load(self, state: RobotState) -> Carried | None:
        """Return what a robot carries."""
        gravity = float(np.linalg.norm(self._world.gravity))
        return carried_by(self._robot, self._data, state.q, state.loads, gravity)

    def ended(self, span: float) -> list[tuple[Any, Any, Any, Any, Any, Any]]:
        """Return q, v, torques, contacts, joint wrenches and loads after a frame of ``span`` [s], of each world."""
        dynamics = self.dynamics
        q, v = dynamics.read()
        contacts, wrenches, efforts = dynamics.felt(span)
        loads = dynamics.loads([dynamics.pressing(own, self._foot_links) for own in contacts])
        return list(zip(q, v, efforts, contacts, wrenches, loads, strict=True))

    def imagined(self, world: World) -> Balance:
        """Return the same for the copies of the links in a batch that was imagined from their world."""
        made = copy.copy(self)
        made.dynamics, made._warns = self.dynamics.imagined(world), False
        return made
