"""Stabiliser: the aims of robots on their feet: the motion that is wanted, on their true footing, or a step."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.aims import Aims, FootAims
from nuno.robot.capture_step import BEYOND, CaptureStep, Pendulum, carried_on, lifted, nearest_in, outside
from nuno.robot.carried import Carried
from nuno.robot.foot_kinematics import FeetAndCentre, FootKinematics
from nuno.robot.footing import FIRM, Footing, Soles, are_planned, found_footings, planned_footings
from nuno.robot.pinocchio import pin
from nuno.robot.ride import Ride
from nuno.robot.robot_state import RobotState
from nuno.robot.sensors import sole_corners
from nuno.robot.support import convex_outline

if TYPE_CHECKING:
    from nuno.robot.robot import Robot

MOVES = 1e-3
"""[m/s, rad/s] Slower than this a foot is wanted at rest."""
DT = 1e-3
"""[s] Of differences of a foot's way."""
FRAMES = 2
"""Frames one after the other in which a robot must be out of balance before it makes a step."""
INSIDE = 0.01
"""[m] By which the capture point is to be inside the soles' outline after a step, or another one follows."""
MIN_SHARE = 0.4
"""Share of the soles' outline that the centre of mass of a robot and its load stays in, standing."""
LIFTED = 3e-3
"""[m] How far above the other a sole may be that bears nothing, and still stands."""
UNEVEN = 0.03
"""[m] By how much ground may be higher or lower than planned, before falls are judged by it: walks land on 2 cm."""
MAX_STEPS = 8
"""That it makes for one push."""
SURELY = 0.9
"""Share of a disc in a sole, in which a point is inside the soles' outline whatever rounding does."""


