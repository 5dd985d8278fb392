"""RobotInterface: a robot as its driver offers it: joints, walking or driving, hands and sensors."""

from __future__ import annotations

import logging
from abc import abstractmethod
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError, RobotModelError, UnknownNameError
from nuno.robot.goal import Goal
from nuno.robot.joint_interface import JointInterface
from nuno.robot.readings import ImuReading
from nuno.robot.support import standing_place, zero_moment_point
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates, compose, invert
from nuno.validation import number

logger = logging.getLogger(__name__)

ARMS = {"larm": ("left_hand",), "rarm": ("right_hand",), "arms": ("left_hand", "right_hand")}
WRENCHES = {"larm": "left_wrist", "rarm": "right_wrist", "lleg": "left_ankle", "rleg": "right_ankle"}
"""Limbs, and the role of the frame that forces are measured in."""
BASE = "base_footprint"
"""The frame that a robot moves in: the point between its soles on the floor, x forward."""
WORLDS = ("world", "map", "odom")
LOADED = 1.0
"""[N] Weight that the feet must bear, so that they have a zero moment point."""


class RobotInterface(JointInterface):
    """A robot: what ``JointInterface`` says of its joints, and the rest of it.

    Arms are "larm", "rarm" or "arms"; limbs "larm", "rarm", "lleg" and "rleg".
    """

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

    @abstractmethod
    def cancel_base(self) -> None:
        """Let the robot stop going, as soon as it safely can; its goal ends as preempted."""

    @abstractmethod
    def send_gripper(self, hand: str, position: float, effort: float) -> Goal:
        """Let a hand ("left_hand", "right_hand") open or close, and return the goal at once.

        Args:
            hand: Which.
            position: How far it is to be open, from 0 (closed) to 1.
            effort: At most [N; N m for hinges].
        """

    @abstractmethod
    def read_wrench(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return force (3,) [N] and torque (3,) [N m] that what is beyond a sensor exerts on what is before it.

        A hand pulls its arm down by its weight, a foot that stands pushes its leg up. They are in the sensor's axes and
        about its origin.

        Args:
            frame: A role: "left_wrist", "right_wrist", "left_ankle", "right_ankle".

        Raises:
            RobotModelError: the robot has no such sensor.
        """

    @abstractmethod
    def read_imu(self) -> ImuReading:
        """Return what the inertial measurement unit tells.

        Raises:
            RobotModelError: the robot has none.
        """

    # Going

    @property
    def odom(self) -> Coordinates:
        """Return where the base link is in the world, as odometry tells."""
        return self.read_base()

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

    # Hands

    def move_gripper(
        self, arm: str, pos: float, effort: float = 25, wait: bool = True, ignore_stall: bool = False
    ) -> list[bool]:
        """Open or close a gripper.

        Args:
            arm: "larm", "rarm" or "arms", which is all that the robot has.
            pos: From 0 (closed) to 1 (open).
            effort: At most [N; N m for hinges].
            wait: Return when it is done.
            ignore_stall: Let a hand that something stopped count as done.

        Returns:
            Of each hand, whether it got there; empty without ``wait``.

        Raises:
            UnknownNameError: another arm.
        """
        opening = number("pos", pos, low=0.0, high=1.0)
        force = number("effort", effort, above=0.0)
        if arm not in ARMS:
            raise UnknownNameError("arm", arm, list(ARMS))
        known = self.robot.description.hands
        # a robot with one hand has "arms" too; one whose description names none may have them all the same
        hands = [hand for hand in ARMS[arm] if arm != "arms" or hand in known or not known]
        goals = [self.send_gripper(hand, opening, force) for hand in hands]
        if not wait:
            return []
        self.wait_until(lambda: all(goal.is_done for goal in goals))
        return [goal.succeeded or ignore_stall for goal in goals]

    def start_grasp(self, arm: str = "arms", effort: float = 25, wait: bool = True) -> list[bool]:
        """Close a hand on what is in it; see ``move_gripper``. A hand that something stops has done its work."""
        return self.move_gripper(arm, 0.0, effort, wait, ignore_stall=True)

    def stop_grasp(self, arm: str = "arms", effort: float = 25, wait: bool = True) -> list[bool]:
        """Open a hand, and let go what it holds; see ``move_gripper``."""
        return self.move_gripper(arm, 1.0, effort, wait)

    # Sensors

    def force_vector(self, limb: str | None = None) -> Any:
        """Return the force (3,) [N] that a hand or foot exerts on its arm or leg, in the frame of the sensor between.

        Args:
            limb: "larm", "rarm", "lleg" or "rleg"; None returns all that the robot has, by limb.
        """
        return self._wrenches(limb, 0)

    def moment_vector(self, limb: str | None = None) -> Any:
        """Return the torque (3,) [N m] likewise, about the sensor's origin."""
        return self._wrenches(limb, 1)

    def imucoords(self) -> Coordinates:
        """Return the orientation of the inertial measurement unit in the world; its position is the model's."""
        return Coordinates(self.robot.frame_pose("imu").position, self.read_imu().quaternion)

    def accel_vector(self) -> np.ndarray:
        """Return the acceleration (3,) [m/s2] that the inertial measurement unit feels; at rest, gravity upwards."""
        return np.array(self.read_imu().linear_acceleration)

    def gyro_vector(self) -> np.ndarray:
        """Return the angular velocity (3,) [rad/s] in the frame of the inertial measurement unit."""
        return np.array(self.read_imu().angular_velocity)

    def zmp_vector(self, wrt: str = "local") -> np.ndarray:
        """Return the zero moment point (3,) [m] on the floor, from the wrenches at the ankles.

        Args:
            wrt: In the frame between the soles ("local") or in the world's ("world").

        Raises:
            RobotModelError: the robot has no force sensors in its legs, or stands on neither.
            InvalidInputError: another frame.
        """
        if wrt not in ("local", "world"):
            raise InvalidInputError(f"wrt must be 'local' or 'world', got {wrt!r}")
        ankles = (WRENCHES["lleg"], WRENCHES["rleg"])
        if not set(ankles) <= set(self.robot.description.frames):
            raise RobotModelError(f"{self.robot.name!r} has no force sensors in its legs")
        self.update_robot_state()
        force, moment = np.zeros(3), np.zeros(3)  # on all feet, about the world's origin
        for frame in ankles:
            pose = self.robot.frame_pose(frame)
            own, torque = (pose.rotation @ part for part in self.read_wrench(frame))
            weight, centre = self._beyond(frame)  # which the sensor does not feel, and the ground does
            force += own + weight
            moment += torque + np.cross(pose.position, own) + np.cross(centre, weight)
        if force[2] < LOADED:
            raise RobotModelError(f"{self.robot.name!r} does not stand: its feet bear {force[2]:.2f} N")
        place, turn = self.footprint().pose()
        point = np.append(zero_moment_point(force, moment, place[2]), place[2])
        return point if wrt == "world" else quat.rotate(quat.inverse(turn), point - place)

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

    def _beyond(self, frame: str) -> tuple[np.ndarray, np.ndarray]:
        """Return what bears the foot beyond a sensor (3,) [N], at rest, and the foot's centre of mass (3,) [m]."""
        model = self.robot.model
        joint = model.frames[self.robot.frame_index(frame)].parentJoint
        own = model.inertias[joint]
        return -own.mass * model.gravity.linear, np.array(self.robot.update().oMi[joint].act(own.lever))

    def _wrenches(self, limb: str | None, part: int) -> Any:
        if limb is None:
            roles = self.robot.description.frames
            return {name: self.read_wrench(frame)[part] for name, frame in WRENCHES.items() if frame in roles}
        if limb not in WRENCHES:
            raise UnknownNameError("limb", limb, list(WRENCHES))
        return self.read_wrench(WRENCHES[limb])[part]
