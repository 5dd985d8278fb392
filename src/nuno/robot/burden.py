"""Burden: whether a robot whose motion is given could do it with weight: its joints' torques, and its balance."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.collision import Collision, Unbalance
from nuno.robot.sensors import Sensors, sole_corners
from nuno.robot.support import convex_outline, distance_inside

if TYPE_CHECKING:
    from nuno.robot.links import Links
    from nuno.robot.robot_state import RobotState

logger = logging.getLogger(__name__)

EVERY = 6
"""Frames from one look to the next."""
ENOUGH = 3
"""Looks at a robot at rest, of two frames each, after which it is not looked at again until something moves."""
TIPPING = 5e-3
"""[m] By which the zero moment point must be outside the soles to count."""
LIFTED = 5e-3
"""[m] Above the lowest corner of all soles, from where on a sole does not bear."""


class Burden:
    """Looks every ``EVERY`` frames whether the joints' torques and the balance are possible.

    What is found twice in a row counts: the blow of something that is caught does not. It is reported once for a
    joint, and once for each time that balance is lost, as a warning.

    Args:
        links: The robot's links.
    """

    def __init__(self, links: Links) -> None:
        self._links, self._robot = links, links.robot
        self._sensors = Sensors(links.robot, links)
        limits = links.robot.effort_limits
        self._limits = np.where(np.isfinite(limits) & (limits > 0.0), limits, np.inf)
        self._soles = {foot: sole_corners(own) for foot, own in links.robot.description.frames.items()
                       if foot in links.robot.description.feet}  # fmt: skip
        self._frames = 0
        self._still = 0  # looks since anything changed
        self._last: tuple[frozenset[str], float] = (frozenset(), -np.inf)
        self._over: tuple[str, ...] = ()
        self._unbalanced: Unbalance | None = None
        self._told: set[str] = set()

    def after_frame(self, state: RobotState, met: Collision | None) -> RobotState:
        """Return a state with what was found of it after a frame, and what its motion would run into."""
        self._frames += 1
        if self._frames % EVERY in (0, EVERY - 1):
            self._look(state)
        if met is None and not self._over and self._unbalanced is None:
            return state
        return replace(state, over_torque=self._over, unbalanced=self._unbalanced, collision=met)

    def forget(self) -> None:
        """Begin anew: the robot was put elsewhere."""
        self._last, self._over, self._unbalanced, self._still = (frozenset(), -np.inf), (), None, 0

    def _look(self, state: RobotState) -> None:
        loaded = any(body.is_dynamic for body in self._links.world._bodies.values())
        moves = bool(state.v.any() or state.a.any())
        self._still = 0 if moves or loaded else self._still + 1
        if self._still > 2 * ENOUGH:
            return
        if self._frames % EVERY:
            self._sensors.follow_loads()  # a look takes what has changed since the frame before
            return
        corners = self._corners()
        if corners is not None:
            self._sensors.ground = float(corners[:, 2].min())
        told = self._sensors.read(state)
        over = frozenset(
            name for name, torque, most in zip(self._robot.joint_names, np.abs(told.torques), self._limits, strict=True)
            if torque > most
        )  # fmt: skip
        outside = -np.inf
        if corners is not None:
            bearing = corners[corners[:, 2] < corners[:, 2].min() + LIFTED, :2]
            if len(bearing) > 2 and np.isfinite(told.zero_moment_point).all():
                outside = -distance_inside(convex_outline(bearing), told.zero_moment_point)
        last, self._last = self._last, (over, outside)
        self._over = tuple(name for name in self._robot.joint_names if name in over & last[0])
        self._tell_torques(told.torques)
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
        new = [name for name in self._over if name not in self._told]
        if not new:
            return
        self._told.update(new)
        rows = [self._robot.joint_index(name) for name in new]
        most = max(rows, key=lambda row: abs(torques[row]) / self._limits[row])
        logger.warning(
            "%r could not do that: %s would need more than the limit, %s the most: %.0f of %.0f N m. Hold less or "
            "nearer, move slower, or give it dynamics (attach)",
            self._robot.name, ", ".join(new), self._robot.joint_names[most], abs(torques[most]), self._limits[most],
        )  # fmt: skip

    def _corners(self) -> np.ndarray | None:
        """Return all corners of the soles (k, 3) [m], None without feet."""
        if not self._soles:
            return None
        return np.concatenate([self._robot.frame_pose(foot).to_world(own) for foot, own in self._soles.items()])
