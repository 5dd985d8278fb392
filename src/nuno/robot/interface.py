"""RobotInterface: a robot as its driver offers it: joints, walking or driving, hands and sensors."""

from __future__ import annotations

import logging
from abc import abstractmethod
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError, RobotModelError, UnknownNameError
from nuno.robot.base_interface import BaseInterface
from nuno.robot.goal import Goal
from nuno.robot.readings import ImuReading
from nuno.robot.support import zero_moment_point
from nuno.shapes import quaternion as quat
from nuno.shapes.coordinates import Coordinates
from nuno.validation import checked, number

logger = logging.getLogger(__name__)

ARMS = {"larm": ("left_hand",), "rarm": ("right_hand",), "arms": ("left_hand", "right_hand")}
WRENCHES = {"larm": "left_wrist", "rarm": "right_wrist", "lleg": "left_ankle", "rleg": "right_ankle"}
"""Limbs, and the role of the frame that forces are measured in."""
LOADED = 1.0
"""[N] Weight that the feet must bear, so that they have a zero moment point."""


class RobotInterface(BaseInterface):
    """A robot: joints (``JointInterface``), eyes (``CameraInterface``), base (``BaseInterface``), hands and sensors.

    Arms are "larm", "rarm" or "arms"; limbs "larm", "rarm", "lleg" and "rleg".
    """

    # What a robot must bring

    @abstractmethod
    def send_gripper(self, hand: str, position: float, effort: float) -> Goal:
        """Let a hand ("left_hand", "right_hand") open or close, and return the goal at once.

        Args:
            hand: Which.
            position: How far it is to be open, from 0 (closed) to 1.
            effort: At most [N]: how hard the fingers press on what is between them.
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

    # Hands

    @checked
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
        return [goal.succeeded or ignore_stall for goal in self._move_hands(arm, pos, effort, wait)]

    @checked
    def start_grasp(self, arm: str = "arms", effort: float = 25, wait: bool = True) -> list[bool]:
        """Close a hand on what is in it; see ``move_gripper``.

        Returns:
            Of each hand, whether it holds something now, False where it closed on nothing; empty without ``wait``.
        """
        return [goal.holds is True for goal in self._move_hands(arm, 0.0, effort, wait)]

    @checked
    def stop_grasp(self, arm: str = "arms", effort: float = 25, wait: bool = True) -> list[bool]:
        """Open a hand, and let go what it holds; see ``move_gripper``."""
        return self.move_gripper(arm, 1.0, effort, wait)

    # Sensors

    @checked
    def force_vector(self, limb: str | None = None) -> Any:
        """Return the force (3,) [N] that a hand or foot exerts on its arm or leg, in the frame of the sensor between.

        Args:
            limb: "larm", "rarm", "lleg" or "rleg"; None returns all that the robot has, by limb.
        """
        return self._wrenches(limb, 0)

    @checked
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

    @checked
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

    # Inside

    def _move_hands(self, arm: str, pos: float, effort: float, wait: bool) -> list[Goal]:
        """Send hands their goals, and return these once all have ended; none without ``wait``."""
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
        return goals

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
