"""Burden: whether a robot whose motion is given could do it with weight: its joints' torques, and its balance."""

from __future__ import annotations

import logging
import math
from dataclasses import replace
from operator import is_
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.robot.collision import Collision, Unbalance
from nuno.robot.sensors import Sensors
from nuno.robot.support import convex_outline, distance_inside

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid
    from nuno.robot.links import Links
    from nuno.robot.robot_state import RobotState

logger = logging.getLogger(__name__)

EVERY = 30
"""Frames from one look to the next."""
ENOUGH = 3
"""Looks at a robot at rest, of two frames each, after which it is not looked at again until something moves."""
TIPPING = 5e-3
"""[m] By which the zero moment point must be outside the soles to count."""
LEVEL = 1e-3
"""[m] By which the lowest sole may be above or below what is taken as the ground."""
LIFTED = 5e-3
"""[m] Above the lowest corner of all soles, from where on a sole does not bear."""


class StrainSensors(Sensors):
    """Sensors that are asked for no more than what strains a robot without dynamics."""

    _unloaded: tuple[Any, ...] = ()  # how it moved when nothing bore on it last, the ground, and what came of it

    def strain(self, state: RobotState) -> tuple[np.ndarray, np.ndarray | None]:
        """Return of ``read`` torques (n,) [N m; N] and zero moment point (2,) [m], None where no foot stands.

        Args:
            state: How the robot moves, at the time that the world has now. Its arrays are never written to.
        """
        loads = () if self._loads is None else self._loads.read()
        before = () if self._take_gravity() else self._unloaded
        motion = (state.q, state.v, state.a)
        if before and not loads and before[1] == self.ground and all(map(is_, before[0], motion)):
            torques, point = before[2]
            return torques, point
        torques, _, point, _ = self._balance(state, None)
        self._unloaded = () if loads else (motion, self.ground, (torques.copy(), point))
        return torques, point


class Burden:
    """Looks every ``EVERY`` frames whether the joints' torques and the balance are possible.

    What is found twice in a row counts: the blow of something that is caught does not. It is reported once for a
    joint, and once for each time that balance is lost, as a warning.

    Args:
        robot: The robot.
        links: Its links.
    """

    def __init__(self, robot: Humanoid, links: Links) -> None:
        self._links, self._robot = links, robot
        self._sensors = StrainSensors(robot, links)
        limits = robot.effort_limits
        self._limits = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.inf)
        frames = links.robot.description.frames
        sizes = [size for foot in links.robot.description.feet if (size := frames[foot].size) is not None]
        self._inner = 0.4 * min((float(np.min(size)) for size in sizes), default=0.0)
        self._frames = 0
        self._still = 0  # looks since anything changed
        self._last: tuple[frozenset[int], float] = (frozenset(), -np.inf)
        self._overloaded: tuple[str, ...] = ()
        self._unbalanced: Unbalance | None = None
        self._warned: set[str] = set()

    def after_frame(self, state: RobotState, met: Collision | None) -> RobotState:
        """Return a state with what was found of it after a frame, and what its motion would run into."""
        self._frames += 1
        if self._frames >= EVERY - 1:
            self._look(state)
        if met is None and not self._overloaded and self._unbalanced is None:
            return state
        return state.judged(self._overloaded, self._unbalanced, met)

    def forget(self) -> None:
        """Begin anew: the robot was put elsewhere."""
        self._last, self._overloaded, self._unbalanced, self._still = (frozenset(), -np.inf), (), None, 0

    def save(self) -> tuple[Any, ...]:
        """Return what it has found, for ``load``."""
        return self._frames, self._still, self._last, self._overloaded, self._unbalanced

    def load(self, saved: tuple[Any, ...]) -> None:
        """Go on from what was found then."""
        self._frames, self._still, self._last, self._overloaded, self._unbalanced = saved

    def _look(self, state: RobotState) -> None:
        moves = bool(state.v.any() or state.a.any())
        changes = moves or any(body.is_dynamic for body in self._links.world.bodies)
        self._still = 0 if changes else self._still + 1
        prepares = self._frames < EVERY
        self._frames %= EVERY
        if self._still > 2 * ENOUGH:
            return
        if prepares:
            self._sensors.note_loads()  # a look takes what has changed since the frame before
            return
        torques, point = self._sensors.strain(state)
        soles = self._sensors.soles
        if soles is not None and abs(float(soles[:, :, 2].min()) - self._sensors.ground) > LEVEL:
            self._sensors.ground = float(soles[:, :, 2].min())
            torques, point = self._sensors.strain(state)
        over = frozenset(np.flatnonzero(np.abs(torques) > self._limits).tolist())
        outside = -np.inf if soles is None or point is None else self._outside(soles, point)
        last, self._last = self._last, (over, outside)
        both = over & last[0]
        self._overloaded = tuple(self._robot.joint_names[k] for k in sorted(both)) if both else ()
        if both:
            self._tell_torques(torques)
        if min(outside, last[1]) <= TIPPING:
            self._unbalanced = None
        elif self._unbalanced is None:
            self._unbalanced = Unbalance(max(outside, last[1]), state.time)
            logger.warning(
                "%r would tip over: %s. Hold less or nearer, move slower, or give it dynamics (attach)",
                self._robot.name, self._unbalanced,
            )  # fmt: skip
        elif outside > self._unbalanced.distance:
            self._unbalanced = replace(self._unbalanced, distance=outside)

    def _tell_torques(self, torques: np.ndarray) -> None:
        new = [name for name in self._overloaded if name not in self._warned]
        if not new:
            return
        self._warned.update(new)
        rows = [self._robot.joint_index(name) for name in new]
        most = max(rows, key=lambda row: abs(torques[row]) / self._limits[row])
        logger.warning(
            "%r could not do that: %s would need more than the limit, %s the most: %.0f of %.0f N m. Hold less or "
            "nearer, move slower, or give it dynamics (attach)",
            self._robot.name, ", ".join(new), self._robot.joint_names[most], abs(torques[most]), self._limits[most],
        )  # fmt: skip

    def _outside(self, soles: np.ndarray, point: np.ndarray) -> float:
        """Return how far outside the hull of soles (feet, 4, 3) a point (2,) is [m]; -inf where it is well inside."""
        x, y = point.tolist()
        if not (math.isfinite(x) and math.isfinite(y)):
            return -np.inf
        heights = soles[:, :, 2]
        bearing = soles[heights.min(axis=1) < heights.min() + LIFTED]
        # balls in the soles, and all that lies between two of them, are in the hull
        (ax, ay), (bx, by) = (_middle(sole) for sole in (bearing[0].tolist(), bearing[-1].tolist()))
        along_x, along_y = bx - ax, by - ay
        share = ((x - ax) * along_x + (y - ay) * along_y) / max(along_x**2 + along_y**2, 1e-12)
        share = min(max(share, 0.0), 1.0)
        if (x - ax - share * along_x) ** 2 + (y - ay - share * along_y) ** 2 < self._inner**2:
            return -np.inf
        corners = bearing.reshape(-1, 3)
        corners = corners[corners[:, 2] < corners[:, 2].min() + LIFTED, :2]
        return -distance_inside(convex_outline(corners), point) if len(corners) > 2 else -np.inf


def _middle(corners: list[list[float]]) -> tuple[float, float]:
    """Return x and y [m] of the middle of four corners."""
    return 0.25 * sum(own[0] for own in corners), 0.25 * sum(own[1] for own in corners)
