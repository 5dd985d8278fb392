"""ArmPlan: joint angles with which a robot's hands take a cloth by its border and carry it along the ways of a fold."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError, ReachError, RobotModelError
from nuno.robot.placement import quaternion_of
from nuno.robot.robot_model import standing_place
from nuno.robot.support import distance_inside
from nuno.shapes.coordinates import Coordinates
from nuno.tasks.fold_motion import FoldMotion
from nuno.tasks.free_way import check_lines, free_way
from nuno.tasks.obstacles import Obstacles

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.humanoid import Humanoid

log = logging.getLogger(__name__)

HANDS = ("left_hand", "right_hand")
UP = np.array([0.0, 0.0, 1.0])
DEPTH = 0.004
"""[m] How far the cloth reaches into a hand: less than a cell, so that it takes a point and not a patch, which would
have to turn over with the cloth."""
PATCH = 2.0 * DEPTH
"""[m] From a corner that is taken, what else of a fine mesh may be taken with it."""
BELOW = 0.005
"""[m] How far inside the lower end of its closing volume an upright hand has the cloth."""
HOLDS = tuple(
    (inward, math.radians(lean), math.radians(turn))
    for lean in (0.0, 20.0) for inward in (1.0, -1.0) for turn in (0.0, 15.0, -15.0)
    if lean == 0.0 or inward > 0.0
)  # fmt: skip
"""Ways to hold, in the order of preference: whether the hand's x axis points into the cloth or out of it, how it leans
over that axis, how it is turned from it."""
STEP = 0.05
"""[s] Between two points of the way; on the cubics between them a hand strays by less than 1 mm at 3 m/s2."""
ABOVE = 0.10
"""[m] From where hands come down to the cloth, and where they go after it."""
MARGIN = 0.02
"""[m] By which the centre of mass stays inside the outline of the soles."""
SPARE = 0.9
"""Of the velocity limits, what a planned motion uses at most: a cubic's peak is above its mean."""


@dataclass(frozen=True, eq=False)
class ArmPlan:
    """A plan of a robot's motion.

    Attributes:
        hands: By hand of the motion, the robot's that does its part: "left_hand" or "right_hand".
        joints: Names of the m joints that move.
        approach: (a, m) float [rad], one after the other, from where the robot is to over the cloth.
        take: (b, m) float [rad], down to the cloth.
        times: (k,) float [s], from 0.
        carry: (k, m) float [rad], at these times, from where the cloth is taken.
        releases: (hands,) float [s], on the same clock, when the hands let go.
        leave: (c, m) float [rad], up from the cloth.
        stretch: How much slower than the motion that is, because a joint cannot be faster.
        errors: Largest position error of a hand at these points [m].
    """

    hands: tuple[str, ...]
    joints: tuple[str, ...]
    approach: np.ndarray
    take: np.ndarray
    times: np.ndarray
    carry: np.ndarray
    releases: np.ndarray
    leave: np.ndarray
    stretch: float
    errors: float


def plan_arms(robot: Humanoid, motion: FoldMotion, *, obstacles: Iterable[Body] = ()) -> ArmPlan:
    """Find joint angles with which a robot folds; it stays as it is.

    The feet and the base keep their places: trunk and arms move. Each hand keeps the turn with which it takes the
    cloth; of several such turns the first is taken with which all points are reached, links run neither into each other
    nor into an obstacle, on the lines between configurations too, and the robot stays upright.

    Args:
        robot: The robot, where it is.
        motion: What to do with the cloth.
        obstacles: Bodies that the trunk and the arms must not run into.

    Raises:
        RobotModelError: the robot has no hands to do it with.
        InvalidInputError: a motion of more than two hands, or of hands that hold nothing of the border.
        ReachError: no such angles were found.
    """
    bodies = list(obstacles)
    first: ReachError | None = None
    for hands in _hands_for(robot, motion):
        planner = _Planner(robot, motion, hands, bodies)
        for hold in HOLDS:
            try:
                return planner.plan(*hold)
            except ReachError as error:
                log.debug("%s, %s: %s", hands, hold, error)
                # what the most natural hold fails of says most
                first = first or error
    assert first is not None
    raise first


