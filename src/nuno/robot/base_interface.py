"""BaseInterface: the base of a robot as its driver offers it: where it is, and how it goes elsewhere."""

from __future__ import annotations

import logging
from abc import abstractmethod
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.robot.camera_interface import CameraInterface
from nuno.robot.goal import Goal, GoalStatus
from nuno.robot.robot_model import standing_place
from nuno.robot.trajectory import JointTrajectory
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates, Pose, compose, invert
from nuno.validation import checked, number

logger = logging.getLogger(__name__)

BASE = "base_footprint"
"""The frame that a robot moves in: the point between its soles on the floor, x forward."""
WORLDS = ("world", "map", "odom")
BASE_JOINTS = ("odom_x", "odom_y", "odom_t")
"""What a trajectory of the base calls its place [m] and its turn [rad]."""


class BaseInterface(CameraInterface):
    """A robot that goes: names, order and defaults of scikit-robot's interface to a moving base."""

    # What a robot must bring

    @abstractmethod
    def read_base(self) -> Coordinates:
        """Return where the base link is in the world, as odometry tells."""

    @abstractmethod
    def send_base(self, x: float, y: float, yaw: float, seconds: float | None, stop: bool) -> Goal:
        """Let the robot go to a place seen from where it is, and return the goal at once.

        Args:
            x: Forward [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            seconds: How long it takes [s]; None leaves that to the robot.
            stop: Whether it rests there.
        """

    @checked
    def send_velocity(self, x: float, y: float, yaw: float, hold: float = 1.0) -> Goal:
        """Let the robot keep a velocity until another comes, as from a joystick, and return the goal at once.

        Args:
            x: Forward [m/s].
            y: To the left [m/s].
            yaw: Counterclockwise [rad/s].
            hold: How long it counts [s] where no other comes; then the robot comes to rest.
        """
        x, y, yaw = (number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
        span = number("hold", hold, above=0.0)
        return self.send_base(x * span, y * span, yaw * span, span, True)

    @abstractmethod
    def cancel_base(self) -> None:
        """Let the robot stop going, as soon as it safely can; its goal ends as preempted."""

    # Going

    @property
    def odom(self) -> Coordinates:
        """Return where the base link is in the world, as odometry tells."""
        return self.read_base()

    @checked
    def go_pos(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, wait: bool = True) -> bool:
        """Go to a place seen from where the robot is now.

        Args:
            x: Forward [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            wait: Return when it is there.

        Returns:
            Whether it got there; without ``wait``, whether it has set off.
        """
        return self._go(x, y, yaw, None, True, wait)

    @checked
    def go_velocity(
        self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, sec: float = 1.0, stop: bool = True, wait: bool = False
    ) -> bool:
        """Go at a velocity for a while.

        Args:
            x: Forward [m/s].
            y: To the left [m/s].
            yaw: Counterclockwise [rad/s].
            sec: For how long [s].
            stop: Rest after that.
            wait: Return when it is over.

        Returns:
            As ``go_pos``.
        """
        span = number("sec", sec, above=0.0)
        x, y, yaw = (number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
        return self._go(x * span, y * span, yaw * span, span, stop, wait)

    @checked
    def go_stop(self, force_stop: bool = True) -> bool:
        """Stop going, as soon as the robot safely can.

        Args:
            force_stop: Also wait until it stands.
        """
        self.cancel_base()
        goal = self._base_goal
        if force_stop and goal is not None:
            self.wait_until(lambda: goal.is_done)
        return True

    @checked
    def move_to(self, coords: str | Coordinates, wait: bool = True, frame_id: str | None = None) -> bool:
        """Go to a place: only its x, y and the turn about z count.

        Args:
            coords: The place, or the name of one of the robot's frames.
            wait: Return when it is there.
            frame_id: What ``coords`` is given in: "base_footprint" (None), "world", "map", "odom", or one of the
                robot's frames.

        Returns:
            As ``go_pos``.

        Raises:
            UnknownNameError: there is no such frame.
        """
        goal = self._to_base(*self._frame(coords)) if isinstance(coords, str) else self._in_base(coords, frame_id)
        forward = quat.rotate(goal[1], np.array([1.0, 0.0, 0.0]))
        return self.go_pos(float(goal[0][0]), float(goal[0][1]), float(np.arctan2(forward[1], forward[0])), wait)

    @checked
    def move_to_send(
        self, coords: str | Coordinates, frame_id: str | None = None, wait_for_server_timeout: float = 5.0
    ) -> bool:
        """Set off to a place as ``move_to`` does, and return at once whether the robot did.

        Args:
            coords: The place, or the name of one of the robot's frames.
            frame_id: What ``coords`` is given in; see ``move_to``.
            wait_for_server_timeout: Not needed here: a robot that is connected takes goals.
        """
        self._place = self._in_world(coords, frame_id)
        return self._set_off_to(self._place)

    @checked
    def move_to_wait(self, retry: int = 10, frame_id: str = "world") -> bool:
        """Wait until the robot is where ``move_to_send`` sent it, and return whether it is.

        Args:
            retry: So often it is sent there, where it stops on the way.
            frame_id: Not needed here.
        """
        goal = self._base_goal
        if self._place is None or goal is None:
            return False
        for _ in range(max(1, retry)):
            present = goal
            self.wait_until(lambda own=present: own.is_done)  # type: ignore[misc]
            if present.succeeded or present.status in (GoalStatus.REJECTED, GoalStatus.LOST):
                return present.succeeded
            if not self._set_off_to(self._place):
                return False
            goal = self._base_goal
            assert goal is not None
        return goal.is_done and goal.succeeded

    @checked
    def go_pos_unsafe(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, wait: bool = False) -> bool:
        """Go to a place seen from here; the same as ``go_pos``, but that it returns at once."""
        return self.go_pos(x, y, yaw, wait)

    @checked
    def move_trajectory(
        self, x: float, y: float, yaw: float, sec: float = 1.0, stop: bool = True, start_time: float | None = None,
        send_action: bool | None = None,
    ) -> Any:  # fmt: skip
        """Return the straight way to a place seen from here as a trajectory, or go it.

        Args:
            x: Forward [m].
            y: To the left [m].
            yaw: Counterclockwise [rad].
            sec: How long it takes [s].
            stop: Rest there.
            start_time: When it begins; now is all that is possible.
            send_action: Go, and return the goal in place of the trajectory.

        Raises:
            InvalidInputError: not finite, no time, or a later start.
        """
        x, y, yaw = (number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
        span = number("sec", sec, above=0.0)
        if start_time is not None and start_time > self.now():
            raise InvalidInputError(f"a base sets off at once: start_time must be None, got {start_time}")
        if send_action:
            self._base_goal = self.send_base(x, y, yaw, span, stop)
            return self._base_goal
        here = self.footprint()
        forward = quat.rotate(here.quaternion, np.array([1.0, 0.0, 0.0]))
        turn = float(np.arctan2(forward[1], forward[0]))
        there = here.to_world(np.array([[x, y, 0.0]]))[0]
        rows = np.array([[*here.position[:2], turn], [*there[:2], turn + yaw]])
        speeds = None if not stop else np.zeros_like(rows)
        return JointTrajectory(BASE_JOINTS, np.array([0.0, span]), rows, speeds)

    # State

    def update_robot_state(self, wait_until_update: bool | float = False) -> bool:
        """Bring ``robot`` to the newest joint state, its base to where odometry has it; see ``JointInterface``."""
        if not super().update_robot_state(wait_until_update):
            return False
        self.robot._place(*self.read_base().pose())
        return True

    def footprint(self) -> Coordinates:
        """Return where the robot stands: the point between its soles, x forward, z up."""
        self.update_robot_state()
        robot = self.robot
        x, y, yaw = standing_place(robot)
        floor = [robot.frame_pose(foot).position[2] for foot in robot.description.feet]
        height = float(np.mean(floor)) if floor else robot.position[2]
        return Coordinates((x, y, height)).rotate(yaw, "z")

    # Inside

    _base_goal: Goal | None = None
    _place: Pose | None = None

    def _go(self, x: float, y: float, yaw: float, seconds: float | None, stop: bool, wait: bool) -> bool:
        x, y, yaw = (number(name, value) for name, value in (("x", x), ("y", y), ("yaw", yaw)))
        goal = self._base_goal = self.send_base(x, y, yaw, seconds, stop)
        if wait:
            self.wait_until(lambda: goal.is_done)
        if goal.is_done and not goal.succeeded:
            logger.warning("the robot did not go there: %s", goal.text or goal.status.name.lower())
            return False
        return True

    def _frame(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        self.update_robot_state()
        return self.robot.frame_pose(name).pose()

    def _to_base(self, position: np.ndarray, quaternion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return compose(invert(self.footprint().pose()), (position, quaternion))

    def _in_base(self, coords: Coordinates, frame: str | None) -> tuple[np.ndarray, np.ndarray]:
        if not isinstance(coords, Coordinates):
            raise InvalidInputError(f"coords must be Coordinates or a frame's name, got {type(coords).__name__}")
        if frame is None or frame == BASE:
            return coords.pose()
        if frame in WORLDS:
            return self._to_base(*coords.pose())
        return self._to_base(*compose(self._frame(frame), coords.pose()))

    def _in_world(self, coords: str | Coordinates, frame: str | None) -> Pose:
        """Return the pose in the world of a place as ``move_to`` takes it."""
        seen = self._to_base(*self._frame(coords)) if isinstance(coords, str) else self._in_base(coords, frame)
        return compose(self.footprint().pose(), seen)

    def _set_off_to(self, place: Pose) -> bool:
        seen = compose(invert(self.footprint().pose()), place)
        forward = quat.rotate(seen[1], np.array([1.0, 0.0, 0.0]))
        return self.go_pos(float(seen[0][0]), float(seen[0][1]), float(np.arctan2(forward[1], forward[0])), wait=False)