class Stabiliser:
    """The aims of robots on their feet, and their steps where they are pushed: of copies of one robot, a world each.

    Args:
        robot: The robot.
        gravity: (3,) [m/s2].

    Attributes:
        gravity: [m/s2].
    """

    def __init__(self, robot: Robot, gravity: Any) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._actual, self._wanted = FeetAndCentre(robot), FeetAndCentre(robot)
        self._still = np.zeros(robot.model.nv)
        self._feet = [robot.frame_index(foot) for foot in robot.description.feet]
        corners = np.array([sole_corners(robot.description.frames[foot]) for foot in robot.description.feet])
        self._outlines = list(corners[:, [0, 2, 3, 1]])
        # of each sole, the radius of the greatest disc in it
        self._inner = np.abs(corners[:, :, :2]).min(axis=(1, 2))
        self._mass = robot.mass
        self.take_gravity(gravity)
        pin.framesForwardKinematics(robot.model, self._data, robot.posture_configuration())
        places = [self._data.oMf[foot].translation.copy() for foot in self._feet]
        self._stance = float(np.linalg.norm(places[0] - places[-1]))

    def take_gravity(self, gravity: Any) -> None:
        """Reckon with a gravity (3,) [m/s2] from now on."""
        self.gravity = float(np.linalg.norm(gravity))
        self._weight = self._mass * self.gravity

    def imagined(self) -> Stabiliser:
        """Return the same for copies of the robot."""
        made = copy.copy(self)
        made._data, made._actual, made._wanted = self._model.createData(), self._actual.copy(), self._wanted.copy()
        return made

    def actual(self, q: Sequence[np.ndarray], v: Sequence[np.ndarray]) -> FootKinematics:
        """Return how feet move in configurations (nq,) with velocities (nv,), and would while those stay, by world."""
        return self._actual.of(q, v, [self._still] * len(q))

    def _wanted_of(self, wanted: Sequence[RobotState]) -> FootKinematics:
        return self._wanted.of([own.q for own in wanted], [own.v for own in wanted], [own.a for own in wanted])

    def aims(
        self, now: Sequence[RobotState], wanted: Sequence[RobotState], time: float, rides: Sequence[Ride | None]
    ) -> Aims:
        """Return what the whole-body control is to bring about until a time [s], in each world.

        Args:
            now: How the robots move.
            wanted: How they are to move, where the ground has carried them to.
            time: [s].
            rides: How the ground moves.
        """
        ref = self._wanted_of(wanted)
        known = [own.footing for own in now]
        if None in known:
            planned = planned_footings(ref.places[:, :, 2])
            known = [own or first for own, first in zip(known, planned, strict=True)]
        footings = [own for own in known if own is not None]
        centres, bears = ref.centres.copy(), np.array([own.bears for own in footings])
        centres[:, 0] += np.array([own.centre for own in footings])
        tilts = np.array([own.tilts for own in footings])
        turns = np.zeros(ref.turns.shape)
        for w, k in np.ndindex(tilts.shape[:2]):
            turns[w, k] = pin.exp3(tilts[w, k])
        feet = FootAims(
            ref.places + np.array([own.offsets for own in footings]), turns @ ref.turns, ref.speeds.copy(),
            ref.accelerations.copy(), bears, ~bears & ~(np.abs(ref.speeds).max(axis=2) > MOVES),
            np.zeros((2, *ref.speeds.shape)),
        )  # fmt: skip
        q, v, a = (np.array(part) for part in zip(*((own.q, own.v, own.a) for own in wanted), strict=True))
        aims = Aims(centres, q, v, a, feet, np.zeros(len(now), dtype=bool))
        for w, footing in enumerate(footings):
            if footing.step is not None:
                self._aim_at_step(aims, w, now[w], footing.step, time, rides[w])
        for w, ride in enumerate(rides):
            if ride is not None and ride.moves:
                _let_ride(aims, w, ride, now[w])
        return aims

    def _aim_at_step(
        self, aims: Aims, w: int, now: RobotState, step: CaptureStep, time: float, ride: Ride | None
    ) -> None:
        """Change the aims of a world to those of a robot that makes a step to catch itself, seen from the ground."""
        pendulum, centre = self._pendulum(now.q, now.v, ride=ride)
        other, feet = 1 - step.foot, aims.feet
        ground = pendulum.feet[other, 2]
        goal = np.zeros((3, 3))
        goal[0] = *pendulum.feet[:, :2].mean(axis=0), pendulum.feet[:, 2].mean() + step.height
        feet.places[w], feet.turns[w] = pendulum.feet[:, :3], [_turned(yaw) for yaw in pendulum.feet[:, 3]]
        feet.speeds[w] = feet.accelerations[w] = 0.0
        if step.landed is None:
            point = nearest_in(pendulum.inner(other), pendulum.point)
            goal[0, 2] = ground + step.height
            goal[2, :2] = pendulum.rate**2 * (centre[:2] - point)
            ahead = time + DT * np.array([0.0, -1.0, 1.0])
            here, before, after = (step.pose(own, ground) for own in ahead)
            swing, pushes = (after - before) / (2.0 * DT), (after - 2.0 * here + before) / DT**2
            k = step.foot
            feet.places[w, k], feet.turns[w, k] = here[:3], _turned(here[3])
            feet.speeds[w, k], feet.accelerations[w, k] = (
                (*own[:3], 0.0, 0.0, own[3]) for own in (swing, pushes)
            )  # fmt: skip
            feet.bears[w] = [own != k for own in (0, 1)]
            feet.sinks[w] = [own == k and step.share(time) > 1.0 for own in (0, 1)]
        else:
            feet.bears[w] = now.footing.bears if now.footing else True
            feet.sinks[w] = True
        aims.centres[w] = goal
        aims.v[w, :6] = aims.a[w, :6] = 0.0
        aims.falls_freely[w] = step.landed is None

    def footings(
        self, before: Sequence[RobotState], wanted: Sequence[RobotState], q: Sequence[np.ndarray],
        v: Sequence[np.ndarray], pressed: np.ndarray, time: float, loads: Sequence[Carried | None],
        rides: Sequence[Ride | None],
    ) -> list[Footing]:  # fmt: skip
        """Return the footings at the end of a frame, with the steps that robots begin or go on with, of each world.

        Args:
            before: States when the frame began.
            wanted: How they were to move, where the ground has carried them to.
            q: (nq,) where each is.
            v: (nv,) how each moves.
            pressed: (worlds, feet) [N], with what soles press on the ground.
            time: [s].
            loads: What each carries.
            rides: How the ground moves.
        """
        found = self._stood(before, wanted, q, v, pressed, time, loads, rides)
        return [own if ride is None else replace(own, ride=ride) for own, ride in zip(found, rides, strict=True)]

    def _stood(
        self, before: Sequence[RobotState], wanted: Sequence[RobotState], q: Sequence[np.ndarray],
        v: Sequence[np.ndarray], pressed: np.ndarray, time: float, loads: Sequence[Carried | None],
        rides: Sequence[Ride | None],
    ) -> list[Footing]:  # fmt: skip
        """Return the footings as ``footings`` does, seen from the ground."""
        ref, here = self._wanted_of(wanted), self.actual(q, v)
        # after a step that is finished, what is wanted begins anew from where the robot stands
        was = [None if own is None or (own.step is not None and own.step.is_finished) else own
               for own in (state.footing for state in before)]  # fmt: skip
        found = list(planned_footings(ref.places[:, :, 2]))
        known = [w for w, own in enumerate(was) if own is not None]
        if not known:
            return found
        soles = Soles(
            here.places[known], here.turns[known], ref.places[known], ref.turns[known], ref.speeds[known, :, 2],
            pressed[known],
        )  # fmt: skip
        leans = np.array([self._lean(q[w], wanted[w], ref.places[w], ref.turns[w], loads[w]) for w in known])
        spans = np.array([time - before[w].time for w in known])
        own = found_footings([own for own in was if own is not None], soles, self._weight, spans, leans)
        # velocities as seen from the ground, and accelerations in the world
        here, ref = (replace(own, centres=own.centres.copy()) for own in (here, ref))
        for w, ride in enumerate(rides):
            if ride is not None and ride.moves:
                ref.centres[w, 2] += ride.acceleration
                here.centres[w, 1] -= ride.speeds(here.centres[w, 0])
        stays = np.ones(len(known), dtype=bool)
        if len(self._feet) == 2:
            stays = self._surely_stay(here, ref, own, known)
        for w, footing, stay in zip(known, own, stays.tolist(), strict=True):
            earlier = was[w]
            found[w] = footing
            if earlier is not None and len(self._feet) == 2 and (earlier.step or loads[w] or not stay):
                pendulum, _ = self._pendulum(q[w], v[w], loads[w], rides[w])
                planned = are_planned(ref.places[w : w + 1, :, 2])[0]
                found[w] = self._stepped(earlier, footing, pendulum, ref.centres[w], planned, pressed[w], time)
        return found

    def _surely_stay(
        self, here: FootKinematics, ref: FootKinematics, footings: Sequence[Footing], known: list[int]
    ) -> np.ndarray:
        """Return who is surely in balance on the feet and makes no step, (known,) bool, unless it carries a load.

        Discs in the soles, and all that lies between two of them, are in the soles' outline.
        """
        centres, places, turns = here.centres[known], here.places[known], here.turns[known]
        heights = np.maximum(centres[:, 0, 2] - 0.5 * (places[:, 0, 2] + places[:, 1, 2]), 0.1)
        rates = np.sqrt(self.gravity / heights)[:, None]
        points = centres[:, 0, :2] + (centres[:, 1, :2] - ref.centres[known, 1, :2]) / rates
        points = points - ref.centres[known, 2, :2] / rates**2
        bearing = np.array([own.bears for own in footings]) | are_planned(ref.places[known][:, :, 2])
        starts = np.where(bearing[:, :1], places[:, 0, :2], places[:, 1, :2])
        along = np.where(bearing[:, 1:], places[:, 1, :2], places[:, 0, :2]) - starts
        share = ((points - starts) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-12)
        away = points - starts - np.clip(share, 0.0, 1.0)[:, None] * along
        radii = (SURELY * self._inner * turns[:, :, 2, 2]).min(axis=1)
        return ~bearing.any(axis=1) | ((radii > 0.0) & ((away * away).sum(axis=1) < radii * radii))

    def _stepped(
        self, was: Footing, footing: Footing, pendulum: Pendulum, wanted: np.ndarray, planned: np.ndarray,
        pressed: np.ndarray, time: float,
    ) -> Footing:  # fmt: skip
        """Return a footing with the step that the robot begins or goes on with.

        Args:
            was: That when the frame began.
            footing: Without a step.
            pendulum: The robot.
            wanted: (3, 3) place, velocity and acceleration of the centre of mass that were wanted.
            planned: (2,) bool, which feet are to stand.
            pressed: (2,) [N].
            time: [s].
        """
        touches = tuple(bool(force > FIRM * self._weight) for force in pressed)
        step = was.step
        if step is not None:
            ground = pendulum.feet[:, 2].min() + LIFTED
            still = [stood and foot[2] < ground for stood, foot in zip(was.bears, pendulum.feet, strict=True)]
            stands = tuple(bool(a or b) for a, b in zip(touches, still, strict=True))
            footing = replace(was, bears=stands, frames=was.frames)
            step = carried_on(step, pendulum, touches[step.foot], time)
            if step.landed is None:
                return replace(footing, step=step)
        point = pendulum.point
        if step is None:
            # what keeps the capture point as far from where it is wanted as it is; at rest that is the point itself
            point = point - wanted[1, :2] / pendulum.rate - wanted[2, :2] / pendulum.rate**2
        bearing = [k for k in (0, 1) if footing.bears[k] or (step is None and planned[k])]
        if not bearing:
            return replace(footing, step=step)
        outline = convex_outline(np.concatenate([pendulum.outlines[k] for k in bearing]))
        frames = was.frames + 1 if outside(outline, point, BEYOND if step is None else -INSIDE) else 0
        if frames >= FRAMES and (step is None or step.count < MAX_STEPS):
            bears = footing.bears if step is None else tuple(True for _ in self._feet)
            found = lifted(pendulum, bears, time, 1 if step is None else step.count + 1)
            step, frames = found or step, 0
        return replace(footing, step=step, frames=frames)

    def grounds(self, before: Sequence[RobotState], wanted: Sequence[RobotState]) -> np.ndarray:
        """Return the heights of what bears robots, and of the lowest soles that are wanted, (worlds, 2) [m].

        Args:
            before: States when the frame began.
            wanted: How they were to move, where the ground has carried them to.
        """
        lowest = self._wanted_of(wanted).places[:, :, 2].min(axis=1)
        rises = np.array([0.0 if own.footing is None else own.footing.rise for own in before])
        return np.stack([lowest + np.where(np.abs(rises) > UNEVEN, rises, 0.0), lowest], axis=1)

    def _pendulum(
        self, q: np.ndarray, v: np.ndarray, load: Carried | None = None, ride: Ride | None = None
    ) -> tuple[Pendulum, np.ndarray]:
        """Return the robot as a pendulum, seen from a ground that moves, and the place of its centre of mass."""
        model, data = self._model, self._data
        pin.centerOfMass(model, data, q, v)
        pin.updateFramePlacements(model, data)
        centre, speed = np.array(data.com[0]), np.array(data.vcom[0])
        if load is not None:
            centre += load.mass / (load.mass + self._mass) * (load.place - centre)
        if ride is not None and ride.moves:
            speed -= ride.speeds(centre)
        places = [data.oMf[foot] for foot in self._feet]
        feet = np.array([[*own.translation, np.arctan2(own.rotation[1, 0], own.rotation[0, 0])] for own in places])
        height = max(float(centre[2] - feet[:, 2].mean()), 0.1)
        rate = float(np.sqrt(self.gravity / height))
        outlines = [
            corners @ own.rotation[:2].T + own.translation[:2]
            for corners, own in zip(self._outlines, places, strict=True)
        ]
        point = centre[:2] + speed[:2] / rate
        pendulum = Pendulum(point, speed[:2], rate, height, feet, tuple(outlines), self._stance)  # type: ignore[arg-type]
        return pendulum, centre

    def _lean(
        self, q: np.ndarray, wanted: RobotState, places: np.ndarray, turns: np.ndarray, load: Carried | None
    ) -> np.ndarray:
        """Return by how much (3,) [m] a robot that stands leans back from its load, so that both are over its soles.

        A walk was planned with its load. Wanted soles are at places (feet, 3) and have turns (feet, 3, 3).
        """
        if load is None or np.abs(wanted.v[:6]).max() > 0.0:
            return np.zeros(3)
        there, now = (np.array(pin.centerOfMass(self._model, self._data, own))[:2] for own in (wanted.q, q))
        both = there + load.mass / (load.mass + self._mass) * (load.place[:2] - now)
        corners = [own @ turn[:2].T + place[:2] for own, place, turn in zip(self._outlines, places, turns, strict=True)]
        outline = convex_outline(np.concatenate(corners))
        middle = outline.mean(axis=0)
        back = (nearest_in(middle + MIN_SHARE * (outline - middle), both) - both) * (1.0 + load.mass / self._mass)
        return np.array([*back, 0.0])


def _turned(yaw: float) -> np.ndarray:
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, float(yaw)))


def _let_ride(aims: Aims, w: int, ride: Ride, now: RobotState) -> None:
    """Add the motion of the ground to the aims of a world."""
    feet = aims.feet
    feet.ground[:, w] = ride.twists(feet.places[w])
    feet.speeds[w] += feet.ground[0, w]
    feet.accelerations[w] += feet.ground[1, w]
    aims.centres[w, 1] += ride.speeds(aims.centres[w, 0])
    aims.centres[w, 2] += ride.acceleration
    upright = pin.Quaternion(now.q[3:7]).toRotationMatrix().T[:, 2]
    aims.v[w, 3:6] += ride.spin * upright