class _Planner:
    """Plans of one robot for one motion, by different holds."""

    def __init__(
        self, robot: Humanoid, motion: FoldMotion, hands: tuple[str, ...], obstacles: Iterable[Body]
    ) -> None:  # fmt: skip
        self.robot, self.motion, self.hands = robot.copy(), motion, hands
        self.start = self.robot.configuration()
        self.stance: tuple[str, ...] = (*self.robot.description.feet, self.robot.model.names[1])
        chains = [_chain(self.robot, hand) for hand in hands]
        self.columns = sorted({j - 2 for chain in chains for j in chain})
        self.obstacles = Obstacles(self.robot, obstacles, {j for chain in chains for j in chain})
        x, y, yaw = standing_place(self.robot)
        self.place, self.forward = np.array([x, y]), np.array([math.cos(yaw), math.sin(yaw), 0.0])
        self.outline = self.robot.support_polygon() if self.robot.description.feet else None
        self.inside, self.worst_error = 0.0, 0.0
        if self.outline is not None:
            self.inside = min(MARGIN, distance_inside(self.outline, self.robot.centre_of_mass[:2]) - 1e-3)

    def plan(self, inward: float, lean: float, turn: float) -> ArmPlan:
        """Return the plan with one way to hold.

        Raises:
            ReachError: it cannot be done so.
        """
        motion, self.worst_error = self.motion, 0.0
        self.holds = [self._hold(k, inward, lean, turn) for k in range(motion.hand_count)]
        self._check_holds()
        end = float(motion.times[-1])
        times = np.linspace(0.0, end, max(2, math.ceil(end / STEP) + 1))
        points = np.stack(
            [np.stack([np.interp(times, motion.times, way[:, axis]) for axis in range(3)], 1) for way in motion.ways], 1
        )  # (k, hands, 3)
        lift = np.linspace(ABOVE, 0.0, 5)[:, None, None] * UP
        approach = self._approach(points[:1] + lift[:1])
        above = approach[-1:]
        self._take(above[0])
        take = self._through(points[:1] + lift[1:], "down to the cloth", np.zeros(4))
        carry = self._through(points[1:], "along the way", times[1:])
        leave = self._through(points[-1:] + lift[-2::-1], "up from the cloth", np.full(4, end))
        where = f"the arms of {self.robot.name!r} cannot go on the way"
        check_lines(np.concatenate([above, take, carry, leave]), self._problem_at, where)
        carry = np.concatenate([take[-1:], carry])
        columns = self.columns
        stretch = self._stretch(carry, np.diff(times))
        return ArmPlan(
            self.hands, tuple(self.robot.joint_names[k] for k in columns), approach[:, columns], take[:, columns],
            times * stretch, carry[:, columns], motion.releases * stretch, leave[:, columns], stretch, self.worst_error,
        )  # fmt: skip

    def _hold(self, hand: int, inward: float, lean: float, turn: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3) of a hand that takes its point, and where that point is in the hand's frame (3,)."""
        own = self.robot.description.hands[self.hands[hand]]
        a, b = into_the_cloth(self.motion, hand)
        side = 1.0 if self.hands[hand] == "left_hand" else -1.0
        c, s = math.cos(side * turn), math.sin(side * turn)
        flat = inward * np.array([c * a - s * b, s * a + c * b, 0.0])
        z = math.sin(lean) * flat - math.cos(lean) * UP
        x = math.cos(lean) * flat + math.sin(lean) * UP
        if lean > 0.0:  # the cloth leaves the volume through its lower end
            point = np.array([own.low[0] + DEPTH, 0.0, own.high[2] - DEPTH * math.sin(lean)])
        else:
            point = np.array([own.high[0] - DEPTH if inward > 0.0 else own.low[0] + DEPTH, 0.0, own.high[2] - BELOW])
        return np.stack([x, np.cross(z, x), z], axis=1), point

    def _check_holds(self) -> None:
        """Raise where a hand that is to take a corner would close on more than that."""
        motion = self.motion
        for name, (rotation, local), vertex, uv in zip(
            self.hands, self.holds, motion.held, motion.taught.held, strict=True
        ):
            own = self.robot.description.hands[name]
            away = motion.start - motion.start[vertex]
            there = away @ rotation + local
            taken = ((there >= own.low) & (there <= own.high)).all(axis=1)
            if np.isin(uv, (0.0, 1.0)).all() and np.linalg.norm(away[taken], axis=1).max() > PATCH:
                raise ReachError(f"the {name} of {self.robot.name!r} would take {taken.sum()} points of the cloth")

    def _through(self, points: np.ndarray, where: str, times: np.ndarray) -> np.ndarray:
        """Return angles (k, n) for held points at ``points`` (k, hands, 3), from the present ones on."""
        found = []
        for places, time in zip(points, times, strict=True):
            targets: dict[str, Any] = {}
            for name, (rotation, local), place in zip(self.hands, self.holds, places, strict=True):
                targets[name] = Coordinates(place - rotation @ local, quaternion_of(rotation))
            self._reach(targets, f"{where}, at {time:.2f} s of the fold")
            found.append(self.robot.angle_vector())
        return np.array(found)

    def _reach(self, targets: Mapping[str, Any], where: str) -> None:
        """Take a configuration with the hands at targets."""
        robot = self.robot
        reached = robot.reach(targets, stance=self.stance, attempts=2)
        reason = reached.reason if not reached else self._problem(robot.configuration(), links=False)
        if reason:
            raise ReachError(f"the arms of {robot.name!r} cannot go {where}: {reason}", dict(reached.position_errors))
        self.worst_error = max(self.worst_error, *reached.position_errors.values())

    def _approach(self, points: np.ndarray) -> np.ndarray:
        """Return angles (a, n) from where the robot is to held points (1, hands, 3), straight or by one stop.

        Raises:
            ReachError: neither was found.
        """
        self.robot.take_configuration(self.start)
        begin = self.robot.angle_vector()
        above = self._through(points, "over the cloth", np.zeros(1))[0]
        return free_way(
            begin, above, self.columns, self.robot.joint_limits, self._problem_at,
            f"the arms of {self.robot.name!r} cannot go to the cloth",
        )  # fmt: skip

    def _problem_at(self, angles: np.ndarray) -> str:
        """Return what is wrong with angles (n,), and take them."""
        self._take(angles)
        return self._problem(self.robot.configuration())

    def _problem(self, q: np.ndarray, links: bool = True) -> str:
        """Return what is wrong with a configuration (nq,), "" where nothing is."""
        robot = self.robot
        if links and (pairs := robot.geometry.collisions(q, first_only=True)):
            return f"{pairs[0][0]} runs into {pairs[0][1]}"
        if met := self.obstacles.met(q):
            return f"{met[0]} runs into {met[1]!r}"
        if self.outline is not None and distance_inside(self.outline, robot.centre_of_mass[:2]) < self.inside:
            return f"the centre of mass comes within {1000.0 * self.inside:.0f} mm of the edge of the support"
        return ""

    def _take(self, angles: np.ndarray) -> None:
        self.robot.move_to(angles.copy())

    def _stretch(self, angles: np.ndarray, spans: np.ndarray) -> float:
        """Return by how much a motion must be slower, at least 1, so that no joint is too fast."""
        rates = np.abs(np.diff(angles, axis=0)) / spans[:, None] / (SPARE * self.robot.velocity_limits)
        return max(1.0, float(rates[:, self.columns].max()))


