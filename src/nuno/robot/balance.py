"""Balance: the motors of a robot that follows a motion on its feet, frame by frame, and whether it fell.

A robot in its own world is the batch of one: the control of all copies goes through a frame as arrays over worlds.
"""

from __future__ import annotations

import copy
import logging
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.carried import Carried, carried_by, smoothed
from nuno.robot.footing import Footing
from nuno.robot.link_dynamics import LinkDynamics
from nuno.robot.moving_ground import at_rest, earlier_ride, moving_grounds, rides_on
from nuno.robot.ride import Ride
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
        self._robot = robot
        feet = [robot.frame_index(foot) for foot in robot.description.feet]
        joints = [robot.model.frames[foot].parentJoint for foot in feet]
        self._foot_links = [links.names[links.joints.index(joint)] for joint in joints]
        self._control = WholeBodyControl(robot, links.world.gravity, friction=SURE * friction, gains=gains)
        self._data = robot.model.createData()
        self._stabiliser = Stabiliser(robot, links.world.gravity) if feet else None
        self._warns = True
        self.is_on = True

    def command(
        self, now: Sequence[RobotState], wanted: Sequence[RobotState], span: float, servo: Servo | None
    ) -> tuple[np.ndarray, ...]:
        """Return what motors are told for a frame: positions, velocities, stiffness, damping, effort, (worlds, n) each.

        Args:
            now: How the robot moves, in each world.
            wanted: How it is to move at the end of the frame.
            span: [s] of the frame.
            servo: A torque law that some joints are under, or None.
        """
        dynamics, worlds, stabiliser = self.dynamics, len(now), self._falling()
        angles = self._robot.angles_of(np.array([own.q for own in wanted]))
        rates = np.array([own.v[6:] for own in wanted])
        values = [angles, rates, *(np.tile(own, (worlds, 1)) for own in (dynamics.stiffness, dynamics.damping))]
        values.append(np.zeros(angles.shape))
        hangs = dynamics.hangs(worlds)  # by a hoist, say, which bears its weight: it has nothing to stand on
        standing = [
            w for w, own in enumerate(now)
            if own.fallen is None and not (hangs[w] and own.contacts.keys().isdisjoint(self._foot_links))
        ]  # fmt: skip
        if self.is_on and stabiliser is not None and standing:
            states, end = [now[w] for w in standing], now[0].time + span
            rides = self._rides(states, standing, end)
            motion = stabiliser.actual([own.q for own in states], [own.v for own in states])
            aims = stabiliser.aims(states, _carried([wanted[w] for w in standing], rides), end, rides)
            found, *solved = self._control.solve(states, motion, aims)
            who, (accelerations, efforts) = np.array(standing)[found], (own[found] for own in solved)
            speeds = np.array([own.v[6:] for own in states])[found]
            present = self._robot.angles_of(np.array([own.q for own in states]))[found]
            error = angles[who] - present
            effort = efforts + dynamics.overcome(rates[who] + error / NEARS)
            goal = present + span * speeds, speeds + 0.5 * span * accelerations[:, 6:]
            for part, own in zip(values, (*goal, *dynamics.soft, effort), strict=True):
                part[who] = own
        if servo is not None:
            law: Any = servo.command
            given = (law.q, law.dq, np.maximum(law.kp, 1e-9), law.kd, law.tau)
            for part, own in zip(values, given, strict=True):
                part[:, servo.rows] = own
        return tuple(values)

    def judge(
        self, before: Sequence[RobotState], wanted: Sequence[RobotState], ended: Sequence[tuple[Any, ...]], time: float
    ) -> list[RobotState]:  # fmt: skip
        """Return the states of a robot after a frame, of each world: whether it fell, and which motors give all.

        Args:
            before: Its states when the frame began.
            wanted: How it was to move.
            ended: How it moves and what it felt, as the method of that name returns it.
            time: [s].
        """
        q, v, torques, contacts, wrenches, loads = ([*own] for own in zip(*ended, strict=True))
        fallen, stabiliser = [own.fallen for own in before], self._falling()
        footings: list[Footing | None] = [None] * len(before)
        standing = [w for w, why in enumerate(fallen) if why is None and stabiliser is not None]
        if stabiliser is not None and standing:
            states = [before[w] for w in standing]
            rides = dict(zip(standing, self._rides(states, standing, time), strict=True))
            wanted = _carried(wanted, [rides.get(w) for w in range(len(before))])
            grounds = stabiliser.grounds(states, [wanted[w] for w in standing]).tolist()
            for w, (ground, planned) in zip(standing, grounds, strict=True):
                fallen[w] = self._why_fallen(q[w], wanted[w].q[2] - planned, ground, time)
            if self.is_on and time - before[0].time > 0.0:
                standing = [w for w in standing if fallen[w] is None]
                own = self._footings(before, wanted, q, v, contacts, time, standing, [rides[w] for w in standing])
                for w, footing in zip(standing, own, strict=True):
                    footings[w] = footing
        full = np.abs(torques) >= FULL * self.dynamics.efforts
        over: list[tuple[str, ...]] = [()] * len(before)
        for w in np.flatnonzero(full.any(axis=1)).tolist():
            over[w] = tuple(name for name, is_full in zip(self._robot.joint_names, full[w], strict=True) if is_full)
        found = []
        for w, earlier in enumerate(before):
            span = time - earlier.time
            a = (v[w] - earlier.v) / span if span > 0.0 else np.zeros_like(v[w])
            found.append(RobotState(
                time, q[w], v[w], a, torques[w], fallen[w], over[w], loads=smoothed(earlier.loads, loads[w], span),
                contacts=contacts[w], joint_wrenches=wrenches[w], footing=footings[w],
            ))  # fmt: skip
        return found

    def _falling(self) -> Stabiliser | None:
        """Return what keeps the robot up in the gravity of now; None without feet, or where it floats."""
        gravity = self.dynamics.world.gravity
        self._control.take_gravity(gravity)
        if self._stabiliser is None or not any(gravity):
            return None
        self._stabiliser.take_gravity(gravity)
        return self._stabiliser

    def _rides(self, states: Sequence[RobotState], worlds: Sequence[int], end: float) -> list[Ride | None]:
        """Return how far moving ground has carried the robot at the end of a frame [s], in each of some worlds."""
        stabiliser, grounds = self._stabiliser, moving_grounds(self.dynamics.world)
        if not grounds or stabiliser is None:
            return [at_rest(earlier_ride(own)) for own in states]
        pivots = stabiliser.actual([own.q for own in states], [own.v for own in states]).places.mean(axis=1)
        return rides_on(states, worlds, pivots, self._foot_links, grounds, end)

    def _why_fallen(self, q: np.ndarray, height: float, ground: float, time: float) -> str | None:
        """Return why and when a robot fell, None where it did not; say it once.

        Args:
            q: (nq,) where it is.
            height: [m], of the wanted base above the wanted soles.
            ground: [m], the height of what bears it.
            time: [s].
        """
        up, why = 1.0 - 2.0 * (q[3] ** 2 + q[4] ** 2), ""
        if up < LEANS:
            why = f"its trunk leans by {np.rad2deg(np.arccos(np.clip(up, -1.0, 1.0))):.0f} degrees"
        elif q[2] - ground < SINKS * height:
            why = f"its base is {q[2] - ground:.2f} m above its feet's ground"
        if not why:
            return None
        fallen = f"{why} at t = {time:.2f} s"
        if self._warns:
            logger.warning("%r fell: %s; robot.set_up() stands it up again", self._robot.name, fallen)
        return fallen

    def _footings(
        self, before: Sequence[RobotState], wanted: Sequence[RobotState], q: Sequence[np.ndarray],
        v: Sequence[np.ndarray], contacts: Sequence[Contacts], time: float, standing: list[int],
        rides: Sequence[Ride | None],
    ) -> list[Footing]:  # fmt: skip
        """Return the footings after a frame in worlds in which a robot stands."""
        stabiliser: Any = self._stabiliser
        if not standing:
            return []
        pressed = np.array([
            [sum(force[2] for force in contacts[w].get(link, {}).values()) for link in self._foot_links]
            for w in standing
        ], dtype=float)  # fmt: skip
        states = [before[w] for w in standing]
        aims, places, speeds = ([part[w] for w in standing] for part in (wanted, q, v))
        loads = [self.load(own) for own in states]
        footings: list[Footing] = stabiliser.footings(states, aims, places, speeds, pressed, time, loads, rides)
        return footings

    def load(self, state: RobotState) -> Carried | None:
        """Return what a robot carries; None where nothing weighs anything."""
        gravity = float(np.linalg.norm(self.dynamics.world.gravity))
        return carried_by(self._robot, self._data, state.q, state.loads, gravity) if gravity > 0.0 else None

    def ended(self, span: float) -> list[tuple[Any, Any, Any, Any, Any, Any]]:
        """Return q, v, torques, contacts, joint wrenches and loads after a frame of ``span`` [s], of each world.

        These are (nq,); (nv,); (n,) [N m; N] of the motors; forces on the links; (n, 6) [N, N m], what the joints bore,
        as ``RobotState.joint_wrenches``; and (njoints, 6) [N, N m], what the robot carries did to the joints, in their
        own frames, None for nothing.
        """
        dynamics = self.dynamics
        q, v = dynamics.read()
        contacts, wrenches, efforts = dynamics.felt(span)
        loads = dynamics.loads([dynamics.pressing(own, self._foot_links) for own in contacts])
        return list(zip(q, v, efforts, contacts, wrenches, loads, strict=True))

    def imagined(self, world: World) -> Balance:
        """Return the same for the copies of the links in a batch that was imagined from their world."""
        made = copy.copy(self)
        made.dynamics, made._warns = self.dynamics.imagined(world), False
        made._data, made._control = self._robot.model.createData(), self._control.imagined()
        made._stabiliser = None if self._stabiliser is None else self._stabiliser.imagined()
        return made


def _carried(wanted: Sequence[RobotState], rides: Sequence[Ride | None]) -> list[RobotState]:
    """Return how robots are to move where the ground has carried them to."""
    return [
        own if ride is None else RobotState.moving(own.time, ride.carried(own.q), own.v, own.a)
        for own, ride in zip(wanted, rides, strict=True)
    ]