def into_the_cloth(motion: FoldMotion, hand: int) -> np.ndarray:
    """Return the horizontal direction (2,) from the border, where a hand takes the cloth, into the cloth.

    Raises:
        InvalidInputError: it does not take the border.
    """
    u, v = motion.taught.held[hand]
    units = (motion.frame.axes / motion.frame.size[:, None])[:, :2]
    inwards = np.array([float(u == 0.0) - float(u == 1.0), float(v == 0.0) - float(v == 1.0)]) @ units
    length = np.linalg.norm(inwards)
    if length == 0.0:
        raise InvalidInputError(f"hand {hand} must take the cloth's border, and takes it at ({u:.2f}, {v:.2f})")
    return inwards / length


def _hands_for(robot: Humanoid, motion: FoldMotion) -> list[tuple[str, ...]]:
    """Return the robot's hands that may do a motion's part: the left one what lies more to the left."""
    if motion.hand_count > len(HANDS):
        raise InvalidInputError(f"a robot folds with one or two hands, and the motion has {motion.hand_count}")
    missing = [hand for hand in HANDS if hand not in robot.description.hands]
    if missing:
        raise RobotModelError(f"{robot.name!r} has no {missing[0]} that closes; its description says of none")
    x, y, yaw = standing_place(robot)
    middle = 0.5 * (motion.ways[:, 0] + motion.ways[:, -1])[:, :2] - (x, y)
    aside = middle @ (-math.sin(yaw), math.cos(yaw))
    if motion.hand_count == 1:
        return [(hand,) for hand in (HANDS if aside[0] > 0.0 else HANDS[::-1])]
    return [HANDS if aside[0] > aside[1] else HANDS[::-1]]


def _chain(robot: Humanoid, hand: str) -> list[int]:
    """Return the joints between the base and a hand, without the base's own."""
    joint = robot.model.frames[robot.frame_index(hand)].parentJoint
    return [int(j) for j in robot.model.supports[joint] if j > 1]
